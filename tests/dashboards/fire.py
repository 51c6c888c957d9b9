"""Makes each alert rule fire by what real runs write, and none by a sound night; checks the systemd units.

An expression is evaluated on the file of `freeplay run --metrics`, as Prometheus would read it at a given time. A rule with
`for:` must hold after two nights in a row.
"""

import fcntl
import os
import re
import shutil
import signal
import subprocess
import tempfile
import time
from pathlib import Path

import promql_parser as promql
import yaml

FREEPLAY = os.environ["FREEPLAY"]
SOUND = "[alerts.files]\nfolder = \"alerts\"\n"
# Flights of the test data lie years back for a clock of later years.
PATIENT = "stale_after_days = 3000.0\n"


class Fleet:
    """A copy of a fleet in a folder of its own."""

    def __init__(self, source: Path, work: Path, name: str):
        self.folder = work / name
        shutil.copytree(source, self.folder)
        self.config = self.folder / "pipeline.toml"
        self.metrics = self.folder / "freeplay.prom"

    def configure(self, old: str, new: str) -> None:
        text = self.config.read_text()
        assert old in text, old
        self.config.write_text(text.replace(old, new, 1))

    def start(self) -> subprocess.Popen:
        command = [FREEPLAY, "run", "-q", "--wait", "10m", "--metrics", self.metrics.name]
        return subprocess.Popen(command, cwd=self.folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def night(self, code: int) -> dict[str, float]:
        """The metrics after a run that ends with a code."""
        ended = self.start().wait()
        assert ended == code, f"{self.folder.name}: exit code {ended}, not {code}"
        return read(self.metrics)

    def interrupted(self) -> dict[str, float]:
        """The metrics after a run that was interrupted while another one held the store."""
        with open(self.folder / "results" / "lock") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            run = self.start()
            time.sleep(1)
            run.send_signal(signal.SIGINT)
            assert run.wait() == 130
        return read(self.metrics)


def read(file: Path) -> dict[str, float]:
    """The samples of a metrics file."""
    samples = (line.split(" ") for line in file.read_text().splitlines() if not line.startswith("#"))
    return {name: float(value) for name, value in samples}


def value(expression, metrics: dict[str, float], now: float) -> float | None:
    """The value of an expression about single series; none where Prometheus gives an empty result."""
    match expression:
        case promql.NumberLiteral():
            return expression.val
        case promql.ParenExpr():
            return value(expression.expr, metrics, now)
        case promql.VectorSelector():
            return metrics.get(expression.name)
        case promql.Call() if expression.func.name == "time":
            return now
        case promql.Call() if expression.func.name == "absent":
            return 1.0 if value(expression.args[0], metrics, now) is None else None
        case promql.BinaryExpr():
            left, right = (value(side, metrics, now) for side in (expression.lhs, expression.rhs))
            return combined(str(expression.op), left, right)
    raise AssertionError(f"no rule needs {expression}")


def combined(operator: str, left: float | None, right: float | None) -> float | None:
    """Comparisons filter: they keep the left value, or nothing."""
    if operator == "or":
        return right if left is None else left
    if left is None or right is None:
        return None
    match operator:
        case "and":
            return left
        case "-":
            return left - right
        case "*":
            return left * right
        case ">":
            return left if left > right else None
        case "==":
            return left if left == right else None
    raise AssertionError(f"no rule needs {operator}")


def nights(work: Path) -> tuple[dict[str, float], dict[str, list[dict[str, float]]]]:
    """The metrics of a sound night, and by rule those of the nights after which it must fire."""
    fleet = Fleet(Path("tests/data/three-aircraft"), work, "sound")
    fleet.config.write_text(fleet.config.read_text() + PATIENT + SOUND)
    sound = fleet.night(0)
    copy = lambda name: Fleet(fleet.folder, work, name)

    failed = copy("failed")
    (failed.folder / "sample-data/installations.csv").unlink()
    broken = copy("broken")
    next(broken.folder.glob("sample-data/logs/*/*0001.parquet")).write_text("broken")
    interrupted, mapped, late = copy("interrupted"), copy("mapped"), copy("late")
    mapped.configure("[channel.load]\n", "[channel.load]\nsign = -1\n")
    late.configure(PATIENT, "stale_after_days = 1.0\n")
    unsent = copy("unsent")
    unsent.configure('folder = "alerts"', 'command = ["false"]')
    unsent.configure("limit_m = 150e-6\nwatch_m = 110e-6", "limit_m = 50e-6")
    at_limit = [unsent.night(5), unsent.night(5)]
    return sound, {
        "FreeplayRunFailed": [failed.night(2)],
        "FreeplayLogsInError": [(broken.night(1), broken.night(1))[1]],
        "FreeplayRunInterrupted": [interrupted.interrupted(), interrupted.interrupted()],
        "FreeplayMappingFault": [mapped.night(1)],
        "FreeplayTailsQuiet": [late.night(0)],
        "FreeplayUnitsStale": [late.night(0), late.night(0)],
        "FreeplayAlertsUnsent": at_limit,
        "FreeplayUnitAtLimit": at_limit[:1],
    }


def check_rules(work: Path) -> int:
    """Each rule fires on its nights and not on a sound one."""
    with open("docs/dashboards/prometheus-rules.yml") as file:
        rules = {rule["alert"]: rule for group in yaml.safe_load(file)["groups"] for rule in group["rules"]}
    sound, bad = nights(work)
    shown = set(re.findall(r"freeplay_\w+", Path("docs/dashboards/grafana.json").read_text()))
    assert shown == set(sound), f"the dashboard shows all metrics and no other: {shown ^ set(sound)}"
    completed, newest = (sound[f"freeplay_{name}_timestamp_seconds"] for name in ("run_completed", "newest_departure"))
    # Nothing runs for 31 hours, nothing arrives for eight days, and nothing is written.
    at = {"FreeplayRunOverdue": completed + 31 * 3600, "FreeplayNoNewFlights": newest + 8 * 86400}
    bad |= {name: [sound] for name in at} | {"FreeplayMetricsMissing": [{}]}
    assert set(bad) == set(rules), set(bad) ^ set(rules)
    for name, rule in rules.items():
        expression = promql.parse(rule["expr"])
        calm = value(expression, sound, newest + 3600)
        assert calm is None, f"{name} fires after a sound night: {calm}"
        assert len(bad[name]) == (2 if "h" in rule.get("for", "") else 1), name
        for metrics in bad[name]:
            assert value(expression, metrics, at.get(name, completed + 60)) is not None, f"{name} does not fire: {metrics}"
    return len(rules)


def check_units(work: Path) -> None:
    """systemd knows every key of the units, and of the override in the documentation."""
    override = re.search(r"```ini\n(.*?)```", Path("docs/operations.md").read_text(), re.DOTALL)
    texts = {name: Path("crates/cli/packaging", name).read_text() for name in ("freeplay.service", "freeplay.timer")}
    texts["freeplay.service.d/override.conf"] = override.group(1)
    for name, text in texts.items():
        file = work / "units" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text.replace("/usr/bin/freeplay", FREEPLAY))
        # A condition that fails would skip the run, and count as a success.
        assert "Condition" not in text, name
    units = [str(work / "units" / name) for name in texts if "/" not in name]
    verified = subprocess.run(["systemd-analyze", "verify", *units], capture_output=True, text=True)
    assert (verified.returncode, verified.stderr) == (0, ""), verified.stderr


with tempfile.TemporaryDirectory() as folder:
    check_units(Path(folder))
    print(f"{check_rules(Path(folder))} rules fire by real runs and none after a sound one; systemd knows the units")
