"""The newest samples of a lathe as a page draws them: envelopes, portraits and a spectrum."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

import numpy as np

from lathe_chatter.array_types import Array, Integers
from lathe_chatter.report.run_excerpts import once_per_turn, spectrum
from lathe_chatter.samples.continuity import times_of

SIGNALS = ('tool_displacement', 'tool_velocity', 'workpiece_displacement', 'workpiece_velocity')
COLUMNS = ('time', 'spindle_angle', *SIGNALS)
COUNT = 1000
"""Stretches of an envelope."""
SECONDS = 2.0, 60.0
"""Of the two envelopes."""
_PORTRAIT, _PORTRAIT_POINTS = 0.1, 1000
_SPECTRUM, _HIGHEST = 1.0, 2000.0
"""s that a spectrum is of, and Hz to which it is shown."""


class Envelope:
    """The smallest and largest values of signals over even stretches, the newest of them.

    Args:
        samples: In a stretch.
        width: How many signals.
    """

    def __init__(self, samples: int, width: int) -> None:
        """Begin empty."""
        self.samples = samples
        self._low = np.full((COUNT, width), np.nan)
        self._high = self._low.copy()
        self._first: int | None = None
        self._last = -1

    def add(self, places: Integers, values: Array) -> None:
        """Add samples (n, k) with their numbers, rising, n > 0."""
        numbers = places // self.samples
        begins = np.flatnonzero(np.diff(numbers, prepend=numbers[0] - 1))
        found = numbers[begins]
        low, high = (f.reduceat(values, begins) for f in (np.minimum, np.maximum))
        if found[0] == self._last:
            low[0] = np.fmin(low[0], self._low[self._last % COUNT])
            high[0] = np.fmax(high[0], self._high[self._last % COUNT])
        if self._first is None:
            self._first = int(found[0])
        last = int(found[-1])
        missing = np.arange(max(self._last + 1, last - COUNT + 1), last + 1) % COUNT
        self._low[missing] = self._high[missing] = np.nan
        self._low[found % COUNT], self._high[found % COUNT] = low, high
        self._last = last

    def since(self, first: int) -> tuple[int, Array]:
        """Whole stretches from a number on, as far as they are kept: low and high (2, m, k)."""
        first = max(first, self._last - COUNT + 1, self._first or 0)
        slots = np.arange(first, max(self._last, first)) % COUNT
        return first, np.stack((self._low[slots], self._high[slots]))


class LiveSignals:
    """Follows the samples of one lathe.

    Attributes:
        epoch: Counts the times that simulated time began anew.
        time: Simulated time of the newest sample, s; nan before the first.
        step: From sample to sample, s.
        emptied: Whether nothing has come since `empty`.
        lost: Samples that did not come, in this epoch.
        envelopes: Of the last seconds, and of the last minute.
    """

    def __init__(self) -> None:
        """Begin with none."""
        self.epoch = 0
        self.emptied = False
        self._columns: tuple[str, ...] = ()
        self._begin()

    def _begin(self) -> None:
        self.epoch += 1
        self.emptied = False
        self.time, self.step, self.lost = math.nan, 0.0, 0
        self.envelopes: list[Envelope] = []
        self._newest = -1
        self._recent: deque[Array] = deque()

    def empty(self) -> None:
        """Forget a cut that begins anew, though nothing of the new one has come."""
        self._begin()
        self.emptied = True

    def add(self, samples: Array, columns: Sequence[str]) -> bool:
        """Take samples (n, k) that follow each other; whether time began anew with them."""
        times = times_of(samples, tuple(columns))
        began = self.step == 0.0
        if times[0] <= self.time or tuple(columns) != self._columns:
            self._begin()
            self._columns, began = tuple(columns), True
        if not self.step:
            if len(times) < 2 or times[-1] <= times[0]:
                return False
            self.step = float(times[-1] - times[0]) / (len(times) - 1)
            counts = (max(1, round(seconds / COUNT / self.step)) for seconds in SECONDS)
            self.envelopes = [Envelope(count, len(SIGNALS)) for count in counts]
        places = np.rint(times / self.step).astype(np.int64)
        missing = int(places[0]) - self._newest - 1
        if self._newest >= 0 and missing > 0:
            self.lost += missing
            self._recent.clear()
        self.time, self._newest = float(times[-1]), int(places[-1])
        picked = [columns.index(name) if name in columns else -1 for name in COLUMNS]
        kept = np.where(np.array(picked) >= 0, samples[:, picked], np.nan)
        for envelope in self.envelopes:
            envelope.add(places, kept[:, 2:])
        self._recent.append(kept)
        held = sum(map(len, self._recent)) - len(self._recent[0])
        while held * self.step > SECONDS[0]:
            self._recent.popleft()
            held -= len(self._recent[0])
        return began

    def closeup(self) -> tuple[dict[str, float | None], dict[str, Array]]:
        """What a portrait and a spectrum show: figures and arrays; empty where there is none."""
        if not self._recent:
            return {}, {}
        return closeup(np.concatenate(self._recent))


def closeup(samples: Array) -> tuple[dict[str, float | None], dict[str, Array]]:
    """Portraits, once-per-turn points and the spectrum of the tool at the end of some samples.

    Args:
        samples: The COLUMNS (n, 6), even in time, n > 0.

    Returns:
        Spindle speed, rev/min, and the step of the spectrum, Hz; and the arrays.
    """
    time, angle = samples[:, 0], samples[:, 1]
    figures: dict[str, float | None] = {'speed': None, 'hertz': 0.0}
    arrays: dict[str, Array] = {}
    tail = samples[time > time[-1] - _PORTRAIT]
    turns = tail[-1, 1] - tail[0, 1]
    if len(tail) > 1 and math.isfinite(turns):
        figures['speed'] = 60.0 * float(turns) / float(tail[-1, 0] - tail[0, 0])
    tail = tail[:: -(-len(tail) // _PORTRAIT_POINTS)]
    lines = spectrum(*samples[time > time[-1] - _SPECTRUM][:, [0, 2]].T)
    if lines.amplitude.size > 1:
        figures['hertz'] = float(lines.frequency[1])
        arrays['spectrum'] = lines.amplitude[lines.frequency <= _HIGHEST]
    for k, body in ((2, 'tool'), (4, 'workpiece')):
        arrays[f'{body}_portrait'] = tail[:, k : k + 2].T
        if np.isfinite(angle).all():
            points = once_per_turn(time, angle, samples[:, k], samples[:, k + 1])
            arrays[f'{body}_turns'] = np.stack(points)
    return figures, arrays
