"""What a reader of the stubs may write: checked by mypy --strict, never run."""

from __future__ import annotations

from datetime import datetime, timezone

import freeplay_ema as fp
import pyarrow as pa

found: fp.Table = fp.estimate(["a.parquet"], "pipeline.toml", part="EMA-27-1040")
rows: int = len(found) + found.num_rows
names: list[str] = found.column_names
trend: fp.Table = fp.trend(found, as_of=datetime(2026, 11, 1, tzinfo=timezone.utc))
again: fp.Table = fp.trend(pa.table(found), fp.load(["a.toml", "b.toml"]), serial="00317")
files: list[str] = fp.normalize("a.parquet", "normalized")
try:
    summary: fp.RunSummary = fp.run(retry=True)
    codes: list[str] = [error.code for error in summary.errors]
    verdict: str = fp.explain("F1", "aileron_left").verdict
    shown: fp.Table = fp.check(limit=3).errors
    page: str = fp.report("report").index
    changed: int = len(fp.diff("a", "b", min_change_m=1e-6)) + fp.work(status="all").num_rows
except fp.FreeplayError as error:
    code: str | None = error.code
    remedy: str | None = error.help
