"""`ChatterDetector`: samples in, state and estimates out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from lathe_chatter.array_types import Array
from lathe_chatter.detection.decision import SMALLEST_GROWTH
from lathe_chatter.detection.detector_state import SERIOUSNESS, STABLE, UNKNOWN
from lathe_chatter.detection.estimate import STATES, Estimate, Mode
from lathe_chatter.detection.filter_design import (
    HIGHEST_SEEN,
    UNKNOWN_MACHINE,
    Band,
    band_of,
    bands_of,
)
from lathe_chatter.detection.giving_bodies import identifiable
from lathe_chatter.detection.one_band_detector import (
    ADVISED_LONG_AGO,
    TO_BE_ADVISED,
    BandDetector,
    Thresholds,
)
from lathe_chatter.detection.signal_framing import Discontinuity, Framer, HopBlock, StreamFormat
from lathe_chatter.detection.speed_adviser import SPEEDS, SpeedAdviser
from lathe_chatter.detection.steady_tone_alarm import SteadyToneAlarm
from lathe_chatter.detection.structured_arrays import values_of
from lathe_chatter.errors import ParameterError
from lathe_chatter.model import Machine
from lathe_chatter.model.machine import Structure

_PAPER = Machine()
_NYQUIST = 0.5
_LOOK = 0.05
"""s from one look for a line above all others to the next."""
_TURN = 2.0 * math.pi
_HEEDED = 0.3
"""Part of the amplitude in the loudest band from which on a band may have chatter as well."""
_SURE_SIGN = 2.0
"""Standard errors from which on growth that is read from the vibration, or a contact, is sure."""
_CONTACT_ERRORS, _IN_PART = 8.0, 0.1
"""Standard errors that the bearing's stiffness has at least where it is known what carries the
workpiece, and the part of it from which on the workpiece rests on it."""


class ChatterDetector:
    """Flags chatter from what sensors on a machine would see.

    It uses the columns `spindle_angle` or `spindle_pulse` (which rises once a turn), and `tool_`
    and `workpiece_` `displacement`, `velocity` or `acceleration` (m, m/s, m/s2) as far as they are
    there, or a `sound` or `force` alone, never the chip thickness or the cutting force. Nothing
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
        lowest_frequency: Of chatter that is looked for where no machine is known, Hz; 0 for 20.
        highest_frequency: The same; 0 for 5000, or as far as the sample rate allows.
        nominal_rpm: Spindle speed, rev/min, for samples with neither an angle nor a pulse a turn:
            it may be off by some 1 %, so no machine is believed with it; 0 if it is not known.

    Raises:
        ParameterError: If the lowest frequency is not below the highest.
    """

    def __init__(  # noqa: PLR0913 -- what may be told it
        self,
        machine: Machine | None = _PAPER,
        *,
        speed_range: tuple[float, float] = SPEEDS,
        smallest_amplitude: float = 1e-10,
        forced_amplitude: float = 10e-6,
        strictness: float = 1.0,
        lowest_frequency: float = 0.0,
        highest_frequency: float = 0.0,
        nominal_rpm: float = 0.0,
    ) -> None:
        """Begin with nothing known."""
        lowest = lowest_frequency or UNKNOWN_MACHINE.low
        if highest_frequency and not 0.0 < lowest < highest_frequency:
            allowed = f'above the lowest frequency, which is {lowest:g} Hz'
            raise ParameterError('highest_frequency', highest_frequency, 'Hz', allowed)
        self._lowest, self._highest = lowest, highest_frequency
        self._speed_range = speed_range
        self._thresholds = Thresholds(
            smallest_amplitude, forced_amplitude, strictness, speed_range[0] / 60.0
        )
        self._nominal = nominal_rpm / 60.0
        self._advisers: list[SpeedAdviser] = []
        self._advised, self._depth = True, math.nan
        self.set_machine(machine, first=True)
        self.reset()

    def reset(self) -> None:
        """Forget everything, as at the start."""
        self._framer = Framer(self._nominal)
        self._forget()

    def _forget(self) -> None:
        self._estimate: Estimate = Estimate()
        self._depth = math.nan
        for adviser in self._advisers:
            adviser.forget()
        self._forget_format()

    def _forget_format(self) -> None:
        self._prepared: tuple[float, Mode] | None = None
        self._judges: list[BandDetector] = []
        self._lines: SteadyToneAlarm | None = None
        self._speaker, self._known = 0, False

    def update(self, samples: Array, columns: Sequence[str]) -> Estimate:
        """Take in samples.

        Args:
            samples: Rows in order of time (n, columns).
            columns: What the columns are, as in `samples.SAMPLE_COLUMNS`.

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
                self._known = False
                for judge in self._judges:
                    judge.start_stretch()
                if not self._estimate.chatter:
                    self._estimate = replace(self._estimate, state=STATES[UNKNOWN])
        faults = self._framer.faults()
        if faults != self._estimate.faults:
            self._estimate = replace(self._estimate, faults=faults)
        if self._framer.blind:
            return replace(self._estimate, mode=Mode.BLIND)
        return self._estimate

    def follow_depth(self, depth: float) -> None:
        """Take it that the cut is so deep: what is recommended amid chatter is for this depth.

        The samples tell it too late: of chatter that has grown out of the cut less force is heard
        than there is.

        Args:
            depth: Of cut, m; nan where it has become another and nobody knows which: then nothing
                is recommended that depends on it.
        """
        before, self._depth = self._depth, depth
        if before == depth:
            return
        for adviser in self._advisers:
            if math.isfinite(before) or math.isnan(depth):
                adviser.follow_depth(depth / before if before > 0.0 else math.nan)
            adviser.follow_cutting(self._cutting_stiffness_told)
        self._take_request()

    @property
    def _cutting_stiffness_told(self) -> float:
        """C w as it is told, N/m; nan where nobody tells."""
        return math.nan if self._told is None else self._told.cutting_stiffness(self._depth)

    def _take_request(self) -> None:
        """What is recommended now, where something was."""
        if self._estimate.request is not None:
            request = self._advisers[self._speaker].request
            self._estimate = replace(self._estimate, request=request)

    def set_machine(
        self,
        machine: Machine | None,
        speed_range: tuple[float, float] | None = None,
        *,
        first: bool = False,
    ) -> None:
        """Judge with another machine from the next samples on; an alarm stays."""
        if speed_range is not None:
            self._speed_range = speed_range
            for adviser in self._advisers:
                adviser.keep_to(speed_range)
            self._take_request()
        self._told = machine
        self._machine, self._lone, self._without = identifiable(machine)
        self._correction: tuple[float, float] | None = None
        if not first:
            self._begin_with_machine()

    def _begin_with_machine(self) -> None:
        # Whoever spoke last goes on: what it has recommended stands until better is known.
        if self._advisers:
            self._advisers.insert(0, self._advisers.pop(self._speaker))
        for adviser in self._advisers:
            adviser.judge_with(self._machine)
            adviser.follow_cutting(self._cutting_stiffness_told)
        self._advised = False
        self._framer.restart_stretch()
        self._forget_format()

    def _prepare(self, form: StreamFormat) -> None:
        """Get ready for a stretch with this rate and these channels."""
        self._mixed = form.mixed
        mode = Mode.of(
            self._machine, angle=form.angle, workpiece=form.workpiece, mixed=form.mixed,
            nominal=form.nominal,
        )  # fmt: skip
        bands = self._bands(form.rate)
        if not bands:
            mode = Mode.TOO_SLOW
        if self._prepared != (form.rate, mode):
            self._prepared, self._mode = (form.rate, mode), mode
            while len(self._advisers) < len(bands):
                self._advisers.append(SpeedAdviser(self._machine, self._speed_range))
                self._advisers[-1].follow_cutting(self._cutting_stiffness_told)
            age = ADVISED_LONG_AGO if self._advised else TO_BE_ADVISED
            alarm_age = age if self._estimate.chatter else None
            self._speaker, self._advised, self._known = 0, True, False
            self._judges = [
                BandDetector(self._machine, band, form, self._thresholds, adviser, alarm_age)
                for band, adviser in zip(bands, self._advisers, strict=False)
            ]
            for k, judge in enumerate(self._judges):
                judge.slower_bands = self._judges[:k]
            listens = bool(bands) and (form.mixed or not form.angle)
            self._lines = None
            if listens:
                seen = form.angle and not form.nominal
                self._lines = SteadyToneAlarm(
                    self._judges, self._thresholds.strictness, angle=seen
                )
        usual = max(1, round(_LOOK * form.rate))
        narrow = len(self._judges) == 1 and self._lines is None
        self._framer.hop = self._judges[0].hop if narrow else usual

    def _bands(self, rate: float) -> list[Band]:
        """Where chatter is looked for at a sample rate, Hz; nowhere if that is too low."""
        if self._machine is not None:
            band = band_of(self._machine)
            return [band] if band.high <= _NYQUIST * rate else []
        most = min(UNKNOWN_MACHINE.high, HIGHEST_SEEN * rate)
        band = Band(self._lowest, self._highest or most)
        return bands_of(band) if band.low < band.high <= _NYQUIST * rate else []

    def _take(self, hops: HopBlock) -> None:
        """Judge some hops, and let the band speak that has most to say."""
        time = float(hops.times[-1])
        if not self._judges:
            alarmed = self._estimate.chatter
            self._estimate = Estimate(time, chatter=alarmed, mode=Mode.TOO_SLOW)
            return
        block = hops.block
        if self._lone == 'workpiece' and self._mode is Mode.FULL:
            # It moves with the force as a tool does against it.
            block = block.take([0, 2, 1], axis=1) * [1.0, -1.0, -1.0]
        size = len(block) if self._lines is None else self._framer.hop
        for begin in range(0, len(block), size):
            for judge in self._judges:
                judge.take(block[begin : begin + size])
            if self._lines is not None:
                self._lines.look()
        if len(self._judges) > 1:
            self._speaker = self._most_serious()
        correction = self._judges[0].correction
        machine = self._machine
        if correction is None or machine is None or isinstance(machine.tool, Structure):
            self._estimate = self._new_estimate(time)
            return
        self._judges[0].correction, self._correction = None, correction
        tool = replace(machine.tool, natural_frequency=_TURN * correction[0])
        self._machine = replace(machine, tool=tool)
        self._estimate = self._new_estimate(time)
        self._begin_with_machine()

    def _most_serious(self) -> int:
        weights = [judge.weight for judge in self._judges]
        serious, loudest = max(weights), max(weights, key=lambda weight: weight[1])
        # A quick band knows soon that it is stable; what is loud elsewhere may yet be chatter, at
        # the start as in a ramp that is none for hops so short.
        both = zip(weights, self._judges, strict=True)
        unjudged = max((weight[1] for weight, judge in both if judge.ramps), default=0.0)
        known = self._known or loudest[0] > SERIOUSNESS[UNKNOWN]
        self._known = known and not unjudged > _HEEDED * loudest[1]
        speaks = self._known or serious[0] > SERIOUSNESS[STABLE]
        return weights.index(serious if speaks else loudest)

    def _machine_in_words(self, judge: BandDetector) -> str:
        """Whether the machine that was told is believed; empty where it is."""
        if self._machine is None or self._told is None or self._mode is not Mode.FULL:
            return ''
        body = self._lone or 'tool'
        hertz = getattr(self._told, body).natural_frequency / _TURN
        told = f'the {body}, told at {hertz:.1f} Hz'
        if not judge.believed:
            found = f'{judge.fit.frequency:.1f} +- {judge.fit.error:.1f} Hz'
            return f'{told}, is heard at {found}: judged without a machine'
        if self._correction is not None:
            found = '{:.1f} +- {:.1f} Hz'.format(*self._correction)
            return f'{told}, is taken at {found}, as it is heard'
        return ''

    def _surely(self, state: int) -> int:
        """The state, which is unknown where `stable` may be said of chatter at its full size."""
        if state != STABLE:
            return state
        if len(self._judges) > 1 and not self._known:
            return UNKNOWN
        lacking = (judge.state.now[0] for judge in self._judges if not judge.believed)
        out = not self._mixed and any(now['out_of_proportion'] for now in lacking)
        return UNKNOWN if out else state

    def _new_estimate(self, time: float) -> Estimate:
        judge = self._judges[self._speaker]
        now = values_of(judge.state.now)  # a field of a record takes longer than all at once
        mode, words = self._mode, self._machine_in_words(judge)
        if mode is Mode.NO_MACHINE:
            mode = self._without
        if words:
            mode = Mode.CORRECTED if judge.believed else Mode.MISFIT
        stiffness, engaged = _contact(self._machine, now)
        if self._mixed:  # neither metres nor a growth rate that is one body's
            now |= dict.fromkeys(('growth', 'growth_error', 'shown_amplitude'), math.nan)
        elif not judge.believed and not _sign_is_known(now):
            now['growth'] = math.nan
        return Estimate(
            time,
            STATES[self._surely(now['state'])],
            bool(now['alarmed']),
            mode,
            now['growth'],
            now['growth_error'],
            now['omega'] / _TURN,
            now['shown_amplitude'],
            judge.speed * 60.0 if mode.sees_spindle else math.nan,
            now['cutting'],
            stiffness,
            engaged,
            now['once_per_turn'],
            now['score'],
            judge.adviser.request,
            self._framer.faults(),
            words,
            *(judge.margin if mode.knows_machine and not now['alarmed'] else (math.nan, math.nan)),
            self._correction[0] if self._correction and self._lone != 'workpiece' else math.nan,
        )


def _contact(machine: Machine | None, now: dict[str, Any]) -> tuple[float, bool | None]:
    """What carries the workpiece, N/m, and whether its bearing does; nan and None if unknown.

    In the vibration of a quiet cut the error is as large as what the bearing adds, and the value
    too high besides: it is known only where the one contact is told from the other many times.
    """
    bearing = machine.bearing_stiffness if machine is not None else 0.0
    stiffness, error = now['stiffness'], now['stiffness_error']
    if machine is None or not _CONTACT_ERRORS * error < bearing:
        return math.nan, None
    off = stiffness - machine.workpiece.stiffness - _IN_PART * bearing
    return stiffness, off > 0.0 if abs(off) > _SURE_SIGN * error else None


def _sign_is_known(now: dict[str, Any]) -> bool:
    """Whether the growth of the vibration alone tells whether the cut is stable.

    Chatter that has grown as far as it can swells and fades, and neither says that it does not
    grow from small.
    """
    growth = now['growth']
    sure = abs(growth) > _SURE_SIGN * now['growth_error']
    return bool(sure and (growth > SMALLEST_GROWTH or not now['alarmed']))
