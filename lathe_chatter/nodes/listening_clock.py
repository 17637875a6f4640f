"""A clock that stands while its node does: what nobody could hear meanwhile says nothing."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable

_STOOD_STILL = 0.5
"""s between two readings after which the node was stopped, or busy: it listened to nobody."""
_TICK = 1e-3
_RESUMED = 5.0
"""s until DDS, which first settles what was missed, has delivered again to such a node."""


class ListeningClock:
    """Seconds in which a node has listened, for one that reads it many times a second."""

    def __init__(self) -> None:
        """It begins with the first reading."""
        self._read_at = math.nan
        self._stood = 0.0
        self._woke_at = -math.inf

    def now(self) -> float:
        """Seconds since some moment, without those in which the node stood still."""
        now = time.monotonic()
        since = now - self._read_at
        self._read_at = now
        if since > _STOOD_STILL:
            self._stood += since - _TICK  # so that before and after are two times
            self._woke_at = now - self._stood
        return now - self._stood

    def misses(self, heard_at: float, seconds: float) -> bool:
        """Whether nothing has come for so long, and that is not for a standstill of the node."""
        return self.now() > heard_at + seconds and not self.awaits([heard_at], seconds)

    def awaits(self, heard_at: Iterable[float], seconds: float) -> bool:
        """Whether the node stood still, and not all that it heard just before has come again.

        Args:
            heard_at: When each came last.
            seconds: What counts as just before.
        """
        if self.now() > self._woke_at + _RESUMED:
            return False
        return any(self._woke_at - seconds < at < self._woke_at for at in heard_at)
