"""A small fleet of one's own for each test, and the command to hold the module against."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parents[2]


class Command:
    """The binary `freeplay`, asked in the current folder."""

    path = os.environ.get("FREEPLAY", "freeplay")

    def __call__(self, *args: object, code: int = 0) -> subprocess.CompletedProcess[str]:
        done = subprocess.run([self.path, *map(str, args)], capture_output=True, text=True)
        assert done.returncode == code, done.stdout + done.stderr
        return done


@pytest.fixture
def command() -> Command:
    return Command()


@pytest.fixture
def fleet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Thirty logs of three aircraft, below the current folder."""
    shutil.copytree(TOP / "tests/data/three-aircraft", tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def logs(fleet: Path) -> list[str]:
    """Six of them, by the names a user would type."""
    return sorted(str(log.relative_to(fleet)) for log in fleet.glob("sample-data/logs/*/*.parquet"))[::5]
