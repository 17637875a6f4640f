"""Cuts a stream of samples, whatever its batches, into hops of a fixed number of samples."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from enum import Enum
from typing import NamedTuple

import numpy as np

from lathe_chatter.errors import LayoutError
from lathe_chatter.model import Array

SIGNALS = ('time', 'spindle_angle', 'tool_displacement', 'workpiece_displacement')
_TO_MEASURE = 33
"""Samples at the start of a stretch from which its sample rate is taken."""


class Break(str, Enum):
    """Why the samples before and after do not belong together."""

    GAP = 'gap'
    RESTART = 'restart'
    """Time has gone back."""


class Rate(NamedTuple):
    """The sample rate of the stretch that begins here, Hz."""

    value: float


class Hop(NamedTuple):
    """Consecutive samples.

    Attributes:
        time: Of the last, s.
        block: Spindle angle, tool and workpiece displacement (samples, 3), rev and m.
    """

    time: float
    block: Array


class Intake:
    """Finds the signals by their labels and follows their times.

    A sample that is no number counts as lost. Nothing depends on how the samples were cut
    into batches.
    """

    def __init__(self) -> None:
        """Begin with nothing held."""
        self.hop = 1
        self._rows: Array = np.empty((0, len(SIGNALS)))
        self._step = math.nan
        self._last = math.nan

    def take(self, samples: Array, columns: Sequence[str]) -> Iterator[Break | Rate | Hop]:
        """What a batch of samples (n, k) brings.

        The receiver sets `hop`, the samples in a hop, on every `Rate`.

        Raises:
            LayoutError: If a column is missing or the layout is not that of the labels.
        """
        self._rows = np.vstack((self._rows, _signals(samples, columns)))
        while len(self._rows):
            if math.isnan(self._step):
                if len(self._rows) < _TO_MEASURE:
                    return
                self._step = float(np.median(np.diff(self._rows[:_TO_MEASURE, 0])))
                if self._unbroken(self._rows[:_TO_MEASURE]) == _TO_MEASURE:
                    yield Rate(1.0 / self._step)
            whole = self._unbroken(self._rows)
            broken = whole < len(self._rows)
            whole -= whole % self.hop
            for start in range(0, whole, self.hop):
                hop = self._rows[start : start + self.hop]
                self._last = float(hop[-1, 0])
                yield Hop(self._last, np.ascontiguousarray(hop[:, 1:]))
            self._rows = self._rows[whole:]
            if not broken:
                return
            yield self._leave_behind()

    def _unbroken(self, rows: Array) -> int:
        """How many rows continue the stretch."""
        before = self._last if math.isfinite(self._last) else rows[0, 0] - self._step
        steps = np.diff(rows[:, 0], prepend=before)
        with np.errstate(invalid='ignore'):
            good = np.abs(steps - self._step) < 0.5 * self._step
        good &= np.isfinite(rows).all(axis=1)
        return len(rows) if good.all() else int(np.argmin(good))

    def _leave_behind(self) -> Break:
        """Drop what is held up to the break; a stretch begins with the next sample."""
        at = self._unbroken(self._rows)
        times = self._rows[: at + 1, 0]
        before = times[at - 1] if at else self._last
        restarted = bool(times[at] <= before)
        finite = bool(np.isfinite(self._rows[at]).all())
        # Where the very first sample of a stretch is the odd one, it must go or nothing moves.
        self._rows = self._rows[at + (not finite or (at == 0 and math.isnan(self._last))) :]
        self._step = self._last = math.nan
        return Break.RESTART if restarted else Break.GAP


def _signals(samples: Array, columns: Sequence[str]) -> Array:
    """The columns of `SIGNALS` (n, 4)."""
    names = list(columns)
    missing = [name for name in SIGNALS if name not in names]
    if missing:
        raise LayoutError(f'The samples have no column {missing[0]}, only {", ".join(names)}.')
    if samples.ndim != 2 or samples.shape[1] != len(names):
        raise LayoutError(
            f'A block of samples for {len(names)} columns has the shape {samples.shape}.'
        )
    found: Array = samples[:, [names.index(name) for name in SIGNALS]]
    return found
