"""The nightly run through Spark Connect gives the store of one machine."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import freeplay_ema as fp
import pyarrow as pa
from conftest import TOP, Command
from compare_tables import differing


def test_a_run_through_spark_connect_is_that_of_one_machine(fleet: Path, command: Command) -> None:
    script = str(TOP / "tests/python/spark_connect_run.py")
    done = subprocess.run([sys.executable, script, "theirs"], capture_output=True, text=True)
    assert done.stdout.split()[-4:] == ["30", "120", "0", "0"], done.stdout + done.stderr
    fp.run()
    theirs = pa.table(fp.records(fp.load().replaced(store="theirs")))
    assert differing(theirs, pa.table(fp.records()), {"run_id", "processed_utc"}) == []
    Path("pipeline.toml").write_text(Path("pipeline.toml").read_text().replace('"results"', '"theirs"'))
    assert "30 logs: 0 new or changed, 30 already processed" in command("run").stdout
