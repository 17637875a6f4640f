"""Blocks of samples joined into signals, with what is missing between them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lathe_chatter.arrays import Array, Integers
from lathe_chatter.recording.sample_columns import Cut

_LARGER_THAN_STEP = 1.5
"""A step of time between two samples so many times the usual one is a gap."""


_COUNTABLE = 1e12
"""Of samples and seconds: more are no count and no time, but a damaged number."""
_ALL = (-np.inf, np.inf)


class Samples(NamedTuple):
    """The samples of one lathe.

    Attributes:
        columns: Each signal by name (n,), SI.
        log_times: When each block was received, ns since the epoch (blocks,).
        block_ends: Simulated time of the last sample of each block, s (blocks,).
        gaps: Where samples are missing: simulated times before and after, s.
        restarts: Where simulated time went back: simulated times before and after, s.
    """

    columns: dict[str, Array]
    log_times: Integers
    block_ends: Array
    gaps: list[tuple[float, float]]
    restarts: list[tuple[float, float]]

    def simulated_time(self, log_times: ArrayLike) -> Array:
        """Simulated times when other things were recorded, s: those of the blocks about them.

        Args:
            log_times: Of these, ns since the epoch (m,).
        """
        relative = (self.log_times - self.log_times[0]).astype(float)
        asked = np.asarray(log_times, np.int64) - self.log_times[0]
        found: Array = np.interp(asked.astype(float), relative, self.block_ends)
        return found


class Seams:
    """Finds where samples do not follow each other.

    Attributes:
        gaps: Simulated times before and after what is missing, s.
        restarts: Simulated times before and after simulated time went back, s.
        lost: How many samples are missing in the gaps.
        step: The usual time between two samples, s; 0 while unknown.
    """

    def __init__(self) -> None:
        """Begin before the first sample."""
        self.gaps: list[tuple[float, float]] = []
        self.restarts: list[tuple[float, float]] = []
        self.lost = 0
        self.step = 0.0
        self._last: Array = np.zeros(0)

    def follow(self, times: Array) -> None:
        """Go on with the times of more samples (n,), s."""
        joined = np.concatenate((self._last, times)) if len(self._last) else times
        self._last = joined[-1:].copy()
        steps = joined[1:] - joined[:-1]
        if not len(steps):
            return
        if self.step == 0.0:
            told = steps[np.isfinite(steps)]
            self.step = max(float(np.median(told)), 0.0) if len(told) else 0.0
        if steps.min() > 0.0 and steps.max() <= _LARGER_THAN_STEP * self.step:
            return
        # So that a time which is no number is a seam too.
        forward = steps > 0.0
        longest = _LARGER_THAN_STEP * self.step if self.step else np.inf
        for place in np.flatnonzero(~(forward & (steps <= longest))):
            seam = float(joined[place]), float(joined[place + 1])
            if not forward[place]:
                self.restarts.append(seam)
            else:
                self.gaps.append(seam)
                self.lost += missing_in(seam, self.step)


def missing_in(gap: tuple[float, float], step: float) -> int:
    """How many samples are missing in a gap, by its ends and the usual step, s; 0 if unknown."""
    count = (gap[1] - gap[0]) / step if step else np.inf
    return round(count) - 1 if count < _COUNTABLE else 0


def at(time: float) -> str:
    """A simulated time for people, s."""
    return f'{time:.6f} s' if abs(time) < _COUNTABLE else f'{time!r} s'


def joined(cuts: Iterator[Cut], expected: int, start: float, end: float) -> Samples | None:
    """All samples within a range of simulated time.

    Args:
        cuts: In order.
        expected: How many blocks there are, as far as is known.
        start: Of the range, s.
        end: Of the range, s.

    Returns:
        The samples. None where there is not one.
    """
    signals: _Signals | None = None
    log_times: list[Integers] = []
    ends: list[Array] = []
    seams = Seams()
    for cut in cuts:
        if not len(cut.times):
            continue
        if signals is None:
            signals = _Signals(cut.columns, expected * int(cut.rows[0]))
        time, part = cut.times, cut.signals
        last = time[np.cumsum(cut.rows) - 1]
        if (start, end) != _ALL and (start > time.min() or end < time.max()):
            inside = (time >= start) & (time <= end)
            part, time = part[:, inside], time[inside]
            kept = (last >= start) & (last - (cut.rows - 1) * seams.step <= end)
            log_times.append(cut.log_times[kept])
            ends.append(last[kept])
        else:
            log_times.append(cut.log_times.copy())
            ends.append(last)
        if len(time):
            seams.follow(time)
            signals.append(cut.columns, part)
    if signals is None:
        return None
    return Samples(
        signals.taken(),
        np.concatenate(log_times),
        np.concatenate(ends),
        seams.gaps,
        seams.restarts,
    )


class _Signals:
    """Signals that grow at their ends, each in one array, so that nothing is held twice."""

    def __init__(self, names: Sequence[str], expected: int) -> None:
        self._arrays = {name: np.empty(expected) for name in names}
        self._room = expected
        self._size = 0

    def append(self, names: Sequence[str], signals: Array) -> None:
        """Add named signals (k, n); all that were there at the beginning."""
        end = self._size + signals.shape[1]
        if end > self._room:
            self._room = max(end, self._room * 3 // 2)
            self._arrays = {n: np.resize(a, self._room) for n, a in self._arrays.items()}
        for name, array in self._arrays.items():
            array[self._size : end] = signals[names.index(name)]
        self._size = end

    def taken(self) -> dict[str, Array]:
        """What was added, by name."""
        return {name: array[: self._size] for name, array in self._arrays.items()}
