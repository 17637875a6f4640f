"""How many ticks are due: real-time pacing without bursts and without silent slow running.

A clock calls; what is due follows from the time that has passed, never from how often the call
came. Where the process falls behind by more than it may catch up at once, the excess is given
up, counted as lag and reported.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SECOND = 1_000_000_000
_LATEST = 4096


@dataclass
class Pacer:
    """Ticks due against a clock in nanoseconds.

    Attributes:
        tick: Simulated duration of a tick, ns.
        factor: Simulated seconds per second of the clock, > 0.
        patience: The most that may be caught up in one go, ns of the clock.
        keeps_all: Whether the excess is not given up but made later: where the clock is
            another's simulated time, all of it counts.
        lag: What was given up since the start, ns of the clock.
        overruns: How often something was given up.
    """

    tick: float
    factor: float = 1.0
    patience: float = 0.05 * SECOND
    keeps_all: bool = False
    lag: float = 0.0
    overruns: int = 0
    _origin: float | None = None
    _done: int = 0

    @property
    def period(self) -> float:
        """From one tick to the next, ns of the clock."""
        return self.tick / self.factor

    def start(self, now: int) -> None:
        """Let the next tick be due one period from now: at first, and after a pause."""
        self._origin, self._done = now, 0

    def must_start(self, now: int) -> bool:
        """Whether it was never started, or the clock has gone back and so has started again."""
        return self._origin is None or self.lateness(now) < -self.period

    def change(self, factor: float, now: int) -> None:
        """Go on with another factor, as late as it is."""
        late = self.lateness(now)
        self.factor = factor
        self.start(now)
        self._origin = now - late

    def due(self, now: int) -> int:
        """The ticks to make now; they count as made.

        A call up to half a period early counts as in time, so that a timer of the same period
        makes one tick each time in spite of its jitter.
        """
        ticks = max(0, int(self.lateness(now) / self.period + 0.5))
        allowed = max(1, int(self.patience / self.period))
        if ticks > allowed:
            if not self.keeps_all:
                excess = (ticks - allowed) * self.period
                self._origin = (self._origin or 0.0) + excess
                self.lag += excess
                self.overruns += 1
            ticks = allowed
        self._done += ticks
        return ticks

    def next_wake(self, now: int) -> int:
        """When to call next: when the next tick is due, but no sooner than after a tick's time.

        At a factor above 1 several ticks are made in one go.
        """
        if self.factor > 1.0:
            return now + int(self.tick)
        return now - int(self.lateness(now) - self.period)

    def lateness(self, now: int) -> float:
        """How long ago the last tick that was made had been due, ns; negative if it is early."""
        return 0.0 if self._origin is None else now - self._origin - self._done * self.period


class Durations:
    """The latest durations of something done over and over, and their quantiles."""

    def __init__(self) -> None:
        """Begin empty."""
        self._ring = np.zeros(_LATEST)
        self._count = 0

    def add(self, duration: float) -> None:
        """Note one."""
        self._ring[self._count % _LATEST] = duration
        self._count += 1

    def quantiles(self, *fractions: float) -> tuple[float, ...]:
        """The quantiles of those noted since `clear`, 4096 at most; zeros where none were."""
        known = self._ring[: min(self._count, _LATEST)]
        return tuple(np.quantile(known, fractions)) if known.size else (0.0,) * len(fractions)

    def clear(self) -> None:
        """Forget all."""
        self._count = 0
