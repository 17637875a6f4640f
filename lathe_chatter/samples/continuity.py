"""Whether blocks of samples follow each other without a gap, proven from their times alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import Enum

import numpy as np

from lathe_chatter.arrays import Array
from lathe_chatter.errors import LayoutError


class Joint(str, Enum):
    """How a block of samples joins the one before."""

    FIRST = 'first'
    CONTIGUOUS = 'contiguous'
    GAP = 'gap'
    """Samples are missing in between."""
    RESTART = 'restart'
    """Simulated time has gone back, or the lathe is another: another run."""


class Continuity:
    """Follows the times of samples from block to block.

    Attributes:
        samples: How many came.
        lost: How many did not, as far as the times tell.
        gaps: In how many places.
        restarts: How often simulated time went back.
        last: The time of the newest sample, s; None before the first.
    """

    def __init__(self) -> None:
        """Begin with nothing known."""
        self.samples = self.lost = self.gaps = self.restarts = 0
        self.last: float | None = None
        self._step = 0.0

    def join(self, times: Array, is_another: Callable[[], bool] = bool) -> Joint:
        """Join a block to those before.

        A gap between the very first block of one sample and the next cannot be told.

        Args:
            times: Of its samples (n,), s, n > 0, evenly spaced.
            is_another: Asked where samples are missing: whether these come from another lathe,
                whose time has passed that of the one before, and none are.
        """
        before, self.last = self.last, float(times[-1])
        self.samples += times.size
        if times.size > 1:
            self._step = float(times[-1] - times[0]) / (times.size - 1)
        if before is None:
            return Joint.FIRST
        missing = round((float(times[0]) - before) / self._step) - 1 if self._step else 0
        if missing < 0 or (missing > 0 and is_another()):
            self.restarts += 1
            return Joint.RESTART
        if missing > 0:
            self.lost += missing
            self.gaps += 1
            return Joint.GAP
        return Joint.CONTIGUOUS


def times_of(samples: Array, columns: Sequence[str]) -> Array:
    """The times of the samples (n,), s.

    Raises:
        LayoutError: If there are none, or if they are no numbers or do not increase.
    """
    if 'time' not in columns:
        raise LayoutError(f'The samples have no column time, only {", ".join(columns)}.')
    times: Array = samples[:, columns.index('time')]
    # A sensor that is dead is the detector's business: it does without.
    if not np.isfinite(times).all() or (np.diff(times) <= 0.0).any():
        raise LayoutError('The times of the samples are not finite, or do not increase.')
    return times


def follow_evenly(times: Array) -> bool:
    """Whether times (n,) are numbers that follow each other without a gap or a jump back."""
    steps = times[1:] - times[:-1]
    if not steps.size:
        return bool(np.isfinite(times).all())
    return bool(0.0 < steps.max() < 1.5 * steps.min())
