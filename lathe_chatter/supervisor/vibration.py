"""What the vibration did of late: whether it falls, stays above a limit, stands out of noise."""

from __future__ import annotations

import math
from collections import deque
from statistics import median

SETTLING = 0.5
"""s over which it is judged whether the vibration falls."""
_FALLING, _FALLEN = 0.9, 0.5
"""Part to which vibration falls meanwhile where chatter dies; and of what it was at the move, to
which it has fallen where it falls no more."""
_SURELY, _BEYOND = 0.1, 0.2
"""s that vibration must stand out of noise, and not fall: what a change of the cut stirs up falls
soon; and that it must be beyond its limit for a stop."""
_LOOKS = 200
"""At a quiet cut, that tell its vibration."""
_STEADY, _LASTING = 1.1, 1.5
"""Factor that a vibration keeps its size to for so many s where it is no noise."""


class VibrationHistory:
    """The amplitude as it was seen, and that of the quiet cut before."""

    def __init__(self) -> None:
        """Nothing is seen."""
        self._levels: deque[tuple[float, float]] = deque()
        self._quiet_levels: deque[float] = deque(maxlen=_LOOKS)
        self._steady_level = self._steady_since = math.nan

    def note(self, time: float, amplitude: float) -> None:
        """What is seen now, s and m; nan where it is not known."""
        self._levels.append((time, amplitude))
        while self._levels[0][0] < time - SETTLING:
            self._levels.popleft()
        low, high = self._steady_level / _STEADY, self._steady_level * _STEADY
        if not low < amplitude < high:
            self._steady_level, self._steady_since = amplitude, time

    def note_quiet(self) -> None:
        """The cut is quiet."""
        if math.isfinite(self._levels[-1][1]):
            self._quiet_levels.append(self._levels[-1][1])

    def dies(self, at_move: float, growth_rate: float) -> bool:
        """Whether it falls, or has fallen since a move and grows no more."""
        newest = self._levels[-1][1]
        if newest < _FALLING * self._levels[0][1]:
            return True
        return newest < _FALLEN * at_move and not growth_rate > 0.0

    def is_beyond(self, limit: float) -> bool:
        """Whether it is beyond a limit, and stays there."""
        lasting = self._levels[0][0] <= self._levels[-1][0] - _BEYOND
        return lasting and self._stays_above(limit, _BEYOND)

    def stands_out(self, times: float) -> bool:
        """Whether it is so many times that of a quiet cut; so where none was seen."""
        quiet = median(self._quiet_levels) if self._quiet_levels else -math.inf
        return self._stays_above(times * quiet, _SURELY)

    def is_steady(self) -> bool:
        """Whether it has kept its size for long, as noise does not."""
        return self._levels[-1][0] > self._steady_since + _LASTING

    def _stays_above(self, level: float, seconds: float) -> bool:
        time, newest = self._levels[-1]
        recent = [each for at, each in self._levels if at > time - seconds]
        return min(recent) > level and newest > _FALLING * recent[0]
