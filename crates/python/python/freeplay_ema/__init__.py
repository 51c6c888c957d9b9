"""The backlash gap of flight-control actuators from flight logs, and its trend per serial number.

The functions read the same ``pipeline.toml`` as the command ``freeplay`` and return bitwise identical rows.
Tables come in and go out through Arrow's PyCapsule interface: hand a :class:`Table` to ``pyarrow.table``,
``polars.DataFrame``, ``pandas.DataFrame.from_arrow`` or DuckDB, and hand any of theirs back. Work is done without
the interpreter's lock. Errors are raised as :class:`FreeplayError`, with the command's code, text and remedy.

The examples start from the folder of the repository, whose ``sample-data`` holds simulated flights.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import datetime
from os import PathLike, fspath
from os.path import exists, join
from typing import Any, Literal, TypeAlias, TypeVar

from freeplay_ema import _freeplay
from freeplay_ema._arrow import ArrowStream
from freeplay_ema._errors import ConfigError, FreeplayError, LogError, RunError
from freeplay_ema._freeplay import Config, Table, __version__
from freeplay_ema._results import (
    DuplicateLog,
    Explanation,
    KilledRun,
    LogFailure,
    Refusals,
    ReportFiles,
    RunSummary,
    SilentTail,
)

__all__ = [
    "ArrowStream",
    "Config",
    "ConfigError",
    "DuplicateLog",
    "Explanation",
    "FreeplayError",
    "KilledRun",
    "LogError",
    "LogFailure",
    "Refusals",
    "ReportFiles",
    "RunError",
    "RunSummary",
    "SilentTail",
    "Table",
    "__version__",
    "backtest",
    "changes",
    "check",
    "diff",
    "estimate",
    "estimate_arrays",
    "explain",
    "load",
    "normalize",
    "quantities",
    "records",
    "report",
    "run",
    "trace",
    "trend",
    "work",
]

Path: TypeAlias = "str | PathLike[str]"
Settings: TypeAlias = "Config | Path | Sequence[Path]"
Instant: TypeAlias = "str | datetime"

_Answer = TypeVar("_Answer")

_USUAL = "pipeline.toml"


def load(config: Settings = _USUAL) -> Config:
    """Reads and checks a configuration once, for many calls; keys of later files override earlier ones.

    >>> import freeplay_ema as fp
    >>> config = fp.load("pipeline.toml")
    >>> config.parts
    ['EMA-27-1040', 'EMA-27-1060']

    Raises :class:`ConfigError` with all its diagnostics:

    >>> try:
    ...     fp.load("nowhere.toml")
    ... except fp.ConfigError as error:
    ...     print(error.code, "|", error.help)
    config_unreadable | create one with `freeplay init`, or select another with `--config FILE` or FREEPLAY_CONFIG
    """
    if isinstance(config, Config):
        return config
    files = [config] if isinstance(config, (str, PathLike)) else list(config)
    return Config([fspath(file) for file in files])


def estimate(
    logs: Path | Iterable[Path],
    config: Settings = _USUAL,
    *,
    part: str | None = None,
    raise_on_error: bool | None = None,
) -> Table:
    """Estimates the gap of every actuator in a log, or in several; nothing is stored.

    The rows are those of ``freeplay estimate``: one for each actuator and flight. With ``part`` all are taken for
    that part number, and neither an identity nor the installations table is needed.

    >>> import freeplay_ema as fp, pyarrow as pa
    >>> log = "sample-data/logs/N412FP/20260828T005251Z_N412FP-0017.parquet"
    >>> table = pa.table(fp.estimate(log))
    >>> table.num_rows
    4
    >>> table["position"].to_pylist()
    ['aileron_left', 'aileron_right', 'elevator_left', 'elevator_right']
    >>> [f"{1e6 * gap:.0f} um" for gap in table["gap_m"].to_pylist()][:2]
    ['62 um', '96 um']

    A log, or an actuator in it, that cannot be used is a row of ``Table.errors``. One path alone raises
    :class:`LogError` instead, with the other rows as its ``answer``; ``raise_on_error`` chooses explicitly.

    >>> found = fp.estimate([log, "nowhere.parquet"])
    >>> len(found), found.errors.to_arrow()["log"].to_pylist()
    (4, ['nowhere.parquet'])
    """
    is_one = isinstance(logs, (str, PathLike))
    found = _freeplay.estimate(_paths(logs), load(config), part)
    return found.raise_errors() if (is_one if raise_on_error is None else raise_on_error) else found


def estimate_arrays(
    time_s: Any, motor_m: Any, screw_m: Any, load_n: Any, part: str, config: Settings = _USUAL
) -> Table:
    """Estimates the gap of one actuator from arrays: a table of one row.

    ``time_s`` counts from any zero, ``motor_m`` is the motor's position brought to the screw axis in m (angle times
    lead / 2 pi), ``screw_m`` the screw's position, ``load_n`` the load; ``part`` names a part number of
    the configuration. Each is anything that numpy reads: its own arrays, columns of pyarrow, Polars and pandas,
    sequences of numbers. ``float64`` in one piece is read without copying. NaN and null are missing readings.

    >>> import freeplay_ema as fp, numpy as np, pyarrow as pa
    >>> t = np.arange(0, 100, 0.01)
    >>> motor = 0.03 * np.sin(0.25 * t)
    >>> load = 8000 * np.sin(1.1 * t) + 500 * np.sin(5.0 * t)
    >>> dx = load / 5e7 + 50e-6 * np.tanh(load / 300)
    >>> found = pa.table(fp.estimate_arrays(t, motor, motor + dx, load, "EMA-27-1040")).to_pylist()[0]
    >>> found["status"], found["samples"]
    ('estimated', 10000)
    """
    return _freeplay.estimate_arrays(time_s, motor_m, screw_m, load_n, part, load(config))


def trace(log: Path, config: Settings = _USUAL, *, part: str | None = None) -> Table:
    """Input and output of the filter for each sample of a log: the backlash ``s_m``, innovation and its variance.

    >>> import freeplay_ema as fp
    >>> log = "sample-data/logs/N412FP/20260828T005251Z_N412FP-0017.parquet"
    >>> fp.trace(log).column_names[:4]
    ['log_path', 'position', 'time_s', 'motor_m']
    """
    return _freeplay.trace(fspath(log), load(config), part)


def trend(
    estimates: ArrowStream | None = None,
    config: Settings = _USUAL,
    *,
    tail: str | None = None,
    serial: str | None = None,
    part: str | None = None,
    as_of: Instant | None = None,
    queries: ArrowStream | None = None,
    statistics: bool = False,
    limit_m: float | None = None,
) -> Table:
    """Level, rate, changes, crossing of the limit and state: one row for each unit.

    ``estimates`` is any Arrow table with ``serial_number`` (or ``serial``), ``departure_utc`` and ``gap_m``, such as
    that of :func:`estimate`; without it the store of the configuration is read. ``queries`` (``serial_number``,
    ``as_of_utc``, optional ``part_number``) asks for one row each, using nothing later than its date. ``statistics``
    has no effect: the classic statistics are no longer computed. ``limit_m`` is the removal
    limit in m for parts without one in the configuration; where no configuration is named and there is no
    ``pipeline.toml``, it is the only limit.

    >>> import freeplay_ema as fp, glob, pyarrow as pa
    >>> estimates = fp.estimate(sorted(glob.glob("sample-data/logs/*/*.parquet")))
    >>> rows = pa.table(fp.trend(estimates)).to_pylist()
    >>> {row["state"] for row in rows} <= {"act", "plan", "unassessed", "watch", "normal", None}
    True
    """
    judging = _judging(estimates, config, limit_m)
    return _freeplay.trend(estimates, judging, [tail, serial, part], _text(as_of), queries)


def records(
    config: Settings = _USUAL,
    *,
    tail: str | None = None,
    serial: str | None = None,
    part: str | None = None,
    flight: str | None = None,
    position: str | None = None,
    since: Instant | None = None,
    until: Instant | None = None,
    last: int | None = None,
) -> Table:
    """Selected records of the store, in order of departure, tail, flight and position.

    >>> import freeplay_ema as fp
    >>> summary = fp.run()
    >>> set(fp.records(tail="N412FP").to_arrow()["tail_number"].to_pylist())
    {'N412FP'}
    """
    texts = [tail, serial, part, flight, position]
    return _freeplay.records(load(config), texts, _text(since), _text(until), last)


def normalize(
    logs: Path | Iterable[Path],
    output: Path,
    config: Settings = _USUAL,
    *,
    compatible: bool = False,
    jobs: int | None = None,
) -> list[str]:
    """Writes the canonical log of each actuator as ``TAIL/DEPARTURE_FLIGHT/POSITION.parquet`` below ``output``.

    ``compatible`` keeps to encodings that every reader knows. Raises :class:`LogError` when a log cannot be used;
    its ``answer`` lists the files of the others.

    >>> import freeplay_ema as fp
    >>> log = "sample-data/logs/N412FP/20260828T005251Z_N412FP-0017.parquet"
    >>> files = fp.normalize(log, "normalized")
    >>> files[0]
    'normalized/N412FP/20260828T005251Z_N412FP-0017/aileron_left.parquet'
    """
    written, trouble = _freeplay.normalize(_paths(logs), fspath(output), load(config), compatible, jobs)
    return _or_raise([fspath(file) for file in written], trouble)


def run(
    config: Settings = _USUAL,
    *,
    jobs: int | None = None,
    redo: bool = False,
    retry: bool = False,
    wait_s: float | None = None,
) -> RunSummary:
    """The nightly run on this machine, and its summary: that of ``freeplay run --json``, with fields.

    Failed logs are listed under ``errors`` and raise nothing. ``retry`` processes failed logs again, ``redo`` all.

    >>> import freeplay_ema as fp
    >>> summary = fp.run()
    >>> summary.found == summary.known + summary.done
    True
    """
    return RunSummary.from_json(_freeplay.run(load(config), jobs, redo, retry, wait_s))


def quantities(
    config: Settings = _USUAL,
    *,
    tail: str | None = None,
    serial: str | None = None,
    part: str | None = None,
    as_of: Instant | None = None,
) -> Table:
    """Every followed quantity of the units of the store: stiffness, friction, delays, load zero, lost motion, NIS.

    The rows are those of ``freeplay trend --quantities``.
    """
    return _freeplay.followed(load(config), [tail, serial, part], _text(as_of), False)


def changes(
    config: Settings = _USUAL,
    *,
    tail: str | None = None,
    serial: str | None = None,
    part: str | None = None,
    as_of: Instant | None = None,
) -> Table:
    """What changed on units, tails and parts, with the evidence: the rows of ``freeplay trend --changes``."""
    return _freeplay.followed(load(config), [tail, serial, part], _text(as_of), True)


def backtest(
    estimates: ArrowStream | None = None, config: Settings = _USUAL, *, limit_m: float | None = None
) -> Table:
    """Past forecasts against later measurements, one row each: the rows of ``freeplay backtest --json``."""
    return _freeplay.backtest_forecasts(estimates, _judging(estimates, config, limit_m))


def diff(before: Path, after: Path, *, min_change_m: float = 0.0) -> Table:
    """Actuator-flights whose results differ between two stores; smaller changes of a gap are left out."""
    return _freeplay.diff(fspath(before), fspath(after), min_change_m)


def explain(
    flight: str,
    position: str,
    config: Settings = _USUAL,
    *,
    tail: str | None = None,
    since: Instant | None = None,
    until: Instant | None = None,
) -> Explanation:
    """One stored estimate with its settings, recomputed from its log; departures select among flights of one name."""
    text, record = _freeplay.explain(load(config), flight, position, tail, [_text(since), _text(until)])
    return Explanation.from_json(text, record)


def report(
    output: Path,
    config: Settings = _USUAL,
    *,
    tail: str | None = None,
    serial: str | None = None,
    part: str | None = None,
    as_of: Instant | None = None,
    data: bool = False,
) -> ReportFiles:
    """Writes the HTML report into a folder and returns what was written; begin at ``index``.

    With ``data`` the tables of the pages are written too, as Parquet in ``data/``.
    """
    units = [tail, serial, part]
    files, size_bytes = _freeplay.report(load(config), fspath(output), units, _text(as_of), data)
    return ReportFiles(join(fspath(output), "index.html"), files, size_bytes)


def work(
    config: Settings = _USUAL,
    *,
    status: Literal["open", "acknowledged", "deferred", "closed", "all"] | None = None,
    tail: str | None = None,
    serial: str | None = None,
    part: str | None = None,
) -> Table:
    """Work requests by due date, without closed ones unless asked: the rows of ``freeplay work list``."""
    return _freeplay.work(load(config), status, [tail, serial, part])


def check(
    logs: Path | Iterable[Path] | None = None, config: Settings = _USUAL, *, limit: int = 20
) -> Table:
    """How logs are mapped, channel by channel, and what would be refused; nothing is estimated or stored.

    Without ``logs`` about ``limit`` of the configuration are checked, at least one of each tail. Failed logs are rows of
    ``Table.errors``.
    """
    return _freeplay.check(None if logs is None else _paths(logs), load(config), limit)


def _judging(estimates: ArrowStream | None, config: Settings, limit_m: float | None) -> Config:
    is_foreign = estimates is not None and config is _USUAL and not exists(_USUAL)
    judging = Config.without_logs() if is_foreign else load(config)
    return judging if limit_m is None else judging.replaced(limit_m=limit_m)


def _paths(logs: Path | Iterable[Path]) -> list[str]:
    if isinstance(logs, (str, PathLike)):
        return [fspath(logs)]
    return [fspath(log) for log in logs]


def _text(instant: Instant | None) -> str | None:
    return instant.isoformat() if isinstance(instant, datetime) else instant


def _or_raise(answer: _Answer, trouble: Exception | None) -> _Answer:
    if isinstance(trouble, LogError):
        trouble.answer = answer
        raise trouble
    return answer
