"""The code location of Dagster on a small fleet, with the real program."""

import json
import os
import subprocess
from pathlib import Path

import dagster as dg
import definitions
import polars as pl
import pytest


def run_job(**selection: object) -> dg.ExecuteInProcessResult:
    """Runs what the schedule starts, in this process."""
    job = definitions.defs.resolve_job_def(definitions.daily.job_name)
    return job.execute_in_process(run_config={"ops": {"gap_records": {"config": selection}}})


def materialize(**settings: object) -> dg.ExecuteInProcessResult:
    """Materializes the gap records with settings of the resource."""
    resources = {"freeplay": definitions.Freeplay(**settings)}
    return dg.materialize([definitions.gap_records], resources=resources, raise_on_error=False)


def metadata(result: dg.ExecuteInProcessResult, asset: str) -> dict[str, object]:
    """Values of a materialization's metadata."""
    (event,) = result.asset_materializations_for_node(asset)
    return {name: value.value for name, value in event.metadata.items()}


def checks(result: dg.ExecuteInProcessResult) -> dict[str, bool]:
    """Checks of a run, and whether they passed."""
    return {check.check_name: check.passed for check in result.get_asset_check_evaluations()}


def found(result: dg.ExecuteInProcessResult, name: str) -> list[str]:
    """Findings that a check lists."""
    (check,) = [check for check in result.get_asset_check_evaluations() if check.check_name == name]
    return list(check.metadata["found"].value)


def test_the_daily_job_stores_records_and_writes_trends_and_report(
    freeplay: str, new_fleet: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    dg.Definitions.validate_loadable(definitions.defs)
    monkeypatch.setenv("FREEPLAY_FOLDER", str(new_fleet))
    monkeypatch.setenv("PATH", f"{Path(freeplay).parent}{os.pathsep}{os.environ['PATH']}")

    limited = metadata(run_job(tail="N412FP", limit=2), "gap_records")
    assert (limited["logs_done"], limited["flights"], limited["records"]) == (2, 2, 8)

    result = run_job()
    run = metadata(result, "gap_records")
    assert (run["exit_code"], run["logs_found"], run["logs_done"], run["logs_failed"]) == (0, 30, 28, 0)
    records = pl.read_delta(str(new_fleet / "results/gaps"))
    of_run = records.filter(pl.col("run_id") == run["run_id"])
    assert (run["records"], len(records)) == (len(of_run), 120)
    assert run["records_rejected"] == of_run.filter(pl.col("gap_m").is_null()).height == 4

    trends = pl.read_parquet(str(metadata(result, "trends")["path"]))
    assert metadata(result, "trends")["dagster/row_count"] == trends["serial_number"].n_unique() == 12
    assert metadata(result, "trends")["units_plan"] == trends.filter(pl.col("state") == "plan").height > 0
    report = Path(str(metadata(result, "report")["path"])).read_text(encoding="utf-8")
    assert all(serial in report for serial in trends["serial_number"])

    # The fleet's newest flight is of November 2026, older than a week.
    assert checks(result) == dict.fromkeys(["logs", "mapping", "aircraft", "units", "alerts"], True) | {
        "newest_flight": False
    }


def test_a_recent_flight_passes_the_check_of_its_age(freeplay: str, fleet: Path) -> None:
    resources = {"freeplay": definitions.Freeplay(folder=str(fleet), program=freeplay, newest_flight_days=1e5)}
    result = dg.materialize([definitions.trends], resources=resources)
    assert checks(result) == {"newest_flight": True}


def test_a_truncated_log_fails_its_check_until_it_is_gone_but_not_the_asset(
    freeplay: str, fleet: Path
) -> None:
    logs = fleet / "sample-data/logs/N412FP"
    log = logs / "20261120T130719Z_N412FP-0099.parquet"
    log.write_bytes(next(logs.glob("*.parquet")).read_bytes()[:3000])

    # The second run does not read the log again, and still ends with 1.
    for exit_code, failed in [(1, 1), (1, 0)]:
        result = materialize(folder=str(fleet), program=freeplay)
        assert result.success
        run = metadata(result, "gap_records")
        assert (run["exit_code"], run["logs_failed"]) == (exit_code, failed)
        assert [name for name, passed in checks(result).items() if not passed] == ["logs"]
        assert found(result, "logs") == [str(log.relative_to(fleet))]

    log.unlink()
    assert checks(materialize(folder=str(fleet), program=freeplay))["logs"]


def test_an_aircraft_without_logs_is_a_warning(freeplay: str, new_fleet: Path) -> None:
    for tail, kept in [("N412FP", 0), ("N413FP", 9), ("N414FP", 9)]:
        for at, log in enumerate(sorted((new_fleet / "sample-data/logs" / tail).iterdir())):
            if at != kept:
                log.unlink()
    result = materialize(folder=str(new_fleet), program=freeplay)
    assert result.success
    assert [finding.split()[0] for finding in found(result, "aircraft")] == ["N412FP"]


def test_units_in_an_urgent_state_are_a_warning_with_exit_code_4(
    freeplay: str, fleet: Path
) -> None:
    result = materialize(folder=str(fleet), program=freeplay, fail_on="plan")
    assert result.success
    assert metadata(result, "gap_records")["exit_code"] == 4
    assert [name for name, passed in checks(result).items() if not passed] == ["units"]
    trends = json.loads(subprocess.check_output([freeplay, "trend", "--json"], cwd=fleet))
    urgent = {unit["serial_number"] for unit in trends if unit["state"] in ("plan", "act")}
    assert {finding.split(":")[0] for finding in found(result, "units")} == urgent != set()


@pytest.mark.parametrize(("fail_on", "exit_code", "failed"), [("act", 5, ["alerts"]), ("plan", 4, ["units", "alerts"])])
def test_an_alert_that_was_not_sent_is_a_warning_also_behind_another_exit_code(
    freeplay: str, fleet: Path, fail_on: str, exit_code: int, failed: list[str]
) -> None:
    with (fleet / "pipeline.toml").open("a", encoding="utf-8") as file:
        file.write('\n[alerts.planner]\ncommand = ["false"]\n')
    result = materialize(folder=str(fleet), program=freeplay, fail_on=fail_on)
    assert result.success
    assert metadata(result, "gap_records")["exit_code"] == exit_code
    assert [name for name, passed in checks(result).items() if not passed] == failed
    assert found(result, "alerts")[0].startswith("alert_not_sent: alerts `planner`")


def misconfigure(fleet: Path, freeplay: str) -> str:
    """A key that does not exist: code 2."""
    (fleet / "pipeline.toml").write_text("[logs]\nfile = []\n", encoding="utf-8")
    return freeplay


def damage(fleet: Path, freeplay: str) -> str:
    """A table without the commits of its log: code 3."""
    for commit in (fleet / "results/gaps/_delta_log").glob("*.json"):
        commit.write_text("{", encoding="utf-8")
    return freeplay


def interrupt(fleet: Path, freeplay: str) -> str:
    """An interrupt once the run is in the list of runs: code 130."""
    program = fleet / "interrupted"
    runs = fleet / "results/runs/_delta_log"
    begun = len(list(runs.glob("*.json"))) + 1
    program.write_text(
        f'#!/bin/sh\n"{freeplay}" "$@" --redo --jobs 1 &\n'
        f'until [ "$(ls "{runs}" 2>/dev/null | grep -c json$)" -ge {begun} ]; do :; done\n'
        "kill -INT $!\nwait $!\n"
    )
    program.chmod(0o755)
    return str(program)


@pytest.mark.parametrize(("cause", "exit_code"), [(misconfigure, 2), (damage, 3), (interrupt, 130)])
def test_a_run_without_complete_results_is_a_failure(
    freeplay: str, fleet: Path, cause, exit_code: int
) -> None:
    result = materialize(folder=str(fleet), program=cause(fleet, freeplay))
    assert not result.success
    assert not result.asset_materializations_for_node("gap_records")
    failure = result.failure_data_for_node("gap_records").user_failure_data
    assert failure.metadata["exit_code"].value == exit_code
    assert failure.metadata["messages"].value or exit_code == 130
    assert definitions.FAILURES[exit_code] in failure.description


def test_a_cancelled_run_ends_in_order_and_the_store_is_intact(
    freeplay: str, fleet: Path
) -> None:
    class Cancelled:
        def info(self, _: str) -> None:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        definitions.Freeplay(folder=str(fleet), program=freeplay).call(Cancelled(), "run", "--redo", accepted={0})
    runs = json.loads(subprocess.check_output([freeplay, "store", "runs", "--json"], cwd=fleet))
    assert sorted(run["exit_code"] for run in runs) == [0, 130]
    subprocess.run([freeplay, "store", "verify"], cwd=fleet, check=True)
