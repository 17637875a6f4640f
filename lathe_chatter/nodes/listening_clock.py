"""A clock that stands while its node does: what nobody could hear meanwhile says nothing."""

from __future__ import annotations

import math
import time

_STOOD_STILL = 0.5
"""s between two readings after which the node was stopped, or busy: it listened to nobody."""
_TICK = 1e-3
_RESUMED = 30.0
"""s until DDS has delivered again to such a node, if it does: it settles first what was missed."""


class ListeningClock:
    """Seconds in which a node has listened, for one that reads it many times a second."""

    def __init__(self) -> None:
        """It begins with the first reading."""
        self._read_at = math.nan
        self._stood = 0.0
        self._wakings: list[float] = []

    def now(self) -> float:
        """Seconds since some moment, without those in which the node stood still."""
        now = time.monotonic()
        since = now - self._read_at
        self._read_at = now
        if since > _STOOD_STILL:
            self._stood += since - _TICK  # so that before and after are two times
            self._wakings.append(now - self._stood)
        return now - self._stood

    def is_silent(self, heard_at: float, seconds: float) -> bool:
        """Whether nothing has come for so long, or since the node stood still."""
        return self.now() > heard_at + seconds or heard_at < max(self._wakings, default=-math.inf)

    def stood_still_near(self, heard_at: float, seconds: float) -> bool:
        """Whether a silence since then may be for a standstill of the node, less than so long off.

        What comes just after one may have waited for it.
        """
        now = self.now()
        self._wakings = [each for each in self._wakings if each > now - _RESUMED]
        return any(abs(heard_at - each) < seconds for each in self._wakings)
