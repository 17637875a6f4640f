"""Cuts a stream of samples, whatever its batches, into hops of a fixed number of samples."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from enum import Enum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lathe_chatter.arrays import Array
from lathe_chatter.compiled import compiled
from lathe_chatter.errors import LayoutError

_TIME, _ANGLE, _TOOL, _WORKPIECE = (
    'time',
    'spindle_angle',
    'tool_displacement',
    'workpiece_displacement',
)
_RATE_SAMPLES = 33
"""Samples at the start of a stretch from which its sample rate is taken."""


class Discontinuity(str, Enum):
    """Why the samples before and after do not belong together."""

    GAP = 'gap'
    RESTART = 'restart'
    """Time has gone back."""


class StreamFormat(NamedTuple):
    """What a stretch that begins here has.

    Attributes:
        rate: Samples a second, Hz.
        angle: Whether the spindle angle is seen.
        workpiece: Whether both displacements are; with one it stands where the tool's would.
    """

    rate: float
    angle: bool
    workpiece: bool


class HopBlock(NamedTuple):
    """Consecutive samples, a whole number of hops.

    Attributes:
        times: Of the samples (n,), s.
        block: Spindle angle, tool and workpiece displacement (n, 3), rev and m; 0 where there
            is none.
    """

    times: Array
    block: Array


class Framer:
    """Finds the signals by their labels and follows their times.

    A sample that is no number counts as lost; a sensor that is dead or missing from the start
    of a stretch is done without. Nothing depends on how the samples were cut into batches.
    """

    def __init__(self) -> None:
        """Begin with nothing held."""
        self.hop = 1
        self._held: list[Array] = []
        self._count = 0
        self._step = math.nan
        self._last = math.nan
        self._dead: NDArray[np.bool_] = np.zeros(4, bool)
        self._names: tuple[str, ...] = ()
        self._places, self._incomplete = np.zeros(4, np.int64), False

    def take(
        self, samples: Array, columns: Sequence[str]
    ) -> Iterator[Discontinuity | StreamFormat | HopBlock]:
        """What a batch of samples (n, k) brings.

        The receiver sets `hop`, the samples in a hop, on every `StreamFormat`.

        Raises:
            LayoutError: If there is no time or no displacement, or the layout is not that of
                the labels.
        """
        self._held.append(self._signals(samples, columns))
        self._count += len(samples)
        known = not math.isnan(self._step)
        if self._count < (self.hop if known else _RATE_SAMPLES):
            return
        rows = np.concatenate(self._held) if len(self._held) > 1 else self._held[0]
        while len(rows):
            if math.isnan(self._step):
                if len(rows) < _RATE_SAMPLES:
                    break
                form = self._measure(rows)
                if form is None:  # too short a stretch to know anything by
                    whole = _unbroken(rows[:_RATE_SAMPLES], self._last, self._step, self._dead)
                    restarted, rows = self._drop_to_break(rows, min(whole, _RATE_SAMPLES - 1))
                    yield Discontinuity.RESTART if restarted else Discontinuity.GAP
                    continue
                yield form
            whole = _unbroken(rows, self._last, self._step, self._dead)
            broken = whole < len(rows)
            taken = whole - whole % self.hop
            if taken:
                self._last = float(rows[taken - 1, 0])
                block = rows[:taken, 1:].copy()
                block[:, self._dead[1:]] = 0.0
                yield HopBlock(rows[:taken, 0], block)
            rows = rows[taken:]
            if not broken:
                break
            restarted, rows = self._drop_to_break(rows, whole - taken)
            yield Discontinuity.RESTART if restarted else Discontinuity.GAP
        self._held, self._count = [rows], len(rows)

    def _measure(self, rows: Array) -> StreamFormat | None:
        """Sample rate and channels of a stretch; None where it is broken before they are known."""
        first = rows[:_RATE_SAMPLES]
        steps = np.diff(first[:, 0])
        steps = steps[np.isfinite(steps)]
        self._step = float(np.median(steps)) if len(steps) else math.nan
        self._dead = np.asarray(~np.isfinite(first).any(axis=0))
        if self._dead[2] and not self._dead[3]:
            # The workpiece's sensor alone stands for the tool's.
            self._places[2], self._places[3], self._incomplete = self._places[3], -1, True
            rows[:, 2], rows[:, 3] = rows[:, 3], math.nan
            self._dead[2:] = False, True
        usable = self._step > 0.0 and not self._dead[2]
        if not usable:
            self._step = self._step if self._step > 0.0 else 1.0
            self._dead[2] = False
            return None
        if _unbroken(first, self._last, self._step, self._dead) < _RATE_SAMPLES:
            return None
        return StreamFormat(1.0 / self._step, not self._dead[1], not self._dead[3])

    def _drop_to_break(self, rows: Array, at: int) -> tuple[bool, Array]:
        """Drop what is held up to the break; a stretch begins with the next sample."""
        times = rows[: at + 1, 0]
        before = times[at - 1] if at else self._last
        restarted = bool(times[at] <= before)
        alive = rows[at][~self._dead]
        finite = bool(np.isfinite(alive).all())
        # Where the very first sample of a stretch is the odd one, it must go or nothing moves.
        drop = at + (not finite or (at == 0 and math.isnan(self._last)))
        self._step = self._last = math.nan
        self._names = ()
        return restarted, rows[drop:]

    def _signals(self, samples: Array, columns: Sequence[str]) -> Array:
        """Time, angle, tool and workpiece (n, 4), nan where there is no such column."""
        names = tuple(columns)
        if names != self._names:
            self._names = names
            wanted = (_TIME, _ANGLE, _TOOL, _WORKPIECE)
            places = [names.index(name) if name in names else -1 for name in wanted]
            if places[0] < 0 or max(places[2:]) < 0:
                lacking = _TIME if places[0] < 0 else f'{_TOOL} and no {_WORKPIECE}'
                self._names = ()
                raise LayoutError(
                    f'The samples have no column {lacking}, only {", ".join(names)}.'
                )
            if places[2] < 0:
                places[2], places[3] = places[3], -1
            self._places, self._incomplete = np.array(places), min(places) < 0
        if samples.ndim != 2 or samples.shape[1] != len(names):
            raise LayoutError(
                f'A block of samples for {len(names)} columns has the shape {samples.shape}.'
            )
        found: Array = samples.take(self._places, axis=1)
        if self._incomplete:
            found[:, self._places < 0] = math.nan
        return found


@compiled()
def _unbroken(rows: Array, last: float, step: float, dead: NDArray[np.bool_]) -> int:
    """How many rows (n, 4) continue the stretch."""
    before = last if last == last else rows[0, 0] - step
    for i in range(rows.shape[0]):
        now = rows[i, 0]
        if not abs(now - before - step) < 0.5 * step:
            return i
        for column in range(1, 4):
            if not dead[column] and not np.isfinite(rows[i, column]):
                return i
        before = now
    return int(rows.shape[0])
