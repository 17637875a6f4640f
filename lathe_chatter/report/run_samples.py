"""The samples of a run as pictures need them: extremes of all, and every one of a few seconds.

A run may have more samples than fit into memory; they are passed by and never held.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from lathe_chatter.arrays import Array, Integers

TIME = 'time'
_STRETCHES = 4096
"""At most, into which the time of a run is divided: more than a picture has columns of dots."""
_LARGER_THAN_STEP = 1.5
"""A step of time between two samples so many times the usual one is a gap."""
_NO_TIMES = np.zeros(0, np.int64)


class SampleBlocks(Protocol):
    """Some blocks of samples that follow each other in a record."""

    @property
    def columns(self) -> Sequence[str]:
        """Names of the signals."""

    @property
    def samples(self) -> Array:
        """All samples (n, k)."""

    @property
    def rows(self) -> Integers:
        """Samples in each block (blocks,)."""

    @property
    def log_times(self) -> Integers:
        """When each block was received, ns (blocks,)."""


class Extremes(NamedTuple):
    """The smallest and largest values of signals over short stretches of time.

    Attributes:
        columns: Names of the signals, the first the time.
        low: The smallest values (stretches, k); of the time, when a stretch begins, s.
        high: The largest (stretches, k).
        piece: The number of the piece without a gap that a stretch is of (stretches,).
        samples: In a stretch, at most.
    """

    columns: tuple[str, ...]
    low: Array
    high: Array
    piece: Integers
    samples: int = 1

    def of(self, name: str) -> tuple[Array, Array]:
        """The smallest and the largest values of a signal, nan where samples are missing."""
        place = self.columns.index(name)
        return self._apart(self.low[:, place]), self._apart(self.high[:, place])

    @property
    def times(self) -> Array:
        """When each stretch begins, s; as many as `of` has, nan where samples are missing."""
        return self._apart(self.low[:, self.columns.index(TIME)])

    def _apart(self, values: Array) -> Array:
        """With a nan between two pieces, so that no line joins them."""
        result: Array = np.insert(values, np.flatnonzero(np.diff(self.piece)) + 1, np.nan)
        return result


class Gap(NamedTuple):
    """Where samples do not follow each other: simulated times before and after, s."""

    before: float
    after: float

    @property
    def restart(self) -> bool:
        """Whether time went back, as after a restart of the lathe."""
        return self.after <= self.before


class RunSamples:
    """Samples that pass by once when this is made, and once more for each call of `between`.

    Args:
        blocks: Gives all blocks from the first on, at each call.

    Attributes:
        count: Of the samples.
        first: Simulated time of the first, s.
        last: Simulated time of the last, s.
        gaps: Where samples do not follow each other.
        extremes: Of all signals.
    """

    def __init__(self, blocks: Callable[[], Iterable[SampleBlocks]]) -> None:
        """Let them pass by."""
        self._blocks = blocks
        self.count, self.first, self.last = 0, 0.0, 0.0
        self.gaps: list[Gap] = []
        self._step = 0.0
        received: list[Integers] = [_NO_TIMES]
        ends: list[Array] = [np.zeros(0)]
        extremes: Extremes | None = None
        for block in blocks():
            samples, columns = block.samples, tuple(block.columns)
            if not len(samples):
                continue
            times = samples[:, columns.index(TIME)]
            rows = np.asarray(block.rows)
            received.append(np.array(block.log_times)[rows > 0])
            ends.append(times[np.cumsum(rows)[rows > 0] - 1])
            if extremes is None:
                self.first = float(times[0])
                empty = np.zeros((0, len(columns)))
                extremes = Extremes(columns, empty, empty, _NO_TIMES)
            breaks = self._breaks(times)
            places = [columns.index(name) for name in extremes.columns]
            extremes = _extended(extremes, samples[:, places], breaks)
            self.count, self.last = self.count + len(times), float(times[-1])
        self.extremes = extremes or Extremes(
            (TIME,), np.zeros((0, 1)), np.zeros((0, 1)), _NO_TIMES
        )
        self._received, self._ends = np.concatenate(received), np.concatenate(ends)

    @classmethod
    def of(cls, signals: Mapping[str, Array]) -> RunSamples:
        """Of signals (n,) by name that are in memory already."""
        samples = np.column_stack(list(signals.values()))
        rows = np.array([len(samples)])
        block = _InMemory(tuple(signals), samples, rows, np.zeros(1, np.int64))
        return cls(lambda: [block])

    def _breaks(self, times: Array) -> Integers:
        """Places of those of more samples that do not follow the one before; notes the gaps."""
        joined = np.concatenate(([self.last], times)) if self.count else times
        offset = 0 if self.count else 1
        steps = np.diff(joined)
        if self._step == 0.0 and len(steps):
            self._step = max(float(np.median(steps)), 0.0)
        places = np.flatnonzero(~((steps > 0.0) & (steps <= _LARGER_THAN_STEP * self._step)))
        self.gaps += [Gap(float(joined[k]), float(joined[k + 1])) for k in places]
        return places + offset

    def simulated_time(self, log_times: ArrayLike) -> Array:
        """Simulated times when other things were recorded, s: those of the blocks about them.

        Args:
            log_times: Of these, ns since the epoch (m,).
        """
        origin = self._received[0] if len(self._received) else 0
        relative = (self._received - origin).astype(float)
        asked = (np.asarray(log_times, np.int64) - origin).astype(float)
        found: Array = np.interp(asked, relative, self._ends)
        return found

    def between(self, spans: Sequence[tuple[float, float]]) -> list[dict[str, Array]]:
        """Every sample within some spans of simulated time: after the begin, up to the end.

        Of a span with a gap in it, what comes after the last gap: what is computed from the
        samples takes them for evenly spaced.

        Args:
            spans: Begin and end of each, s.

        Returns:
            For each the signals (n,) by name.
        """
        whole = [(self._after_gaps(begin, end), end) for begin, end in spans]
        parts: list[list[Array]] = [[] for _ in spans]
        columns = self.extremes.columns
        for block in self._blocks():
            names = tuple(block.columns)
            times = block.samples[:, names.index(TIME)]
            if not len(times):
                continue
            for (begin, end), part in zip(whole, parts, strict=True):
                if times.min() <= end and times.max() > begin:
                    inside = (times > begin) & (times <= end)
                    places = [names.index(name) for name in columns]
                    part.append(block.samples[inside][:, places])
        joined = [np.concatenate([np.zeros((0, len(columns))), *part]) for part in parts]
        return [dict(zip(columns, each.T.copy(), strict=True)) for each in joined]

    def _after_gaps(self, begin: float, end: float) -> float:
        """From when on there is no gap before `end`, s."""
        inside = [gap.after for gap in self.gaps if begin < gap.after <= end]
        # The first sample after the gap belongs to it.
        return max([begin, *(after - 0.5 * self._step for after in inside)])


class _InMemory(NamedTuple):
    columns: tuple[str, ...]
    samples: Array
    rows: Integers
    log_times: Integers


def _extended(known: Extremes, samples: Array, breaks: Integers) -> Extremes:
    """With more samples (n, k), which follow each other but at some places."""
    per = known.samples
    pieces = np.zeros(len(samples), np.int64)
    pieces[breaks] = 1
    last = known.piece[-1] if len(known.piece) else 0
    pieces = last + np.cumsum(pieces)
    begins = _begins(pieces, per)
    low = np.concatenate((known.low, np.minimum.reduceat(samples, begins)))
    high = np.concatenate((known.high, np.maximum.reduceat(samples, begins)))
    piece = np.concatenate((known.piece, pieces[begins]))
    while len(piece) > _STRETCHES:
        per *= 2
        # Where there are more gaps than columns of dots, they are not shown each.
        pairs = _begins(piece if piece[-1] - piece[0] < _STRETCHES // 4 else piece * 0, 2)
        low, high = np.minimum.reduceat(low, pairs), np.maximum.reduceat(high, pairs)
        piece = piece[pairs]
    return Extremes(known.columns, low, high, piece, per)


def _begins(pieces: Integers, count: int) -> Integers:
    """Where groups of `count` begin that lie within one piece."""
    first = np.flatnonzero(np.diff(pieces, prepend=pieces[:1] - 1))
    place = np.arange(len(pieces))
    within = place - np.repeat(first, np.diff(first, append=len(pieces)))
    return np.flatnonzero(within % count == 0)
