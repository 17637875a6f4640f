"""Cuts a stream of samples, whatever its batches, into hops of a fixed number of samples."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from enum import Enum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lathe_chatter.array_types import Array
from lathe_chatter.compiled import compiled
from lathe_chatter.detection.channel_watch import faults_of, new_channels, watch_channels
from lathe_chatter.detection.pulse_angle import PulseAngle
from lathe_chatter.detection.sensors_to_displacement import MotionFilter, Sensors, sensors_among
from lathe_chatter.errors import LayoutError

_TIME, _ANGLE, _PULSE = 'time', 'spindle_angle', 'spindle_pulse'
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
        mixed: Whether the one signal is a sound or a force instead of the motion of a body.
        nominal: Whether the angle follows from a speed that was only told.
    """

    rate: float
    angle: bool
    workpiece: bool
    mixed: bool = False
    nominal: bool = False


class HopBlock(NamedTuple):
    """Consecutive samples, a whole number of hops.

    Attributes:
        times: Of the samples (n,), s.
        block: Spindle angle, tool and workpiece displacement (n, 3), rev and m; 0 where there
            is none. From other sensors the displacements are without what is below 15 Hz.
    """

    times: Array
    block: Array


class Framer:
    """Finds the signals by their labels and follows their times and their health.

    A sample that is no number counts as lost; a sensor that is dead or missing is done without
    until it has been well for a while. Nothing depends on how the samples were cut into batches.

    Args:
        nominal: Spindle speed, rev/s, for samples with neither an angle nor a pulse a turn; 0 if
            it is not known.

    Attributes:
        hop: Samples in a hop.
        blind: Whether the newest sample has no displacement.
    """

    def __init__(self, nominal: float = 0.0) -> None:
        """Begin with nothing held."""
        self.hop = 1
        self._nominal, self._told = nominal, False
        self._pulses: PulseAngle | None = None
        self._held: list[Array] = []
        self._count = 0
        self._step = math.nan
        self._last = math.nan
        self._dead: NDArray[np.bool_] = np.zeros(4, bool)
        self._absent: list[int] = []
        self._names: tuple[str, ...] = ()
        self._places: NDArray[np.int64] = np.full(5, -1)
        self._incomplete = False
        self._labels: tuple[str, ...] = ()
        self._sensors = Sensors('', '', (0, 0), mixed=False)
        self._filter: MotionFilter | None = None
        self.blind = False
        self._channels, self._causes = new_channels(), 0

    def faults(self) -> tuple[str, ...]:
        """What is wrong with the sensors that should be there, each in some words."""
        return faults_of(self._causes, self._labels)

    def restart_stretch(self) -> None:
        """Tell the format of the samples once more."""
        self._step = self._last = math.nan

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
                    rows = rows[_blind(rows) :]
                    yield Discontinuity.RESTART if restarted else Discontinuity.GAP
                    continue
                yield form
            whole = _unbroken(rows, self._last, self._step, self._dead)
            broken = whole < len(rows)
            taken = whole - whole % self.hop
            if taken:
                self._last = float(rows[taken - 1, 0])
                yield HopBlock(rows[:taken, 0], self._block(rows[:taken]))
            rows = rows[taken:]
            if not broken:
                break
            restarted, rows = self._drop_to_break(rows, whole - taken)
            yield Discontinuity.RESTART if restarted else Discontinuity.GAP
        self._held, self._count = [rows], len(rows)

    def _block(self, rows: Array) -> Array:
        """Angle, tool and workpiece (n, 3); one sensor alone stands for the tool's."""
        block = rows[:, 1:4].copy()
        if self._filter is not None:
            self._filter.apply(block[:, 1:])
        if self._dead[2]:
            block[:, 1], block[:, 2] = block[:, 2], 0.0
        for place in self._absent:
            block[:, place] = 0.0
        return block

    def _measure(self, rows: Array) -> StreamFormat | None:
        """Sample rate and channels of a stretch; None where it is broken before they are known."""
        first = np.ascontiguousarray(rows[:_RATE_SAMPLES, :4])  # one kind of array to compile for
        steps = np.diff(first[:, 0])
        steps = steps[np.isfinite(steps)]
        self._step = float(np.median(steps)) if len(steps) else math.nan
        self._dead = np.asarray(~np.isfinite(first).any(axis=0))
        if not self._step > 0.0 or self._dead[2:].all():
            self._step = self._step if self._step > 0.0 else 1.0
            self._dead[2] = False
            return None
        if _unbroken(first, self._last, self._step, self._dead) < _RATE_SAMPLES:
            return None
        rate, sensors = 1.0 / self._step, self._sensors
        # Where no turn is seen nothing else takes away the mean.
        filtered = sensors.filtered or bool(self._dead[1])
        self._filter = MotionFilter(sensors.orders, rate) if filtered else None
        self._absent = [place for place in (0, 2) if self._dead[place + 1]]
        angle, workpiece = not self._dead[1], not self._dead[2:].any()
        return StreamFormat(rate, angle, workpiece, sensors.mixed, self._told)

    def _drop_to_break(self, rows: Array, at: int) -> tuple[bool, Array]:
        """Drop what is held up to the break; a stretch begins with the next sample."""
        times = rows[: at + 1, 0]
        before = times[at - 1] if at else self._last
        restarted = bool(times[at] <= before)
        alive = rows[at, :4][~self._dead]
        finite = bool(np.isfinite(alive).all())
        # Where the very first sample of a stretch is the odd one, it must go or nothing moves.
        drop = at + (not finite or (at == 0 and math.isnan(self._last)))
        self.restart_stretch()
        if restarted:
            self._channels, self._causes = new_channels(), 0
        return restarted, rows[drop:]

    def _signals(self, samples: Array, columns: Sequence[str]) -> Array:
        """Time, angle, tool, workpiece and health (n, 5), nan where there is no such column."""
        names = tuple(columns)
        if names != self._names:
            sensors = sensors_among(names)
            if _TIME not in names or sensors is None:
                motion = (
                    'displacement, velocity or acceleration of tool or workpiece, sound or force'
                )
                lacking = motion if _TIME in names else _TIME
                raise LayoutError(
                    f'The samples have no column {lacking}, only {", ".join(names)}.'
                )
            spindle = _PULSE if _PULSE in names and _ANGLE not in names else _ANGLE
            wanted = (_TIME, spindle, sensors.tool, sensors.workpiece)
            places = [names.index(name) if name in names else -1 for name in wanted]
            if self._sensors != sensors:
                self._sensors = sensors
                self.restart_stretch()
            self._names, self._places = names, np.array([*places, 0])
            self._incomplete = min(places) < 0
            self._labels = tuple(name if name in names else '' for name in wanted[1:])
            self._pulses = PulseAngle() if spindle == _PULSE else None
            self._told = self._nominal > 0.0 and places[1] < 0
        if samples.ndim != 2 or samples.shape[1] != len(names):
            raise LayoutError(
                f'A block of samples for {len(names)} columns has the shape {samples.shape}.'
            )
        found: Array = samples.take(self._places, axis=1)
        if self._incomplete:
            found[:, self._places < 0] = math.nan
        if self._pulses is not None:
            found[:, 1] = self._pulses.take(found[:, 0], found[:, 1])
        elif self._told:
            found[:, 1] = self._nominal * found[:, 0]
        if len(found):
            self._causes = watch_channels(found, self._channels)
            tool, workpiece = found[-1, 2:4].tolist()
            self.blind = not (math.isfinite(tool) or math.isfinite(workpiece))
        return found


@compiled()
def _blind(rows: Array) -> int:
    """How many rows (n, 5) there are before one with a displacement."""
    for i in range(rows.shape[0]):
        if np.isfinite(rows[i, 2]) or np.isfinite(rows[i, 3]):
            return i
    return int(rows.shape[0])


@compiled()
def _unbroken(rows: Array, last: float, step: float, dead: NDArray[np.bool_]) -> int:
    """How many rows (n, 4 or 5) continue the stretch."""
    before = last if last == last else rows[0, 0] - step
    for i in range(rows.shape[0]):
        now = rows[i, 0]
        if not abs(now - before - step) < 0.5 * step:
            return i
        for column in range(1, 4):
            if not dead[column] and not np.isfinite(rows[i, column]):
                return i
            if dead[column] and rows.shape[1] > 4 and int(rows[i, 4]) & (1 << (column - 1)) != 0:
                return i  # it is well again
        before = now
    return int(rows.shape[0])
