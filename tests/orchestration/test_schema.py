"""The JSON Schema of `pipeline.toml` that editors read, against an outside validator."""

import json
import subprocess
import tomllib
from pathlib import Path

import pytest
from conftest import TOP
from jsonschema import Draft202012Validator

CONFIGURATIONS = [
    "pipeline.toml",
    "crates/cli/templates/pipeline.toml",
    "tests/data/flights/pipeline.toml",
    "tests/data/kr300/pipeline.toml",
]
MISTAKES = [
    ('unit = "s"', 'unitt = "s"'),
    ('unit = "s"', 'unit = "seconds of arc"'),
    ("[clock]", "[clokc]"),
    ("[part.A]", '[part.A]\nlimit_m = "wide"'),
    ("[part.A]", "[[channel.when]]\nequals = [1]\n[part.A]"),
    ('files = ["*.parquet"]', 'files = "*.parquet"'),
    ("bandwidth_hz = 10.0", "bandwidth_hz = true"),
]


@pytest.fixture(scope="module")
def schema(tmp_path_factory: pytest.TempPathFactory, freeplay: str) -> Draft202012Validator:
    """The schema that `freeplay init` writes."""
    folder = tmp_path_factory.mktemp("schema") / "fleet"
    subprocess.run([freeplay, "init", folder, "--quiet"], check=True)
    return Draft202012Validator(json.loads((folder / "pipeline.schema.json").read_text()))


@pytest.mark.parametrize("file", CONFIGURATIONS)
def test_every_configuration_of_the_project_fits_the_schema(schema: Draft202012Validator, file: str) -> None:
    text = (TOP / file).read_text()
    assert [error.message for error in schema.iter_errors(tomllib.loads(text))] == []


@pytest.mark.parametrize("mistake", MISTAKES)
def test_schema_and_program_refuse_the_same_mistakes(
    schema: Draft202012Validator, freeplay: str, tmp_path: Path, mistake: tuple[str, str]
) -> None:
    text = (TOP / "tests/data/flights/pipeline.toml").read_text()
    assert mistake[0] in text
    text = text.replace(*mistake, 1)
    (tmp_path / "pipeline.toml").write_text(text)
    program = subprocess.run([freeplay, "check"], cwd=tmp_path, capture_output=True, text=True)
    assert program.returncode == 2, program
    assert not schema.is_valid(tomllib.loads(text))
