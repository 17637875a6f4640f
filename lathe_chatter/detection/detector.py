"""`ChatterDetector`: samples in, state and estimates out."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from lathe_chatter.arrays import Array
from lathe_chatter.detection import detector_state as ledgers
from lathe_chatter.detection.advice_timing import Adviser, Identified
from lathe_chatter.detection.block_loop import HopFigures, take_hops
from lathe_chatter.detection.framing import Break, Hops, Intake, Rate
from lathe_chatter.detection.identification import WINDOW_SIZE, mechanics_of
from lathe_chatter.detection.kernels import band_of, design, gain, thinning_of
from lathe_chatter.detection.signals import PRODUCTS_SIZE, READING_SIZE, fresh_memory
from lathe_chatter.detection.states import STATES, Estimate, Mode
from lathe_chatter.model import Machine

_PAPER = Machine()
_DECAY = 32.0
"""Of the resonators, 1/s: as narrow as the growth of chatter allows."""
_HOP = 0.01
"""Length of a hop, about, s: what is judged together, against the decay of the resonators."""


class ChatterDetector:
    """Flags chatter from what sensors on a machine would see.

    It uses the columns `tool_displacement`, `workpiece_displacement` and `spindle_angle` as far
    as they are there (a displacement has to be), never the chip thickness or the force. Nothing
    depends on how the samples were cut into batches.

    Args:
        machine: Tool, workpiece and bearing as an impact test would give them; None where
            nothing is known, and growth is then read from the vibration alone.
        speed_range: Slowest and fastest spindle speed that may be recommended, rev/min.
        smallest_amplitude: No vibration below this is called chatter, m.
        forced_amplitude: Vibration at multiples of the spindle speed from which on the state is
            `forced`, m.
        strictness: The score that makes an alarm; 1 for the figures in the README, more for
            fewer alarms.
    """

    def __init__(
        self,
        machine: Machine | None = _PAPER,
        *,
        speed_range: tuple[float, float] = (60.0, 30000.0),
        smallest_amplitude: float = 1e-10,
        forced_amplitude: float = 10e-6,
        strictness: float = 1.0,
    ) -> None:
        """Begin with nothing known."""
        self._machine = machine
        self._speed_range = speed_range
        self._adviser = Adviser(machine, speed_range)
        self._smallest = smallest_amplitude
        self._forced = forced_amplitude
        self._strictness = strictness
        self.reset()

    def reset(self) -> None:
        """Forget everything, as at the start."""
        self._intake = Intake()
        self._forget()

    def update(self, samples: Array, columns: Sequence[str]) -> Estimate:
        """Take in samples.

        Args:
            samples: Rows in order of time (n, columns).
            columns: What the columns are, as in `model.SAMPLE_COLUMNS`.

        Returns:
            What is known after the last of them.

        Raises:
            LayoutError: If there is no time or no displacement, or the shape is wrong.
        """
        for item in self._intake.take(samples, columns):
            if isinstance(item, Hops):
                self._take(item)
            elif isinstance(item, Rate):
                self._prepare(item)
            elif item is Break.RESTART:
                self._forget()
            else:
                self._begin_stretch()
        return self._estimate

    def _forget(self) -> None:
        self._estimate = Estimate()
        self._adviser.forget()
        self._prepared: tuple[float, Mode] | None = None
        self._hop = 1

    def _prepare(self, rate: Rate) -> None:
        """Get ready for a stretch with this rate and these channels."""
        mode = Mode.of(self._machine, angle=rate.angle, workpiece=rate.workpiece)
        if self._prepared == (rate.value, mode):
            self._intake.hop = self._hop
            return
        self._prepared, self._mode = (rate.value, mode), mode
        machine = self._machine
        thinning, stride = thinning_of(machine, rate.value)
        self._thinned = rate.value / thinning
        outputs = max(1, round(_HOP * self._thinned / stride))
        self._hop = self._intake.hop = thinning * stride * outputs
        self._kernels = design(machine, self._thinned, _DECAY)
        band = band_of(machine)
        self._mechanics = mechanics_of(machine or _PAPER, *band)
        self._reading = np.zeros(READING_SIZE, np.int64)
        self._reading[:] = (
            thinning,
            stride,
            rate.angle,
            rate.workpiece,
            mode is Mode.FULL,
        )
        self._period = self._hop / rate.value
        tool = machine.tool.stiffness if machine is not None else 0.0
        self._figures = np.array(
            [
                self._period,
                tool,
                self._forced,
                gain(self._kernels, self._thinned, band.middle),
                rate.value,
                self._speed_range[0] / 60.0,
            ]
        )
        self._ledger = ledgers.fresh_ledger(self._kernels.poles.size)
        numbers = self._ledger.numbers
        numbers[ledgers.SMALLEST], numbers[ledgers.STRICTNESS] = self._smallest, self._strictness
        spindle = machine.workpiece.stiffness if machine is not None else 0.0
        middle = complex(0.0, 2.0 * math.pi * band.middle)
        self._guess = np.array([middle, 0.0, spindle, middle])
        self._begin_stretch()

    def _begin_stretch(self) -> None:
        """After a gap: no signal reaches across it, the alarm and what is usual do."""
        if self._prepared is None:
            return
        turn = self._thinned / max(self._figures[HopFigures.SLOWEST], 0.5)
        self._memory = fresh_memory(turn, self._kernels)
        self._products = np.zeros((ledgers.HOPS, PRODUCTS_SIZE))
        self._windows = np.full((ledgers.WINDOWS.size, WINDOW_SIZE), np.nan)
        self._place = np.zeros(1, np.int64)
        self._ledger.motion[:] = 0.0
        self._ledger.speeds[:] = 0.0
        self._ledger.flags[ledgers.SEEN] = 0
        self._ledger.flags[ledgers.STATE] = ledgers.UNKNOWN

    def _take(self, hops: Hops) -> None:
        """Judge some hops; stop where a speed has to be recommended."""
        done, flags = 0, self._ledger.flags
        count = len(hops.block) // self._hop
        while done < count:
            done += take_hops(
                hops.block[done * self._hop :],
                self._hop,
                self._reading,
                self._kernels,
                self._memory,
                self._products,
                self._windows,
                self._mechanics,
                self._figures,
                self._guess,
                self._place,
                self._ledger,
            )
            if flags[ledgers.ALARMED] == 0:
                self._adviser.forget()
            elif self._adviser.is_asked(since := int(flags[ledgers.SINCE_ALARM])):
                modelled = self._mode is Mode.FULL
                self._adviser.consider(self._identified(), since, modelled=modelled)
        self._estimate = self._told(float(hops.times[-1]))

    def _speed(self) -> float:
        """rev/s; nan where the spindle is not seen."""
        speed = float(self._ledger.speeds[0])
        return speed if self._mode.sees_spindle else math.nan

    def _identified(self) -> Identified:
        numbers = self._ledger.numbers.tolist()
        return Identified(
            numbers[ledgers.FIGURE_GROWTH],
            numbers[ledgers.FIGURE_ERROR],
            numbers[ledgers.FIGURE_OMEGA] / (2.0 * math.pi),
            60.0 * self._speed(),
            numbers[ledgers.FIGURE_CUTTING],
            numbers[ledgers.FIGURE_STIFFNESS],
        )

    def _told(self, time: float) -> Estimate:
        numbers, flags = self._ledger.numbers.tolist(), self._ledger.flags
        stiffness = numbers[ledgers.FIGURE_STIFFNESS]
        engaged = None
        if self._machine is not None and math.isfinite(stiffness):
            bearing = self._machine.bearing_stiffness
            engaged = stiffness > self._machine.workpiece.stiffness + 0.1 * bearing
        return Estimate(
            time,
            STATES[int(flags[ledgers.STATE])],
            bool(flags[ledgers.ALARMED]),
            self._mode,
            numbers[ledgers.FIGURE_GROWTH],
            numbers[ledgers.FIGURE_ERROR],
            numbers[ledgers.FIGURE_OMEGA] / (2.0 * math.pi),
            numbers[ledgers.AMPLITUDE],
            self._speed() * 60.0,
            numbers[ledgers.FIGURE_CUTTING],
            stiffness,
            engaged,
            numbers[ledgers.RATIO],
            numbers[ledgers.SCORE],
            self._adviser.advice,
        )
