"""Typed results."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, fields
from typing import Any

from freeplay_ema._freeplay import Table


@dataclass(frozen=True)
class LogFailure:
    """A log, or an actuator in it, that cannot be used."""

    log: str
    code: str
    what: str
    hint: str | None
    #: All fields of the diagnostic, such as ``column``, ``row``, ``found`` and ``wanted``.
    diagnostic: dict[str, Any] = field(repr=False)


@dataclass(frozen=True)
class Refusals:
    """Records without a gap for one reason."""

    reason: str
    count: int
    remedy: str | None


@dataclass(frozen=True)
class DuplicateLog:
    """A log with the samples of another one, which owns the flight."""

    log: str
    owner: str


@dataclass(frozen=True)
class SilentTail:
    """An aircraft without data while others have some."""

    tail_number: str
    since_utc: str


@dataclass(frozen=True)
class KilledRun:
    """An earlier run that did not finish."""

    run_id: str
    started_utc: str
    done: int
    not_reached: int


@dataclass(frozen=True)
class RunSummary:
    """What a run did. ``summary["found"]`` is ``summary.found``; ``facts`` is the whole of ``freeplay run --json``."""

    run_id: str
    started_utc: str
    #: Logs that match the patterns; processed before; excluded by the selection; left by a limit; processed now.
    found: int
    known: int
    not_asked: int
    left: int
    done: int
    not_reached: int
    #: Flights whose records were stored, and their records with a gap.
    flights: int
    estimated: int
    refusals: list[Refusals]
    errors: list[LogFailure]
    duplicates: list[DuplicateLog]
    #: Stored records that stay as they were because their log failed in this run.
    kept: int
    #: Flights that a corrected table gave to another unit.
    moved: list[dict[str, Any]]
    #: Units of the maintenance and the inspections table that the installations table does not know.
    unknown_units: list[dict[str, Any]]
    quiet: list[SilentTail]
    cut_short: list[KilledRun]
    took_s: float
    workers: int
    #: Assessments of the units whose records changed, and of all units that need attention: rows of a trend.
    trends: list[dict[str, Any]] = field(repr=False)
    work_list: list[dict[str, Any]] = field(repr=False)
    facts: dict[str, Any] = field(repr=False)

    @classmethod
    def from_json(cls, text: str) -> RunSummary:
        """Reads the summary that ``freeplay run --json`` prints."""
        facts: dict[str, Any] = json.loads(text)
        known = {one.name: facts[one.name] for one in fields(cls) if one.name in facts}
        known["refusals"] = [Refusals(**one) for one in facts["refusals"]]
        known["errors"] = [_failure(one) for one in facts["errors"]]
        known["duplicates"] = [DuplicateLog(**one) for one in facts["duplicates"]]
        known["quiet"] = [SilentTail(**one) for one in facts["quiet"]]
        known["cut_short"] = [KilledRun(**one) for one in facts["cut_short"]]
        return cls(**known, facts=facts)

    def __getitem__(self, name: str) -> Any:
        return self.facts[name]


def _failure(error: dict[str, Any]) -> LogFailure:
    diagnostic = error["complaint"]
    return LogFailure(error["log"], diagnostic["code"], diagnostic["what"], diagnostic.get("hint"), diagnostic)


@dataclass(frozen=True)
class Explanation:
    """A stored estimate, and whether its log and settings still give it."""

    #: ``same``, ``other_settings``, ``other_log``, ``other_number`` or ``not_replayed``.
    verdict: str
    text: str
    remedy: str | None
    is_current: bool
    config_digest: str
    #: Settings of the part number.
    part: dict[str, Any] = field(repr=False)
    #: The record, one row.
    record: Table = field(repr=False)
    #: The whole of ``freeplay explain --json``.
    facts: dict[str, Any] = field(repr=False)

    @classmethod
    def from_json(cls, text: str, record: Table) -> Explanation:
        """Reads what ``freeplay explain --json`` prints."""
        facts: dict[str, Any] = json.loads(text)
        settings, replay = facts["settings"], facts["replay"]
        return cls(
            replay["verdict"],
            replay["says"],
            facts["remedy"],
            settings["is_current"],
            settings["config_digest"],
            settings["part"],
            record,
            facts,
        )


@dataclass(frozen=True)
class ReportFiles:
    """Files of a report."""

    index: str
    files: int
    size_bytes: int
