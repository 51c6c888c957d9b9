"""The program, the code location of Dagster, and a small fleet of which one flight is rejected."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pyarrow as pa
import pytest
from pyarrow import parquet

TOP = Path(__file__).parents[2]
sys.path.append(str(TOP / "docs/orchestration/dagster"))
REJECTED = "20261114T085102Z_N414FP-0010.parquet"


@pytest.fixture(scope="session")
def freeplay() -> str:
    """The program, by its absolute path."""
    return os.environ["FREEPLAY"]


def reject(log: Path) -> None:
    """Makes the load of a log a pull without reversals."""
    table = parquet.read_table(log)
    for at, name in enumerate(table.column_names):
        if name.endswith("_load_n"):
            pull = [abs(load) + 5000.0 for load in table[name].to_pylist()]
            table = table.set_column(at, table.schema.field(at), pa.array(pull, table.schema.field(at).type))
    identity = {key: value for key, value in parquet.read_metadata(log).metadata.items() if key != b"ARROW:schema"}
    parquet.write_table(table.replace_schema_metadata(identity), log)


def copied(folder: Path) -> Path:
    """Three aircraft with ten flights each, not processed; the last flight of N414FP has no load reversal."""
    shutil.copytree(TOP / "tests/data/three-aircraft", folder)
    reject(folder / "sample-data/logs/N414FP" / REJECTED)
    return folder


@pytest.fixture
def new_fleet(tmp_path: Path) -> Path:
    return copied(tmp_path / "fleet")


@pytest.fixture(scope="session")
def processed(tmp_path_factory: pytest.TempPathFactory, freeplay: str) -> Path:
    """That fleet after a run; tests copy it."""
    folder = copied(tmp_path_factory.mktemp("processed") / "fleet")
    subprocess.run([freeplay, "run", "--quiet"], cwd=folder, check=True)
    return folder


@pytest.fixture
def fleet(tmp_path: Path, processed: Path) -> Path:
    """A processed fleet of the test's own."""
    return Path(shutil.copytree(processed, tmp_path / "fleet"))
