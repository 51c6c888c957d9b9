"""The dbt project over the store of a small fleet, against the program's own export read by Polars."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import duckdb
import polars as pl
import pytest
from deltalake import write_deltalake

from conftest import TOP


def dbt(folder: Path, results: Path, *args: str) -> tuple[int, dict[str, str]]:
    """Runs dbt on a copy of the project; its exit code, and the status of each node by name."""
    project = folder / "dbt"
    shutil.copytree(TOP / "docs/orchestration/dbt", project, ignore=shutil.ignore_patterns("target", "logs", "*.duckdb"))
    environment = os.environ | {"FREEPLAY_RESULTS": str(results), "DBT_SEND_ANONYMOUS_USAGE_STATS": "false"}
    ended = subprocess.run([Path(sys.executable).with_name("dbt"), *args], cwd=project, env=environment)
    file = {"build": "run_results.json", "source": "sources.json"}[args[0]]
    results_file = json.loads((project / "target" / file).read_text(encoding="utf-8"))
    return ended.returncode, {node["unique_id"].split(".")[2]: node["status"] for node in results_file["results"]}


@pytest.fixture(scope="session")
def exported(processed: Path, freeplay: str) -> pl.DataFrame:
    """Every record, as the program exports it."""
    file = processed.with_name("records.parquet")
    command = [freeplay, "store", "export", "--format", "parquet", "--output", str(file)]
    subprocess.run(command, cwd=processed, check=True)
    return pl.read_parquet(file)


def test_the_marts_agree_with_the_exported_records(tmp_path: Path, processed: Path, exported: pl.DataFrame) -> None:
    code, nodes = dbt(tmp_path, processed / "results", "build", "--warn-error")
    assert code == 0
    assert set(nodes.values()) == {"success", "pass"}

    with duckdb.connect(tmp_path / "dbt/freeplay.duckdb", read_only=True) as database:
        latest = database.sql("from latest_gap_by_unit").pl()
        by_month = database.sql("from flights_by_month").pl()
        staged = database.sql("select count(*), count(gap_m) from stg_gap_records").fetchall()
    assert staged == [(120, 116)] == [(len(exported), exported["gap_m"].count())]

    estimates = exported.filter(pl.col("status") == "estimated").sort("departure_utc")
    columns = ["serial_number", "flight_id", "gap_m", "gap_p95_m"]
    expected = estimates.group_by("serial_number").last().select(columns).sort("serial_number")
    assert latest.select(columns).sort("serial_number").equals(expected)
    assert dict(latest.group_by("tail_number").agg(pl.col("rejected_since").sum()).rows()) == {
        "N412FP": 0, "N413FP": 0, "N414FP": 4,
    }  # fmt: skip
    assert latest["flights"].to_list() == [10] * 12

    months = (
        exported.group_by(pl.col("departure_utc").dt.strftime("%Y-%m-01").alias("month"), "tail_number")
        .agg(
            pl.col("flight_id").n_unique(),
            pl.len(),
            (pl.col("status") == "refused").sum(),
            pl.col("reason").filter(pl.col("status") == "refused").first(),
        )
        .sort("month", "tail_number")
    )
    assert [(str(row[0]), *row[1:]) for row in by_month.sort("month", "tail_number").rows()] == months.rows()
    assert by_month["most_frequent_rejection"].drop_nulls().to_list() == ["no_load_reversal"]


def test_records_that_were_processed_just_now_are_fresh(tmp_path: Path, processed: Path) -> None:
    assert dbt(tmp_path, processed / "results", "source", "freshness") == (0, {"freeplay": "pass"})


def test_a_store_with_wrong_rows_fails_the_tests_of_its_source_and_stops_the_models(
    tmp_path: Path, exported: pl.DataFrame
) -> None:
    table = pl.concat([exported, exported.head(1)]).to_arrow()
    write_deltalake(tmp_path / "results/gaps", table)
    code, nodes = dbt(tmp_path, tmp_path / "results", "build")
    assert code == 1
    failed = [name for name, status in nodes.items() if status == "fail"]
    assert failed == ["source_unique_combination_freeplay_gaps_tail_number__flight_id__position"]
    assert nodes["stg_gap_records"] == "skipped"


def test_an_unknown_status_and_a_missing_gap_fail_the_tests_of_the_staging_model(
    tmp_path: Path, exported: pl.DataFrame
) -> None:
    first = pl.int_range(pl.len()) == 0
    wrong = exported.with_columns(
        pl.when(first).then(pl.lit("unknown")).otherwise("status").alias("status"),
        pl.when(pl.int_range(pl.len()) == 1).then(None).otherwise("gap_m").alias("gap_m"),
    )
    write_deltalake(tmp_path / "results/gaps", wrong.to_arrow())
    code, nodes = dbt(tmp_path, tmp_path / "results", "build")
    assert code == 1
    assert sorted(name for name, status in nodes.items() if status == "fail") == [
        "accepted_values_stg_gap_records_status__estimated__refused",
        "not_null_stg_gap_records_gap_m",
    ]
