"""Whether samples follow each other without a gap, proven from their times alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import Enum

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.errors import LayoutError

LONGEST_STEP = 1.5
"""Of the usual step of time between two samples: one that is longer is a gap."""
_COUNTABLE = 1e12
"""Of samples and seconds: more are no count and no time, but a damaged number."""
_STEPS_ASKED = 1000
"""Steps from which the usual one is taken."""


class BlockOrder(str, Enum):
    """How samples follow those before."""

    FIRST = 'first'
    CONTIGUOUS = 'contiguous'
    GAP = 'gap'
    """Samples are missing in between."""
    RESTART = 'restart'
    """Simulated time has gone back, or the lathe is another: another run."""
    RETURN = 'return'
    """What was left for others goes on: several lathes send at once (`MixedContinuity`)."""


class Continuity:
    """Follows the times of samples.

    Args:
        remember: Whether the places of gaps and restarts are kept, and not only counted.

    Attributes:
        samples: How many came.
        lost: How many did not, as far as the times tell.
        gaps: In how many places.
        restarts: How often simulated time went back.
        gap_places: Simulated times before and after each, s, if remembered.
        restart_places: Likewise.
        step: The usual time between two samples, s; 0 while unknown.
        last: The time of the newest sample, s; None before the first.
    """

    def __init__(self, *, remember: bool = False) -> None:
        """Begin with nothing known."""
        self.samples = self.lost = self.gaps = self.restarts = 0
        self.gap_places: list[tuple[float, float]] = []
        self.restart_places: list[tuple[float, float]] = []
        self.step = 0.0
        self.last: float | None = None
        self._remember = remember

    def join(self, times: Array, is_another: Callable[[], bool] = bool) -> BlockOrder:
        """Go on with samples of which it is known that they follow each other evenly.

        A gap between the very first block of one sample and the next cannot be told.

        Args:
            times: Of these samples (n,), s, n > 0.
            is_another: Asked where samples are missing: whether these come from another lathe,
                whose time has passed that of the one before, and none are.
        """
        before, first = self.last, float(times[0])
        self.last = float(times[-1])
        self.samples += times.size
        if times.size > 1:
            self.step = (self.last - first) / (times.size - 1)
        elif not self.step and before is not None:
            self.step = max(first - before, 0.0)
        return BlockOrder.FIRST if before is None else self._order(before, first, is_another)

    def follow(self, times: Array) -> None:
        """Go on with any samples: gaps and restarts among them are found too.

        Args:
            times: Of these samples (n,), s; also such as are no numbers.
        """
        self.samples += times.size
        joined = times if self.last is None else np.concatenate(([self.last], times))
        if not joined.size:
            return
        self.last = float(joined[-1])
        steps = joined[1:] - joined[:-1]
        while steps.size:
            self.step = self.step or _usual(steps)
            if steps.min() > 0.0 and steps.max() <= LONGEST_STEP * self.step:
                return
            begun = self._follow_broken(joined, steps)
            joined, steps = joined[begun:], steps[begun:]

    def _follow_broken(self, joined: Array, steps: Array) -> int:
        """Find where steps (n - 1,) between times (n,) are none; how many times were followed."""
        # So that a time which is no number is a restart too.
        longest = LONGEST_STEP * self.step if self.step else np.inf
        for place in np.flatnonzero(~((steps > 0.0) & (steps <= longest))).tolist():
            order = self._order(float(joined[place]), float(joined[place + 1]))
            rest = steps[place + 1 :]
            if order is BlockOrder.RESTART and rest.size:
                usual = _usual(rest)
                if abs(usual - self.step) > 0.01 * self.step:  # a lathe of another sample rate
                    self.step = usual
                    return int(place) + 1
        return int(joined.size)

    def _order(
        self, before: float, after: float, is_another: Callable[[], bool] = bool
    ) -> BlockOrder:
        """Note how a sample follows the one before, by their times, s."""
        place = before, after
        gap = 0.0 < LONGEST_STEP * self.step < after - before
        if not after > before or (gap and is_another()):
            self.restarts += 1
            if self._remember:
                self.restart_places.append(place)
            return BlockOrder.RESTART
        if gap:
            self.lost += missing_in(place, self.step)
            self.gaps += 1
            if self._remember:
                self.gap_places.append(place)
            return BlockOrder.GAP
        return BlockOrder.CONTIGUOUS


def _usual(steps: Array) -> float:
    """The usual one of steps (n,), s; 0 where they do not tell."""
    known = steps[:_STEPS_ASKED]
    known = known[np.isfinite(known)]
    return max(float(np.median(known)), 0.0) if known.size else 0.0


def missing_in(place: tuple[float, float], step: float) -> int:
    """How many samples are missing in a gap, with the usual step, s; 0 if that cannot be told."""
    count = (place[1] - place[0]) / step if step else np.inf
    return round(count) - 1 if count < _COUNTABLE else 0


def time_text(time: float) -> str:
    """A simulated time for people, s."""
    return f'{time:.6f} s' if abs(time) < _COUNTABLE else f'{time!r} s'


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
    return bool(0.0 < steps.max() < LONGEST_STEP * steps.min())
