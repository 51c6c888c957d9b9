"""Exceptions with the codes, messages and remedies of the command line."""

from __future__ import annotations

import json
from typing import Any


class FreeplayError(Exception):
    """Base of all errors of Freeplay.

    The text is what the command prints. ``docs/errors.md`` explains every code.
    """

    #: Exit code of the command for the same error.
    exit_code: int = 3

    def __init__(self, text: str, diagnostics: str = "[]") -> None:
        super().__init__(text, diagnostics)
        #: All diagnostics with their fields: ``code``, ``what`` and, where known, ``file``, ``line``, ``column``,
        #: ``row``, ``row_group``, ``found``, ``wanted``, ``hint``.
        self.diagnostics: list[dict[str, Any]] = json.loads(diagnostics)

    def __str__(self) -> str:
        return str(self.args[0])

    @property
    def complaints(self) -> list[dict[str, Any]]:
        """Former name of ``diagnostics``."""
        return self.diagnostics

    @property
    def code(self) -> str | None:
        """Stable code of the first diagnostic."""
        return self.diagnostics[0]["code"] if self.diagnostics else None

    @property
    def help(self) -> str | None:
        """Remedy of the first diagnostic."""
        return self.diagnostics[0].get("hint") if self.diagnostics else None


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
