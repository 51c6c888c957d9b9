"""What a reader of the stubs may write: checked by mypy --strict, never run."""

from __future__ import annotations

from datetime import datetime, timezone

import freeplay
import pyarrow as pa

found: freeplay.Table = freeplay.estimate(["a.parquet"], "pipeline.toml", part="EMA-27-1040")
rows: int = len(found) + found.num_rows
names: list[str] = found.column_names
trend: freeplay.Table = freeplay.trend(found, as_of=datetime(2026, 11, 1, tzinfo=timezone.utc))
again: freeplay.Table = freeplay.trend(pa.table(found), freeplay.load(["a.toml", "b.toml"]), serial="00317")
files: list[str] = freeplay.normalize("a.parquet", "normalized")
try:
    freeplay.run(retry=True)
except freeplay.FreeplayError as error:
    code: str | None = error.code
    remedy: str | None = error.help
