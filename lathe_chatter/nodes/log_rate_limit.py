"""A log that cannot be flooded: of each kind of sentence a few at once, then a count of more."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.logging import LoggingSeverity

from lathe_chatter.errors import shortened

BURST = 5
"""Sentences of one kind that are logged as they come."""
PERIOD = 10.0
"""s after which one more of the kind may be logged, and its burst is whole again."""
_LONGEST = 2000
"""Characters of a sentence: what others sent, as names of columns, may be of any length."""
MAX_KINDS = 1000
"""Kinds that are kept apart; what comes under a new name beyond them is one kind."""


class QuickLog:
    """The log of a node, without rclpy's search for the line of code that calls.

    That reads sources and takes 0.2 ms for each sentence, five times what the rest of it takes.

    Args:
        logger: Of the node.
    """

    def __init__(self, logger: Any) -> None:
        """Nothing is logged yet."""
        self._logger = logger

    def log(self, severity: LoggingSeverity, sentence: str) -> None:
        """Log a sentence."""
        if self._logger.is_enabled_for(severity):
            rclpy_implementation.rclpy_logging_rcutils_log(
                severity, self._logger.name, sentence, '', '', 0
            )

    def info(self, sentence: str) -> None:
        """Log what happened."""
        self.log(LoggingSeverity.INFO, sentence)

    def warning(self, sentence: str) -> None:
        """Log what should not have happened."""
        self.log(LoggingSeverity.WARN, sentence)

    def error(self, sentence: str) -> None:
        """Log what went wrong."""
        self.log(LoggingSeverity.ERROR, sentence)


@dataclass
class _Kind:
    since: float
    logged: int = 0
    held: int = 0
    last: str = ''
    severity: LoggingSeverity = LoggingSeverity.INFO


class BoundedLog:
    """The logger of a node, bounded for each kind of sentence.

    Nothing goes untold: what is held back is counted, and the last of it is logged with the
    count once the period is over, by `look` or by the next of the kind.

    Args:
        log: Of the node.
        now: A clock, s.
    """

    def __init__(self, log: QuickLog, now: Callable[[], float] = time.monotonic) -> None:
        """Begin with nothing logged."""
        self._log, self._now = log.log, now
        self._kinds: dict[str, _Kind] = {}

    def info(self, sentence: str, kind: str = '') -> None:
        """Log what happened; of one kind are sentences that differ in their numbers only."""
        self._take(LoggingSeverity.INFO, sentence, kind or sentence)

    def warning(self, sentence: str, kind: str = '') -> None:
        """Log what should not have happened."""
        self._take(LoggingSeverity.WARN, sentence, kind or sentence)

    def error(self, sentence: str, kind: str = '') -> None:
        """Log what went wrong."""
        self._take(LoggingSeverity.ERROR, sentence, kind or sentence)

    def look(self) -> None:
        """Tell what was held back long enough; called about once a second."""
        for kind in self._kinds.values():
            self._log_held_back(kind)

    def end(self) -> None:
        """Tell what is still held back: nobody will look any more."""
        for kind in self._kinds.values():
            self._log_held(kind)

    def _take(self, severity: LoggingSeverity, sentence: str, name: str) -> None:
        if name not in self._kinds and len(self._kinds) >= MAX_KINDS:
            name = ''
        kind = self._kinds.setdefault(name, _Kind(self._now()))
        self._log_held_back(kind)
        if kind.logged < BURST:
            kind.logged += 1
            self._log(severity, shortened(sentence, _LONGEST))
        else:
            kind.held += 1
            kind.last, kind.severity = shortened(sentence, _LONGEST), severity

    def _log_held_back(self, kind: _Kind) -> None:
        """Begin a new period, if one is over, with what the old one held back."""
        if self._now() - kind.since >= PERIOD:
            # A kind that goes on is logged once a period, not once a burst.
            kind.logged = BURST if kind.held else 0
            self._log_held(kind)
            kind.since = self._now()

    def _log_held(self, kind: _Kind) -> None:
        if kind.held:
            more = f' ({kind.held} of this kind in {self._now() - kind.since:.0f} s.)'
            self._log(kind.severity, kind.last + (more if kind.held > 1 else ''))
        kind.held = 0
