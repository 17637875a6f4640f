"""A log that cannot be flooded: of each kind of sentence a few at once, then a count of more."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

BURST = 5
"""Sentences of one kind that are logged as they come."""
PERIOD = 10.0
"""s after which one more of the kind may be logged, and its burst is whole again."""
MAX_KINDS = 1000
"""Kinds that are kept apart; what comes under a new name beyond them is one kind."""


@dataclass
class _Kind:
    since: float
    logged: int = 0
    held: int = 0
    last: str = ''
    log: Callable[[str], Any] | None = None


class BoundedLog:
    """The logger of a node, bounded for each kind of sentence.

    Nothing goes untold: what is held back is counted, and the last of it is logged with the
    count once the period is over, by `look` or by the next of the kind.

    Args:
        logger: Of the node.
        now: A clock, s.
    """

    def __init__(self, logger: Any, now: Callable[[], float] = time.monotonic) -> None:
        """Begin with nothing logged."""
        self._logger, self._now = logger, now
        self._kinds: dict[str, _Kind] = {}

    # rclpy allows each place in the code one severity: so each has a call of its own.

    def info(self, sentence: str, kind: str = '') -> None:
        """Log what happened; of one kind are sentences that differ in their numbers only."""
        self._log(sentence, kind, lambda text: self._logger.info(text))  # noqa: PLW0108

    def warning(self, sentence: str, kind: str = '') -> None:
        """Log what should not have happened."""
        self._log(sentence, kind, lambda text: self._logger.warning(text))  # noqa: PLW0108

    def error(self, sentence: str, kind: str = '') -> None:
        """Log what went wrong."""
        self._log(sentence, kind, lambda text: self._logger.error(text))  # noqa: PLW0108

    def look(self) -> None:
        """Tell what was held back long enough; called about once a second."""
        for kind in self._kinds.values():
            self._tell_held(kind)

    def _log(self, sentence: str, name: str, log: Callable[[str], Any]) -> None:
        name = name or sentence
        if name not in self._kinds and len(self._kinds) >= MAX_KINDS:
            name = ''
        kind = self._kinds.setdefault(name, _Kind(self._now()))
        self._tell_held(kind)
        if kind.logged < BURST:
            kind.logged += 1
            log(sentence)
        else:
            kind.held += 1
            kind.last, kind.log = sentence, log

    def _tell_held(self, kind: _Kind) -> None:
        """Begin a new period, if one is over, with what the old one held back."""
        now = self._now()
        if now - kind.since < PERIOD:
            return
        if kind.held and kind.log is not None:
            more = f' ({kind.held} of this kind in {now - kind.since:.0f} s.)'
            kind.log(kind.last + (more if kind.held > 1 else ''))
        # A kind that goes on is logged once a period, not once a burst.
        kind.logged = BURST if kind.held else 0
        kind.since, kind.held = now, 0
