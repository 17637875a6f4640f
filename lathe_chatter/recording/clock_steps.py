"""Steps of the system's clock while a run is recorded, as time services make them."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from lathe_chatter.array_types import Integers

CLOCK = 'lathe_chatter/clock'
"""Name of the record of the steps, as JSON; a run without it had none that its writer saw."""
STEP_BACK = 10_000_000
"""ns by which stamps of one topic go back where the clock does, and never else."""
_MIN_STEP = 10_000_000
"""ns: less is how a clock is set right by and by, or how long it takes to read two clocks."""
_READING = 1_000_000
"""ns within which three readings follow each other, unless something came between."""


class ClockStep(NamedTuple):
    """A step.

    Attributes:
        before: What the clock showed at the last look before it, ns since the epoch.
        after: At the first look after it.
        seconds: By which it went on, or back (below 0), beyond the time that had passed.
    """

    before: int
    after: int
    seconds: float


def _steady() -> int:
    """A clock that nobody sets, and that goes on while the machine sleeps, ns."""
    return time.clock_gettime_ns(time.CLOCK_BOOTTIME)


class ClockWatch:
    """Compares the system's clock with one that nobody sets.

    Args:
        wall: The system's clock, ns since the epoch.
        steady: The other one, ns.

    Attributes:
        steps: Those that were seen.
    """

    def __init__(
        self, wall: Callable[[], int] = time.time_ns, steady: Callable[[], int] = _steady
    ) -> None:
        """Begin to look."""
        self.steps: list[ClockStep] = []
        self._wall, self._clock = wall, steady
        self._last = self._read()

    def look(self) -> ClockStep | None:
        """The step since the last look, if there was one."""
        wall, steady = self._read()
        before, since = self._last
        self._last = wall, steady
        size = (wall - before) - (steady - since)
        if abs(size) < _MIN_STEP:
            return None
        self.steps.append(ClockStep(before, wall, size / 1e9))
        return self.steps[-1]

    def values(self) -> dict[str, str]:
        """The steps as the values of a record."""
        return {'steps': json.dumps(self.steps)}

    def _read(self) -> tuple[int, int]:
        """Both clocks at the same time, as nearly as can be."""
        while True:
            first, wall, last = self._clock(), self._wall(), self._clock()
            if last - first < _READING:
                return wall, first


def steps_back(stamps: Integers) -> tuple[Integers, Integers]:
    """After which messages of a topic the clock was set back, and how far it went (below 0), ns.

    A step forward is not seen: it looks like a pause.

    Args:
        stamps: When each was received, ns since the epoch (n,).
    """
    passed = np.diff(stamps)
    usual = int(np.median(passed)) if len(passed) else 0
    places = np.flatnonzero(passed < -STEP_BACK)
    return places, passed[places] - usual


def noted_steps(values: Mapping[str, str]) -> list[ClockStep]:
    """The steps that a record has, as far as it is legible."""
    try:
        return [ClockStep(int(b), int(a), float(s)) for b, a, s in json.loads(values['steps'])]
    except (KeyError, TypeError, ValueError):
        return []


def step_sentence(seconds: float) -> str:
    """What to say of a step."""
    way = 'forward' if seconds > 0.0 else 'back'
    return (
        f'the system clock was set {way} by {abs(seconds):.3f} s while this was recorded; '
        'simulated time is not affected.'
    )
