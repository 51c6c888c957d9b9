"""The tables of `report --data` are those of the pages, and the Evidence page asks them questions that they answer."""

from __future__ import annotations

import json
import re
from pathlib import Path

import duckdb
import polars as pl

from conftest import TOP, Command

EVIDENCE = TOP / "docs/dashboards/evidence"


def test_tables_are_those_of_the_pages(fleet: Path, command: Command) -> None:
    command("run", "--quiet", code=0)
    command("report", "-o", "report", "--data", "--quiet")
    pages = json.loads(Path("report/report.json").read_text())
    table = {path.stem: pl.read_parquet(path) for path in Path("report/data").iterdir()}
    command("trend", "--format", "parquet", "-o", "trend.parquet")
    assert table["units"].equals(pl.read_parquet("trend.parquet").select(table["units"].columns))
    assert [unit["serial_number"] for unit in pages["units"]] == table["units"]["serial_number"].to_list()
    command("store", "export", "--format", "parquet", "-o", "records.parquet")
    keys = ["tail_number", "flight_id", "position", "gap_m"]
    records = pl.read_parquet("records.parquet").select(keys).sort(keys)
    assert table["flights"].select(keys).sort(keys).equals(records)
    assert table["tails"]["records"].sum() == records.height
    assert set(table["gaps"]["kind"]) <= {"level", "forecast"}
    assert table["removals"].height == 12


def test_evidence_page_is_answered(fleet: Path, command: Command) -> None:
    command("run", "--quiet")
    command("report", "-o", "report", "--data", "--quiet")
    database = duckdb.connect()
    database.execute("create schema freeplay")
    for source in sorted((EVIDENCE / "sources/freeplay").glob("*.sql")):
        query = source.read_text().replace("${data}", "report/data")
        database.execute(f"create view freeplay.{source.stem} as {query}")
    page = (EVIDENCE / "pages/index.md").read_text()
    queries = dict(re.findall(r"```sql (\w+)\n(.*?)```", page, flags=re.DOTALL))
    answers = {name: database.sql(query).pl() for name, query in queries.items()}
    units = len(json.loads(Path("report/report.json").read_text())["units"])
    assert answers["states"]["units"].sum() == units
    records = pl.read_parquet("report/data/flights.parquet")
    assert answers["flights_by_month"].select(pl.sum_horizontal("estimated", "rejected").sum()).item() == records.height
    assert answers["work_list"].height > 0 and answers["gaps"].height > 0
    # Every component shows a query of the page, and its columns.
    for component in re.findall(r"<\w+ [^>]*>", page):
        data = re.search(r"data=\{(\w+)\}", component)
        assert data is not None and data[1] in answers, component
        for axis in re.findall(r"\b(?:x|y|series)=(\w+)", component):
            assert axis in answers[data[1]].columns, component
