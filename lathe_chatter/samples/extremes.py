"""The smallest and largest values of signals over short stretches of time: all that a plot shows.

Samples pass by and are not held, however many there are.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from lathe_chatter.array_types import Array, Integers
from lathe_chatter.samples.continuity import Continuity

TIME = 'time'
_STRETCHES = 4096
"""At most, into which the time is divided: more than a picture has columns of dots."""


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

    @classmethod
    def of_signals(cls, signals: Mapping[str, Array]) -> Extremes:
        """Those of signals (n,) by name, one of them the time."""
        found = cls.none(tuple(signals))
        return found.extended(np.column_stack(list(signals.values())), Continuity(remember=True))

    @classmethod
    def none(cls, columns: tuple[str, ...]) -> Extremes:
        """Those of no samples yet."""
        empty = np.zeros((0, len(columns)))
        return cls(columns, empty, empty, np.zeros(0, np.int64))

    def extended(self, samples: Array, continuity: Continuity) -> Extremes:
        """With more samples.

        Args:
            samples: With these columns (n, k).
            continuity: That followed all samples before, and remembers; it follows these.
        """
        if not len(samples):
            return self
        times = samples[:, self.columns.index(TIME)]
        places = continuity.gap_places, continuity.restart_places
        known = [len(each) for each in places]
        continuity.follow(times)
        afters = [after for each, k in zip(places, known, strict=True) for _, after in each[k:]]
        pieces = np.cumsum(np.isin(times, afters)) + (self.piece[-1] if len(self.piece) else 0)
        per = self.samples
        begins = _begins(pieces, per)
        low = np.concatenate((self.low, np.minimum.reduceat(samples, begins)))
        high = np.concatenate((self.high, np.maximum.reduceat(samples, begins)))
        piece = np.concatenate((self.piece, pieces[begins]))
        while len(piece) > _STRETCHES:
            per *= 2
            # Where there are more gaps than columns of dots, they are not shown each.
            pairs = _begins(piece if piece[-1] - piece[0] < _STRETCHES // 4 else piece * 0, 2)
            low, high = np.minimum.reduceat(low, pairs), np.maximum.reduceat(high, pairs)
            piece = piece[pairs]
        return Extremes(self.columns, low, high, piece, per)

    def _apart(self, values: Array) -> Array:
        """With a nan between two pieces, so that no line joins them."""
        result: Array = np.insert(values, np.flatnonzero(np.diff(self.piece)) + 1, np.nan)
        return result


def _begins(pieces: Integers, count: int) -> Integers:
    """Where groups of `count` begin that lie within one piece."""
    first = np.flatnonzero(np.diff(pieces, prepend=pieces[:1] - 1))
    place = np.arange(len(pieces))
    within = place - np.repeat(first, np.diff(first, append=len(pieces)))
    return np.flatnonzero(within % count == 0)
