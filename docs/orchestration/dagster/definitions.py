"""Dagster code location for Freeplay: one run a day, its checks, the trends and the report.

    FREEPLAY_FOLDER=/srv/freeplay dagster dev -f definitions.py

`FREEPLAY_FOLDER` is the folder with `pipeline.toml`; `freeplay` is found on the PATH. Freeplay finds new and changed
logs by itself, also late ones, so the assets have no partitions. To limit a run, use the fields of `Selection`.
"""

import json
import subprocess
import tempfile
from collections import Counter, deque
from collections.abc import Iterator
from datetime import datetime, timedelta, timezone
from pathlib import Path
from signal import SIGINT
from typing import Any

import dagster as dg
from pyarrow import parquet

# Exit codes of a run whose results are stored. Codes 1, 4 and 5 are findings: the checks below show them.
COMPLETE = {0, 1, 4, 5}
FAILURES = {
    2: "usage or configuration is wrong: nothing was processed",
    3: "the run itself failed: what was stored before is intact",
    130: "interrupted: finished flights are stored, and the next run processes the rest",
}
STATES = ["normal", "watch", "plan", "act"]


class Selection(dg.Config):
    """Flags of `freeplay run` that limit it or repeat work; by default, it processes all new and changed logs."""

    since: str | None = None
    until: str | None = None
    tail: str | None = None
    serial: str | None = None
    limit: int | None = None
    retry: bool = False
    redo: bool = False

    def flags(self) -> list[str]:
        chosen = [(name, value) for name, value in self.model_dump().items() if value not in (None, False)]
        return [f"--{name}" if value is True else f"--{name}={value}" for name, value in chosen]


class Freeplay(dg.ConfigurableResource):
    """The program, and the folder with `pipeline.toml`."""

    folder: str
    program: str = "freeplay"
    fail_on: str = "act"
    newest_flight_days: float = 7.0

    def call(self, log: dg.DagsterLogManager, *args: str, accepted: set[int]) -> tuple[int, str]:
        """Starts a command and returns its exit code and output; any code that is not `accepted` is a failure."""
        with (
            tempfile.TemporaryFile("w+", encoding="utf-8") as output,
            subprocess.Popen(
                [self.program, *args], cwd=self.folder, stdout=output, stderr=subprocess.PIPE, encoding="utf-8"
            ) as process,
        ):
            messages: deque[str] = deque(maxlen=20)
            try:
                for line in process.stderr or ():
                    log.info(line.rstrip())
                    messages.append(line)
                code = process.wait()
            except BaseException:
                process.send_signal(SIGINT)  # Freeplay finishes the flights in progress.
                process.communicate()
                raise
            if code not in accepted:
                meaning = FAILURES.get(code, "a finding, or an unknown error")
                raise dg.Failure(
                    description=f"`freeplay {args[0]}` ended with exit code {code}: {meaning}",
                    metadata={"exit_code": code, "messages": "".join(messages)},
                )
            output.seek(0)
            return code, output.read()


@dg.asset(
    group_name="freeplay",
    kinds={"rust", "deltalake"},
    check_specs=[
        dg.AssetCheckSpec("logs", asset="gap_records", description="No log failed, in this run or an earlier one."),
        dg.AssetCheckSpec("mapping", asset="gap_records", description="No part, tail or actuator is mapped wrongly."),
        dg.AssetCheckSpec("aircraft", asset="gap_records", description="Every aircraft of the fleet still sends logs."),
        dg.AssetCheckSpec("units", asset="gap_records", description="No unit is in state `fail_on` or a more urgent one."),
        dg.AssetCheckSpec("alerts", asset="gap_records", description="All alerts were sent, all work requests stored."),
    ],
)
def gap_records(
    context: dg.AssetExecutionContext, config: Selection, freeplay: Freeplay
) -> dg.MaterializeResult:
    """Delta table `results/gaps`: one record per actuator and flight."""
    code, output = freeplay.call(
        context.log,
        "run", "--json", "--wait=20m", f"--fail-on={freeplay.fail_on}", *config.flags(),
        accepted=COMPLETE,
    )  # fmt: skip
    summary = json.loads(output)
    rejected = sum(summary["refused"].values())
    return dg.MaterializeResult(
        metadata={
            "exit_code": code,
            "run_id": summary["run_id"],
            "logs_found": summary["found"],
            "logs_done": summary["done"],
            "logs_failed": len({error["log"] for error in summary["errors"]}),
            "flights": summary["flights"],
            "records": summary["estimated"] + rejected,
            "records_rejected": rejected,
            "units_need_action": len(summary["work_list"]),
            "duration_s": summary["took_s"],
        },
        check_results=list(findings(summary, freeplay.fail_on)),
    )


def findings(summary: dict[str, Any], fail_on: str) -> Iterator[dg.AssetCheckResult]:
    """Check results of a run. They come from its summary, because code 1 takes precedence over 4, and 4 over 5."""

    def check(name: str, found: list[str], severity: dg.AssetCheckSeverity) -> dg.AssetCheckResult:
        return dg.AssetCheckResult(
            check_name=name, passed=not found, severity=severity, metadata={"number": len(found), "found": found}
        )

    error, warn = dg.AssetCheckSeverity.ERROR, dg.AssetCheckSeverity.WARN
    urgent = STATES[STATES.index(fail_on) :]
    units = [unit for unit in summary["work_list"] if unit["state"] in urgent]
    failed = sorted({log["log"] for log in summary["errors"] + summary["standing_errors"]})
    yield check("logs", failed, error)
    yield check("mapping", [f"{fault['reason']}: {fault['remedy']}" for fault in summary["mapping_faults"]], error)
    yield check("aircraft", [f"{tail['tail_number']} since {tail['since_utc']}" for tail in summary["quiet"]], warn)
    yield check("units", [f"{unit['serial_number']}: {unit['state']}, {unit['reason']}" for unit in units], warn)
    yield check("alerts", [f"{fault['code']}: {fault['what']}" for fault in summary["follow_up_errors"]], warn)


@dg.asset(
    deps=[gap_records],
    group_name="freeplay",
    kinds={"parquet"},
    check_specs=[
        dg.AssetCheckSpec("newest_flight", asset="trends", description="The newest flight of the fleet is recent.")
    ],
)
def trends(context: dg.AssetExecutionContext, freeplay: Freeplay) -> dg.MaterializeResult:
    """File `trends.parquet`: level, rate, time to limit and state of each unit."""
    file = Path(freeplay.folder, "trends.parquet").absolute()
    freeplay.call(context.log, "trend", "--format=parquet", f"--output={file}", accepted={0})
    units = parquet.read_table(file, columns=["state", "as_of_utc"]).to_pylist()
    states = Counter(unit["state"] or "not_assessed" for unit in units)
    newest = max((unit["as_of_utc"] for unit in units), default=datetime.min.replace(tzinfo=timezone.utc))
    age_days = (datetime.now(timezone.utc) - newest) / timedelta(days=1)
    return dg.MaterializeResult(
        metadata={
            "path": dg.MetadataValue.path(file),
            "dagster/row_count": len(units),
            **{f"units_{state}": states[state] for state in [*STATES, "not_assessed"]},
        },
        check_results=[
            dg.AssetCheckResult(
                check_name="newest_flight",
                passed=age_days <= freeplay.newest_flight_days,
                severity=dg.AssetCheckSeverity.WARN,
                metadata={"newest_flight": newest.isoformat(), "age_days": age_days},
            )
        ],
    )


@dg.asset(deps=[gap_records], group_name="freeplay", kinds={"html"})
def report(context: dg.AssetExecutionContext, freeplay: Freeplay) -> dg.MaterializeResult:
    """Folder `report`: pages of the fleet, its tails and its units."""
    folder = Path(freeplay.folder, "report").absolute()
    freeplay.call(context.log, "report", f"--output={folder}", accepted={0})
    return dg.MaterializeResult(metadata={"path": dg.MetadataValue.path(folder / "index.html")})


daily = dg.ScheduleDefinition(
    name="daily", target=dg.AssetSelection.groups("freeplay"), cron_schedule="0 2 * * *", execution_timezone="UTC"
)

defs = dg.Definitions(
    assets=[gap_records, trends, report],
    schedules=[daily],
    resources={"freeplay": Freeplay(folder=dg.EnvVar("FREEPLAY_FOLDER"))},
)
