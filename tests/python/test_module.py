"""The module's doors against the command's: the same rows, the same words, and nothing copied on the way."""

from __future__ import annotations

import json
import sys
import threading
from datetime import datetime
from pathlib import Path

import duckdb
import freeplay_ema as fp
import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from conftest import Command
from freeplay_ema import _freeplay
from compare_tables import differing

PART = "EMA-27-1040"


def test_estimates_are_the_commands_bit_by_bit(logs: list[str], command: Command) -> None:
    command("estimate", *logs, "--format", "parquet", "--output", "printed.parquet")
    found = pa.table(fp.estimate(logs))
    assert found.num_rows == 4 * len(logs)
    assert differing(found, pq.read_table("printed.parquet")) == []


def test_estimates_as_a_part_are_the_commands(logs: list[str], command: Command) -> None:
    command("estimate", logs[0], "--part", PART, "--format", "parquet", "--output", "printed.parquet")
    assert differing(pa.table(fp.estimate(logs[0], part=PART)), pq.read_table("printed.parquet")) == []


def test_a_run_and_its_records_are_the_commands(fleet: Path, command: Command) -> None:
    account = fp.run(fp.load("pipeline.toml").replaced(store="ours"))
    printed = json.loads(command("run", "--json").stdout)
    assert (account.found, account.estimated, account.errors) == (printed["found"], printed["estimated"], [])
    command("store", "export", "--format", "parquet", "--output", "printed.parquet")
    ours = pa.table(fp.records(fp.load().replaced(store="ours")))
    assert differing(ours, pq.read_table("printed.parquet"), {"run_id", "processed_utc"}) == []
    assert f"0 new or changed, {account.found} already processed" in command("run").stdout


def test_trends_are_the_commands_from_store_table_and_queries(fleet: Path, command: Command) -> None:
    command("run")
    command("trend", "--format", "parquet", "--output", "printed.parquet")
    assert differing(pa.table(fp.trend()), pq.read_table("printed.parquet")) == []
    command("store", "export", "--format", "csv", "--output", "history.csv")
    command("trend", "--estimates", "history.csv", "--format", "parquet", "--output", "of-table.parquet")
    history = pl.read_csv("history.csv")
    assert differing(pa.table(fp.trend(history)), pq.read_table("of-table.parquet")) == []
    asked = pa.table({"serial_number": ["1040-0013", "1040-0009"], "as_of_utc": ["2026-10-20", "2026-10-01"]})
    Path("asked.csv").write_text("serial_number,as_of_utc\n1040-0013,2026-10-20\n1040-0009,2026-10-01\n")
    command("trend", "--queries", "asked.csv", "--format", "parquet", "--output", "of-days.parquet")
    assert differing(pa.table(fp.trend(queries=asked)), pq.read_table("of-days.parquet")) == []


def test_a_table_made_elsewhere_is_judged_without_a_configuration_as_the_command_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: Command
) -> None:
    monkeypatch.chdir(tmp_path)
    days = pl.datetime_range(datetime(2026, 1, 1), datetime(2026, 2, 10), "1d", eager=True, time_zone="UTC")
    gaps = [20e-6 + 0.5e-6 * day + 1e-8 * (day % 3 == 0) for day in range(len(days))]
    history = pl.DataFrame({"serial_number": "U1", "departure_utc": days, "gap_m": gaps, "flight_hours": 1.0})
    history.write_parquet("history.parquet")
    at = "2026-02-10T00:00:00Z"
    for limit, option in [(None, []), (100e-6, ["--limit-m", "100e-6"])]:
        command("trend", "--estimates", "history.parquet", "--as-of", at, *option, "--format", "parquet", "--output", "printed.parquet")
        ours = pa.table(fp.trend(history, limit_m=limit, as_of=at))
        assert differing(ours, pq.read_table("printed.parquet")) == []
        assert ours["limit_m"].to_pylist() == [limit]
    with pytest.raises(ValueError, match="150e-6"):
        fp.trend(history, limit_m=100.0)
    with pytest.raises(fp.ConfigError):
        fp.trend(history, "nowhere.toml")


def test_normalized_logs_are_the_commands_byte_for_byte(logs: list[str], command: Command) -> None:
    written = fp.normalize(logs[:2], "ours")
    command("normalize", *logs[:2], "--output", "printed")
    printed = sorted(Path("printed").rglob("*.parquet"))
    assert len(written) == len(printed) == 8
    assert all(Path("ours", file.relative_to("printed")).read_bytes() == file.read_bytes() for file in printed)


@pytest.mark.parametrize(
    "kind", [pa.table, lambda t: pl.DataFrame(t), pd.DataFrame.from_arrow, lambda t: duckdb.sql("from t")]
)
def test_tables_of_every_library_come_in_and_go_out(kind: object, fleet: Path) -> None:
    every = sorted(fleet.glob("sample-data/logs/N412FP/*.parquet"))
    found = pa.table(fp.estimate(every))
    columns = ["part_number", "serial_number", "departure_utc", "flight_hours", "gap_m", "gap_se_m"]
    theirs = kind(found.select(columns))  # type: ignore[operator]
    assert differing(pa.table(fp.trend(theirs)), pa.table(fp.trend(found.select(columns)))) == []


def test_a_table_of_ours_is_read_by_every_library(logs: list[str]) -> None:
    found = fp.estimate(logs[0])
    gaps = pa.table(found)["gap_m"].to_pylist()
    assert len(found) == len(gaps) == 4
    assert pl.DataFrame(found)["gap_m"].to_list() == gaps
    assert pd.DataFrame.from_arrow(found)["gap_m"].to_list() == gaps
    assert [gap for (gap,) in duckdb.sql("select gap_m from found").fetchall()] == gaps


def test_arrays_give_the_gap_of_the_log_they_come_from(logs: list[str]) -> None:
    """The log's own columns, brought to the screw by hand: a turn is 5 mm of travel."""
    raw = pq.read_table(logs[0])
    column = {name: raw[name].to_numpy().astype(float) for name in raw.column_names}
    motor_m = column["aileron_left_motor_deg"] / 360.0 * 0.005
    screw_m = column["aileron_left_screw_mm"] * 1e-3
    load_n = column["aileron_left_load_n"]
    found = pa.table(fp.estimate_arrays(column["time_s"], motor_m, screw_m, load_n, PART)).to_pylist()[0]
    printed = pa.table(fp.estimate(logs[0])).to_pylist()[0]
    assert printed["position"] == "aileron_left" and printed["part_number"] == PART
    for name in ["gap_m", "gap_se_m", "gap_midrange_m", "stiffness_n_per_m"]:
        assert found[name] == pytest.approx(printed[name], rel=1e-6), name
    assert (found["samples"], found["flags"]) == (printed["samples"], printed["flags"])


def test_columns_of_numbers_come_in_where_they_lie() -> None:
    plain = np.linspace(0.0, 1.0, 100_000)
    assert _freeplay.data_pointer(plain) == plain.ctypes.data
    arrow = pa.array(plain)
    assert _freeplay.data_pointer(arrow) == arrow.buffers()[1].address
    assert _freeplay.data_pointer(pa.chunked_array([arrow])) == arrow.buffers()[1].address
    assert _freeplay.data_pointer(arrow.slice(10)) == arrow.buffers()[1].address + 80
    series = pl.Series(plain)
    assert _freeplay.data_pointer(series) == series.to_numpy(allow_copy=False).ctypes.data
    frame = pd.Series(plain)
    assert _freeplay.data_pointer(frame.to_numpy()) == frame.to_numpy().ctypes.data


def test_what_cannot_be_read_where_it_lies_is_copied_right(fleet: Path) -> None:
    motor = 0.03 * np.sin(np.arange(0, 60, 0.01))
    time_s, load_n = np.arange(0, 60, 0.01), 5e3 * np.cos(np.arange(0, 60, 0.01))
    one = fp.estimate_arrays(time_s, motor, motor + load_n / 5e7, load_n, PART)
    strided = np.stack([motor, motor], axis=1)[:, 0]
    assert not strided.flags["C_CONTIGUOUS"]
    gaps = pa.chunked_array([load_n[:100], load_n[100:]])
    other = fp.estimate_arrays(list(time_s), strided, pl.Series(motor + load_n / 5e7), gaps, PART)
    assert differing(pa.table(one), pa.table(other)) == []


def test_columns_go_out_where_they_lie(logs: list[str]) -> None:
    found = fp.trace(logs[0])
    lies = found.buffer_address("load_n")
    assert pa.table(found)["load_n"].chunk(0).buffers()[1].address == lies
    assert pl.DataFrame(found)["load_n"].to_numpy(allow_copy=False).ctypes.data == lies
    del found
    assert pa.table(fp.trace(logs[0]))["load_n"].null_count == 0, "a table outlives its maker"


def test_other_threads_run_while_an_estimate_is_made(logs: list[str]) -> None:
    """With a switch interval of minutes another thread runs only when the lock is given up."""
    config, ran, gate = fp.load(), threading.Event(), threading.Event()
    fp.estimate(logs[0], config)
    thread = threading.Thread(target=lambda: gate.wait() and ran.set())
    thread.start()
    usual = sys.getswitchinterval()
    sys.setswitchinterval(300.0)
    try:
        gate.set()
        assert not ran.is_set()
        fp.estimate(logs, config)
        assert ran.is_set()
    finally:
        sys.setswitchinterval(usual)
        thread.join()


def test_a_broken_log_of_several_is_an_error_row_in_the_commands_words(logs: list[str], command: Command) -> None:
    Path("torn.parquet").write_bytes(Path(logs[0]).read_bytes()[:1000])
    found = fp.estimate(["torn.parquet", logs[1]])
    command("estimate", logs[1], "--format", "parquet", "--output", "printed.parquet")
    assert differing(pa.table(found), pq.read_table("printed.parquet")) == []
    [error] = found.errors.to_arrow().to_pylist()
    assert (error["log"], error["code"]) == ("torn.parquet", "not_parquet")
    assert "1 error" in repr(found)
    with pytest.raises(fp.LogError) as caught:
        fp.estimate(["torn.parquet", logs[1]], raise_on_error=True)
    printed = command("estimate", "torn.parquet", logs[1], "--no-progress", code=caught.value.exit_code).stderr
    assert str(caught.value) == printed.strip()
    assert caught.value.code == "not_parquet" and caught.value.diagnostics[0]["file"] == "torn.parquet"
    assert error["hint"] == caught.value.help and caught.value.help in printed
    assert differing(pa.table(caught.value.answer), pa.table(found)) == []


def test_a_single_broken_log_raises_unless_asked_not_to(logs: list[str]) -> None:
    Path("torn.parquet").write_bytes(Path(logs[0]).read_bytes()[:1000])
    with pytest.raises(fp.LogError):
        fp.estimate("torn.parquet")
    found = fp.estimate("torn.parquet", raise_on_error=False)
    assert (len(found), len(found.errors)) == (0, 1)
    sound = fp.estimate(logs[0])
    assert len(sound.errors) == 0 and sound.raise_errors() is sound


def test_results_are_converted_and_shown(logs: list[str]) -> None:
    found = fp.estimate(logs[0])
    gaps = pa.table(found)["gap_m"].to_pylist()
    assert found.to_arrow()["gap_m"].to_pylist() == gaps
    assert found.to_polars()["gap_m"].to_list() == gaps
    assert found.to_pandas()["gap_m"].to_list() == gaps
    assert repr(found).startswith(f"<freeplay_ema.Table: {len(gaps)} rows") and "tail_number" in repr(found)
    assert found._repr_html_().count("<tr>") == len(gaps) + 1
    assert "<script>" not in fp.estimate(["<script>.parquet"]).errors._repr_html_()


def test_followed_quantities_are_the_commands(fleet: Path, command: Command) -> None:
    command("run")
    for option, ours in [("quantities", fp.quantities), ("changes", fp.changes)]:
        command("trend", f"--{option}", "--format", "parquet", "--output", f"{option}.parquet")
        assert differing(pa.table(ours()), pq.read_table(f"{option}.parquet")) == [], option
    assert len(fp.quantities(tail="N412FP")) < len(fp.quantities())


def test_backtest_diff_and_work_are_the_commands(fleet: Path, command: Command) -> None:
    command("run")
    command("backtest", "--format", "parquet", "--output", "backtest.parquet")
    assert differing(pa.table(fp.backtest()), pq.read_table("backtest.parquet")) == []
    command("work", "list", "--format", "parquet", "--output", "work.parquet")
    assert differing(pa.table(fp.work()), pq.read_table("work.parquet")) == []
    fp.run(fp.load().replaced(store="one", logs=["sample-data/logs/N412FP/*.parquet"]))
    command("diff", "one", "results", "--format", "parquet", "--output", "diff.parquet")
    ours = pa.table(fp.diff("one", "results"))
    assert ours.num_rows > 0 and differing(ours, pq.read_table("diff.parquet")) == []


def test_an_explanation_is_the_commands(fleet: Path, command: Command) -> None:
    fp.run()
    record = fp.records(tail="N412FP", last=1).to_arrow().to_pylist()[0]
    asked = (record["flight_id"], record["position"])
    ours = fp.explain(*asked)
    printed = json.loads(command("explain", *asked, "--json").stdout)
    assert ours.facts == printed and (ours.verdict, ours.is_current) == ("same", True)
    assert ours.record.to_arrow()["gap_m"].to_pylist() == [record["gap_m"]]
    with pytest.raises(fp.ConfigError) as caught:
        fp.explain("no flight", "aileron_left")
    assert caught.value.code == "no_such_record"


def test_a_check_is_the_commands(logs: list[str], command: Command) -> None:
    command("check", *logs, "--format", "parquet", "--output", "check.parquet")
    assert differing(pa.table(fp.check(logs)), pq.read_table("check.parquet")) == []
    Path("torn.parquet").write_bytes(Path(logs[0]).read_bytes()[:1000])
    assert fp.check("torn.parquet").errors.to_arrow()["code"].to_pylist() == ["not_parquet"]


def test_a_report_has_the_pages_of_the_command(fleet: Path, command: Command) -> None:
    command("run")
    ours = fp.report("ours")
    command("report", "--output", "printed")
    pages = {str(file.relative_to("printed")) for file in Path("printed").rglob("*.html")}
    assert {str(file.relative_to("ours")) for file in Path("ours").rglob("*.html")} == pages
    assert Path(ours.index).is_file() and ours.files >= len(pages)


def test_the_fields_of_a_summary_are_those_of_the_commands_json(fleet: Path, command: Command) -> None:
    Path("sample-data/logs/N412FP/torn.parquet").write_bytes(b"PAR1")
    ours = fp.run(fp.load().replaced(store="ours"))
    printed = json.loads(command("run", "--json", code=1).stdout)
    for name in ["found", "known", "done", "flights", "estimated", "not_reached"]:
        assert getattr(ours, name) == ours[name] == printed[name], name
    assert [error.code for error in ours.errors] == [error["complaint"]["code"] for error in printed["errors"]]
    assert ours.errors[0].log == printed["errors"][0]["log"]


def test_a_wrong_configuration_is_told_in_the_commands_words(fleet: Path, command: Command) -> None:
    text = Path("pipeline.toml").read_text()
    Path("pipeline.toml").write_text(text.replace("screw_mass_kg = 8.0", "screw_mass_kg = -8.0\nmas = 1"))
    with pytest.raises(fp.ConfigError) as caught:
        fp.load()
    printed = command("run", "--no-progress", code=2).stderr
    assert str(caught.value) in printed and caught.value.code == "unknown_key"


def test_a_store_that_is_not_there_is_told_in_the_commands_words(fleet: Path, command: Command) -> None:
    with pytest.raises(fp.RunError) as caught:
        fp.records()
    printed = command("query", "tail", "N412FP", code=caught.value.exit_code).stderr.strip()
    # The command was given a relative folder, as the module was.
    assert str(caught.value) == printed


def test_a_part_that_is_not_configured_is_refused_with_a_remedy(logs: list[str]) -> None:
    with pytest.raises(fp.ConfigError, match="not configured") as caught:
        fp.estimate(logs[0], part="not configured")
    assert caught.value.code == "part_unknown" and "pipeline.toml" in str(caught.value.help)


def test_what_is_no_table_is_a_type_error(fleet: Path) -> None:
    with pytest.raises(TypeError, match="__arrow_c_stream__"):
        fp.trend([1, 2, 3])  # type: ignore[arg-type]
