"""Exceptions with the codes, the sentences and the remedies of the command line."""

from __future__ import annotations

import json
from typing import Any


class FreeplayError(Exception):
    """Base of all errors of Freeplay.

    The text is what the command prints. ``docs/errors.md`` explains every code.
    """

    #: What the command would have exited with.
    exit_code: int = 3

    def __init__(self, text: str, complaints: str = "[]") -> None:
        super().__init__(text, complaints)
        #: All diagnostics with their fields: ``code``, ``what`` and, where known, ``file``, ``line``, ``column``,
        #: ``row``, ``row_group``, ``found``, ``wanted``, ``hint``.
        self.complaints: list[dict[str, Any]] = json.loads(complaints)

    def __str__(self) -> str:
        return str(self.args[0])

    @property
    def code(self) -> str | None:
        """Stable code of the first diagnostic."""
        return self.complaints[0]["code"] if self.complaints else None

    @property
    def help(self) -> str | None:
        """Remedy of the first diagnostic."""
        return self.complaints[0].get("hint") if self.complaints else None


class ConfigError(FreeplayError):
    """The configuration, a table that it names, or an argument is wrong: nothing was done."""

    exit_code = 2


class LogError(FreeplayError):
    """Some logs cannot be used. ``answer`` holds what came of the others."""

    exit_code = 1
    #: What came of the logs that are sound.
    answer: Any = None


class RunError(FreeplayError):
    """The store cannot be read or written, or a run failed: what was stored before is intact."""
