"""`ChatterDetector`: samples in, state and estimates out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lathe_chatter.arrays import Array
from lathe_chatter.detection.block_loop import take_hops
from lathe_chatter.detection.detector_state import CHATTER, HOPS, UNKNOWN, WINDOWS, new_state
from lathe_chatter.detection.estimate import STATES, Estimate, Mode
from lathe_chatter.detection.filters import (
    UNKNOWN_MACHINE,
    Band,
    band_of,
    design,
    gain,
    thinning_of,
)
from lathe_chatter.detection.framing import Discontinuity, Framer, HopBlock, StreamFormat
from lathe_chatter.detection.identification import FIT, NOISE_SUMS, cutting_limit, mechanics_of
from lathe_chatter.detection.machine_fit import MachineFit, Verdict
from lathe_chatter.detection.records import record, values_of
from lathe_chatter.detection.signals import HOP_SUMS, SETTINGS, new_memory
from lathe_chatter.detection.speed_advice import Identified, SpeedAdviser
from lathe_chatter.model import Machine
from lathe_chatter.model.machine import Structure

_PAPER = Machine()
_DECAY = 32.0
"""Of the resonators, 1/s: as narrow as the growth of chatter allows."""
_CARRIED = 1000
"""Hops that an alarm of other sensors is said to be old: its advice stands."""
_UNSUSPICIOUS = 0.5
"""Score below which the machine may be corrected: the baseline begins anew with it."""
_NYQUIST = 0.5
_HOP = 0.01
"""Length of a hop, about, s: what is judged together, against the decay of the resonators."""


class ChatterDetector:
    """Flags chatter from what sensors on a machine would see.

    It uses the columns `spindle_angle` and `tool_` and `workpiece_` `displacement`, `velocity` or
    `acceleration` (m, m/s, m/s2) as far as they are there, or a `sound` or `force` alone, never
    the chip thickness or the cutting force. Nothing depends on how the samples were cut into
    batches.

    Args:
        machine: Tool, workpiece and bearing as an impact test would give them; None where
            nothing is known, and growth is then read from the vibration alone.
        speed_range: Slowest and fastest spindle speed that may be recommended, rev/min.
        smallest_amplitude: No vibration below this is called chatter, m.
        forced_amplitude: Vibration at multiples of the spindle speed from which on the state is
            `forced`, m.
        strictness: The score that makes an alarm; 1 for the figures in the README, more for
            fewer alarms.
        unknown_band: Lowest and highest frequency of chatter that is looked for where no machine
            is known, Hz.
    """

    def __init__(  # noqa: PLR0913 -- what may be told it
        self,
        machine: Machine | None = _PAPER,
        *,
        speed_range: tuple[float, float] = (60.0, 30000.0),
        smallest_amplitude: float = 1e-10,
        forced_amplitude: float = 10e-6,
        strictness: float = 1.0,
        unknown_band: tuple[float, float] = UNKNOWN_MACHINE,
    ) -> None:
        """Begin with nothing known."""
        self._told = machine
        self._machine = machine if _has_single_modes(machine) else None
        self._correction: tuple[float, float] | None = None
        self._speed_range = speed_range
        self._adviser = SpeedAdviser(self._machine, speed_range)
        self._smallest = smallest_amplitude
        self._forced = forced_amplitude
        self._strictness = strictness
        self._unknown = Band(*unknown_band)
        self._mixed = False
        self.reset()

    def _forget(self) -> None:
        self._estimate: Estimate = Estimate()
        self._adviser.forget()
        self._forget_format()

    def reset(self) -> None:
        """Forget everything, as at the start."""
        self._framer = Framer()
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
        for item in self._framer.take(samples, columns):
            if isinstance(item, HopBlock):
                self._take(item)
            elif isinstance(item, StreamFormat):
                self._prepare(item)
            elif item is Discontinuity.RESTART:
                self._forget()
            else:
                self._start_stretch()
                if not self._estimate.chatter:
                    self._estimate = replace(self._estimate, state=STATES[UNKNOWN])
        faults = self._framer.faults()
        if faults != self._estimate.faults:
            self._estimate = replace(self._estimate, faults=faults)
        if self._framer.blind:
            return replace(self._estimate, mode=Mode.BLIND)
        return self._estimate

    def _forget_format(self) -> None:
        self._prepared: tuple[float, Mode] | None = None
        self._hop = 1

    def set_machine(self, machine: Machine | None) -> None:
        """Judge with another machine from the next samples on; an alarm stays."""
        self._told = machine
        self._machine = machine if _has_single_modes(machine) else None
        self._correction = None
        self._adviser.machine = self._machine
        self._framer.restart_stretch()
        self._forget_format()

    def _prepare(self, form: StreamFormat) -> None:
        """Get ready for a stretch with this rate and these channels."""
        self._mixed = form.mixed
        mode = Mode.of(self._machine, angle=form.angle, workpiece=form.workpiece, mixed=form.mixed)
        band = band_of(self._machine, self._unknown)
        if band.high > _NYQUIST * form.rate:
            mode = Mode.TOO_SLOW
        if self._prepared == (form.rate, mode):
            self._framer.hop = self._hop
            return
        self._prepared, self._mode = (form.rate, mode), mode
        if mode is Mode.TOO_SLOW:
            self._hop = self._framer.hop = max(1, round(_HOP * form.rate))
            return
        machine = self._machine
        thinning, stride = thinning_of(machine, form.rate, self._unknown)
        self._thinned = form.rate / thinning
        outputs = max(1, round(_HOP * self._thinned / stride))
        self._hop = self._framer.hop = thinning * stride * outputs
        self._kernels = design(machine, self._thinned, _DECAY, self._unknown)
        self._mechanics = mechanics_of(machine or _PAPER, *band)
        self._settings = record(
            SETTINGS,
            rate=form.rate,
            period=self._hop / form.rate,
            gain=gain(self._kernels, self._thinned, band.middle),
            tool_stiffness=machine.tool.stiffness if machine is not None else 0.0,
            forced_amplitude=math.inf if form.mixed else self._forced,
            slowest_turns=self._speed_range[0] / 60.0,
            hop=self._hop,
            thinning=thinning,
            stride=stride,
            has_angle=form.angle,
            has_workpiece=form.workpiece,
            has_machine=mode is Mode.FULL,
            believed=1,
        )
        middle = complex(0.0, 2.0 * math.pi * band.middle)
        alarmed = self._estimate.chatter
        self._state = new_state(
            self._kernels.poles.size,
            smallest_amplitude=self._smallest,
            strictness=self._strictness,
            root=middle,
            deeper_root=middle,
            root_cutting=0.0,
            root_stiffness=machine.workpiece.stiffness if machine is not None else 0.0,
            # That a sensor died, or came back, is no sign that the chatter has ended.
            alarmed=alarmed,
            since_alarm=_CARRIED if alarmed else 0,
            peak_amplitude=0.0,
        )
        self._now = self._state.now[0]
        self._fit = MachineFit(machine or _PAPER)
        self._margin = math.nan, math.nan
        self._noise, self._total = record(NOISE_SUMS), record(HOP_SUMS)
        self._start_stretch()

    def _start_stretch(self) -> None:
        """After a gap: no signal reaches across it, the alarm and what is usual do."""
        if self._prepared is None or self._mode is Mode.TOO_SLOW:
            return
        turn = self._thinned / max(self._speed_range[0] / 60.0, 0.5)
        self._memory = new_memory(turn, self._kernels, int(self._settings['stride'][0]))
        self._sums = np.zeros(HOPS, HOP_SUMS)
        self._windows = np.repeat(record(FIT, math.nan), WINDOWS.size)
        self._plain = self._windows.copy()
        self._state.motion[:] = 0.0
        self._state.speeds[:] = 0.0
        self._now.newest = self._now.hops_seen = 0
        self._now.state = CHATTER if self._now.alarmed else UNKNOWN

    def _take(self, hops: HopBlock) -> None:
        """Judge some hops; stop where a speed has to be recommended."""
        if self._mode is Mode.TOO_SLOW:
            alarmed, time = self._estimate.chatter, float(hops.times[-1])
            self._estimate = Estimate(time, chatter=alarmed, mode=Mode.TOO_SLOW)
            return
        done, now = 0, self._now
        count = len(hops.block) // self._hop
        while done < count:
            done += take_hops(
                hops.block[done * self._hop :],
                self._settings,
                self._mechanics,
                self._noise,
                self._total,
                self._kernels,
                self._memory,
                self._sums,
                self._windows,
                self._plain,
                self._state,
            )
            if now['fit_is_due']:
                now.fit_is_due = 0
                self._fit.close_block(self._memory.fit, jumped=bool(now.holding))
                self._weigh_machine()
                self._margin = self._new_margin()
            if not now['alarmed']:
                self._adviser.forget()
            elif self._adviser.is_due(since := int(now['since_alarm'])):
                modelled = self._mode is Mode.FULL and bool(self._settings['believed'][0])
                self._adviser.consider(self._identified(), since, modelled=modelled)
        self._estimate = self._new_estimate(float(hops.times[-1]))

    def _new_margin(self) -> tuple[float, float]:
        """By what fraction C w may still grow, and the standard error of that."""
        cutting, error = self._fit.cutting()
        now = self._now
        if now.alarmed or now.holding or not cutting > 2.0 * error:
            return math.nan, math.nan
        delay = 1.0 / float(self._state.speeds[0])
        root = complex(now.deeper_root)
        limit = cutting_limit(self._mechanics, cutting, float(now.stiffness), delay, root)
        return limit / cutting - 1.0, limit / cutting * error / cutting

    def _weigh_machine(self) -> None:
        """Believe the machine while it fits, judge without while it does not, and correct it."""
        fit, told = self._fit, self._machine
        if fit.verdict is Verdict.FITS:
            self._settings['believed'] = 1
        if fit.verdict is not Verdict.MISFIT or told is None or isinstance(told.tool, Structure):
            return
        self._settings['believed'] = 0
        if fit.is_correctable and not self._now.alarmed and self._now.score < _UNSUSPICIOUS:
            omega = 2.0 * math.pi * fit.frequency
            self._machine = replace(told, tool=replace(told.tool, natural_frequency=omega))
            self._adviser.machine = self._machine
            self._correction = fit.frequency, fit.error
            self._framer.restart_stretch()
            self._forget_format()

    def _machine_in_words(self) -> str:
        """Whether the machine that was told is believed; empty where it is."""
        if self._machine is None or self._told is None or self._mode is not Mode.FULL:
            return ''
        hertz = self._told.tool.natural_frequency / (2.0 * math.pi)
        if not self._settings['believed'][0]:
            found = f'{self._fit.frequency:.1f} +- {self._fit.error:.1f} Hz'
            return (
                f'the tool, told at {hertz:.1f} Hz, is heard at {found}: judged without a machine'
            )
        if self._correction is not None:
            found = '{:.1f} +- {:.1f} Hz'.format(*self._correction)
            return f'the tool, told at {hertz:.1f} Hz, is taken at {found}, as it is heard'
        return ''

    def _speed(self) -> float:
        """rev/s; nan where the spindle is not seen."""
        speed = float(self._state.speeds[0])
        return speed if self._mode.sees_spindle else math.nan

    def _identified(self) -> Identified:
        now = self._now
        return Identified(
            float(now.growth),
            float(now.growth_error),
            float(now.omega) / (2.0 * math.pi),
            60.0 * self._speed(),
            float(now.cutting),
            float(now.stiffness),
            float(now.cutting_error),
        )

    def _new_estimate(self, time: float) -> Estimate:
        now = values_of(self._state.now)  # a field of a record takes longer than all at once
        mode, words = self._mode, self._machine_in_words()
        if mode is Mode.NO_MACHINE and self._told is not None:
            mode = Mode.MANY_MODES
        if words:
            mode = Mode.CORRECTED if self._settings['believed'][0] else Mode.MISFIT
        stiffness = now['stiffness']
        engaged = None
        if self._machine is not None and math.isfinite(stiffness):
            bearing = self._machine.bearing_stiffness
            engaged = stiffness > self._machine.workpiece.stiffness + 0.1 * bearing
        if self._mixed:  # neither metres nor a growth rate that is one body's
            now |= dict.fromkeys(('growth', 'growth_error', 'amplitude'), math.nan)
        return Estimate(
            time,
            STATES[now['state']],
            bool(now['alarmed']),
            mode,
            now['growth'],
            now['growth_error'],
            now['omega'] / (2.0 * math.pi),
            now['amplitude'],
            self._speed() * 60.0,
            now['cutting'],
            stiffness,
            engaged,
            now['once_per_turn'],
            now['score'],
            self._adviser.advice,
            self._framer.faults(),
            words,
            *(self._margin if mode.knows_machine and not now['alarmed'] else (math.nan, math.nan)),
            self._correction[0] if self._correction is not None else math.nan,
        )


def _has_single_modes(machine: Machine | None) -> bool:
    """Whether the machine, if there is one, has what the identification takes: a mode each."""
    parts = () if machine is None else (machine.tool, machine.workpiece)
    return not any(isinstance(part, Structure) for part in parts)
