"""A clock that stands while its node does: what nobody could hear meanwhile says nothing."""

from __future__ import annotations

import math
import time

DISCOVERY = 3.5
"""s after the start of a node by which it knows who was there: DDS says again after 3 s what got
lost."""
_STOOD_STILL = 0.5
"""s between two readings after which the node was stopped, or busy: it listened to nobody."""
_TICK = 1e-3
_TIMES = 2.0
"""Times the usual time from one to the next after which what comes again and again is missed."""
_RESUMED = 30.0
"""s until DDS has delivered again to such a node, if it does: it settles first what was missed."""


class ListeningClock:
    """Seconds in which a node has listened, for one that reads it many times a second.

    Attributes:
        heard_at: When `hear` was called last.
    """

    def __init__(self) -> None:
        """It begins with the first reading."""
        self.heard_at = -math.inf
        self._passed, self._usual = math.inf, 0.0
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

    def hear(self) -> None:
        """Note that what comes again and again has come."""
        now = self.now()
        before, self._passed, self.heard_at = self._passed, now - self.heard_at, now
        self._usual = min(before, self._passed) if math.isfinite(self._passed) else 0.0

    def misses(self, seconds: float) -> bool:
        """Whether it has not come for so long, and longer than it takes usually."""
        return self.now() > self.heard_at + seconds + _TIMES * self._usual

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
