"""One band of frequencies judged: from samples to the state, the figures and the advice of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.detection.alarm import SATURATED
from lathe_chatter.detection.baseline import SETTLING
from lathe_chatter.detection.cut_identification import FIT, NOISE_SUMS, cutting_limit, mechanics_of
from lathe_chatter.detection.detector_state import (
    CHATTER,
    HOPS,
    REJECTED,
    SERIOUSNESS,
    TRUSTED,
    UNCHECKED,
    UNKNOWN,
    WINDOWS,
    new_state,
)
from lathe_chatter.detection.filter_design import Band, design, gain, pace_of, thinning_of
from lathe_chatter.detection.hop_loop import take_hops
from lathe_chatter.detection.machine_check import MachineFit, Verdict
from lathe_chatter.detection.reported_figures import ONSET
from lathe_chatter.detection.signal_conditioning import HOP_SUMS, SETTINGS, new_memory
from lathe_chatter.detection.signal_framing import StreamFormat
from lathe_chatter.detection.speed_adviser import Identified, SpeedAdviser
from lathe_chatter.detection.structured_arrays import record
from lathe_chatter.model import Machine

_PAPER = Machine()
_DECAY = 32.0
"""Of the resonators, 1/s: as narrow as the growth of chatter allows."""
_HOP = 0.01
"""Length of a hop, about, s: what is judged together, against the decay of the resonators."""
ADVISED_LONG_AGO = 1000
"""Age of an alarm that other sensors raised, hops: its advice stands."""
TO_BE_ADVISED = 1 - SETTLING
"""Age of an alarm for which another machine may know better advice, hops: it is sought again."""
_UNSUSPICIOUS = 0.5
"""Score below which the machine may be corrected: the baseline begins anew with it."""
_LINE_TURNS, _LINE_TIMES = 600.0, (0.15, 1.0)
"""Radians of a vibration, and the s that these are at least and at most, over which its power is
averaged to tell whether it is steady."""
_LEAKAGE = 4.0
"""Times what reaches a resonator of slower vibration, beyond its flank, that it must hear to hear
something of its own."""
_LOOKS = 2000.0
"""Times a second, at the usual pace, that the resonators are looked at without a machine."""


@dataclass(frozen=True)
class Thresholds:
    """What a user may set.

    Attributes:
        smallest_amplitude: No vibration below this is called chatter, m.
        forced_amplitude: Vibration at multiples of the spindle speed from which on the state is
            `forced`, m.
        strictness: The score that makes an alarm.
        slowest_turns: Slowest spindle speed, rev/s.
    """

    smallest_amplitude: float
    forced_amplitude: float
    strictness: float
    slowest_turns: float


class BandDetector:
    """Judges what is heard in one band.

    Args:
        machine: Tool, workpiece and bearing; None where nothing is known.
        band: Where chatter is looked for, Hz.
        form: Of the samples.
        thresholds: As the user set them.
        adviser: Recommends speeds; its advice may be older than this.
        alarm_age: Hops for which there has been an alarm already, as far as advice goes; None for
            no alarm. That a sensor died, or came back, is no sign that the chatter has ended.

    Attributes:
        hop: Samples in a hop.
        period: Length of a hop, s.
        state: What is known, `now` above all.
        believed: Whether the machine is, if there is one: it is until it is seen to be wrong.
        fit: Of the machine.
        adviser: As given.
        margin: By what fraction C w may still grow, and its standard error.
        centres: Of the resonators, Hz (bins,).
        line_weights: From their energy to that of the signal in them (bins,).
        overlap: Resonators that hear one tone.
        slower_bands: Judges of these, which have heard a block before this one does.
        correction: Natural frequency of the tool, Hz, and its standard error, where it is so sure
            that it should take the place of the told one.
    """

    def __init__(  # noqa: PLR0913, PLR0917 -- what it is made from
        self,
        machine: Machine | None,
        band: Band,
        form: StreamFormat,
        thresholds: Thresholds,
        adviser: SpeedAdviser,
        alarm_age: int | None,
    ) -> None:
        """Begin with nothing heard."""
        seen = form.angle and form.workpiece and not form.nominal
        self._full = machine is not None and seen and not form.mixed
        pace = pace_of(band)
        thinning, stride = thinning_of(band, form.rate)
        self._thinned = form.rate / thinning
        if not self._full:
            stride = max(1, round(pace * self._thinned / _LOOKS))
        outputs = max(1, round(pace * _HOP * self._thinned / stride))
        self.hop = thinning * stride * outputs
        self.period = self.hop / form.rate
        self._kernels = design(machine, self._thinned, _DECAY / pace, band)
        self._mechanics = mechanics_of(machine or _PAPER, *band)
        self._slowest_turns = thresholds.slowest_turns
        self._settings = record(
            SETTINGS,
            rate=form.rate,
            period=self.period,
            gain=gain(self._kernels, self._thinned, band.middle) if self._full else 1.0,
            tool_stiffness=machine.tool.stiffness if machine is not None else 0.0,
            forced_amplitude=math.inf if form.mixed else thresholds.forced_amplitude,
            slowest_turns=thresholds.slowest_turns,
            hop=self.hop,
            thinning=thinning,
            stride=stride,
            has_angle=2 if form.nominal else form.angle,
            has_workpiece=form.workpiece,
            has_machine=self._full,
            believed=UNCHECKED,
        )
        middle = complex(0.0, 2.0 * math.pi * band.middle)
        # Ten times the smallest: what is identified from less than that is rounding as well.
        smallest = 5.0 * thresholds.smallest_amplitude * float(self._settings['gain'][0])
        self.state = new_state(
            np.maximum((smallest / (1.0 - np.abs(self._kernels.poles))) ** 2, 1e-300),
            smallest_amplitude=thresholds.smallest_amplitude,
            strictness=thresholds.strictness,
            root=middle,
            deeper_root=middle,
            root_cutting=0.0,
            root_stiffness=machine.workpiece.stiffness if machine is not None else 0.0,
            alarmed=alarm_age is not None,
            since_alarm=alarm_age or 0,
            saturated=0 if alarm_age is None else SATURATED,  # it may have grown long ago
            peak_amplitude=0.0,
            peak_motion=0.0,
        )
        self._now = self.state.now[0]
        self.fit = MachineFit(machine or _PAPER)
        self.adviser = adviser
        self.margin = math.nan, math.nan
        self.slower_bands: Sequence[BandDetector] = ()
        self.correction: tuple[float, float] | None = None
        self._noise, self._total = record(NOISE_SUMS), record(HOP_SUMS)
        poles = self._kernels.poles
        self.centres = np.angle(poles) * self._thinned / (2.0 * math.pi)
        self.line_weights = (1.0 - np.abs(poles)) ** 2
        times = np.clip(_LINE_TURNS / (2.0 * math.pi * self.centres), *_LINE_TIMES)
        self.state.line_shares[:] = self.period / times
        width = _DECAY / pace / (2.0 * math.pi)
        spacing = float(self.centres[1] - self.centres[0])
        ratio = math.pi * width / spacing
        self.overlap = ratio / math.tanh(ratio)
        self.start_stretch()

    @property
    def believed(self) -> bool:
        """Whether a machine is there and believed."""
        return self._full and self._settings['believed'][0] != REJECTED

    @property
    def speed(self) -> float:
        """Of the spindle, rev/s."""
        return float(self.state.speeds[0])

    @property
    def weight(self) -> tuple[int, float]:
        """How much it has to say: what is most serious, and loudest of those."""
        amplitude = float(self._now['amplitude'])
        loudness = amplitude if math.isfinite(amplitude) else 0.0
        return SERIOUSNESS[int(self._now['state'])], loudness

    @property
    def ramps(self) -> bool:
        """Whether the speed changes so much from hop to hop that nothing is judged."""
        return bool(self._now['ramping'])

    def line_known(self, place: int) -> bool:
        """Whether the mean power of a resonator is one of long enough."""
        return bool(self._now.hops_seen * self.state.line_shares[place] > 1.0)

    def raise_by_line(self) -> None:
        """Raise the alarm, for there is one line above all others."""
        now = self._now
        now.by_line = 1
        if not now.alarmed:
            now.alarmed, now.since_alarm, now.calm, now.state = 1, 0, 0, CHATTER
            now.peak_amplitude = now.amplitude
            now.peak_motion = self.state.loudest[now.newest]

    def end_alarm(self) -> None:
        """There is nothing any more that would be chatter."""
        now = self._now
        now.alarmed = now.saturated = now.by_line = 0
        now.blocks = now.block_fill = now.holding = 0
        self.state.blocks[0] = 0.0
        self.state.baseline[:] = math.nan

    def start_stretch(self) -> None:
        """After a gap: no signal reaches across it, the alarm and what is usual do."""
        turn = self._thinned / max(self._slowest_turns, 0.5)
        self._memory = new_memory(turn, self._kernels, int(self._settings['stride'][0]))
        self._sums = np.zeros(HOPS, HOP_SUMS)
        self._windows = np.repeat(record(FIT, math.nan), WINDOWS.size)
        self._plain = self._windows.copy()
        self._rest: Array = np.empty((0, 3))
        self.state.motion[:] = 0.0
        self.state.speeds[:] = 0.0
        self._now.newest = self._now.hops_seen = 0
        self._now.state = CHATTER if self._now.alarmed else UNKNOWN

    def take(self, block: Array) -> None:
        """Judge what fills hops; the rest waits for more.

        Args:
            block: Spindle angle, tool and workpiece displacement (n, 3), rev and m.
        """
        if len(self._rest):
            block = np.concatenate([self._rest, block])
        done, now = 0, self._now
        count = len(block) // self.hop
        while done < count:
            done += take_hops(
                block[done * self.hop : count * self.hop],
                self._settings,
                self._mechanics,
                self._noise,
                self._total,
                self._kernels,
                self._memory,
                self._sums,
                self._windows,
                self._plain,
                self.state,
            )
            if now['fit_is_due']:
                now.fit_is_due = 0
                another = bool(now.holding or now.since_break == 0)
                self.fit.close_block(self._memory.fit, jumped=another)
                self._weigh_machine()
                self.margin = self._new_margin()
            raised = now['alarmed'] and not now.since_alarm and not now.by_line
            if raised and self._is_leakage((count - done) * self.period):
                now.alarmed = now.saturated = 0
                now.state = UNKNOWN
            if not now['alarmed']:
                self.adviser.end()
            elif self.adviser.is_due(since := int(now['since_alarm'])):
                self.adviser.consider(self._identified(), since, modelled=self.believed)
            else:
                self.adviser.doubt(float(now.growth), float(now.growth_error), since)
        self._rest = block[count * self.hop :]

    def _is_leakage(self, left: float) -> bool:
        """Whether an alarm is of no more than what leaks into its band from slower vibration.

        A slow mode swells and fades in times that a quick band's baseline is too short to know.

        Args:
            left: s that the slower bands are ahead.
        """
        state = self.state
        size = np.abs(state.motion[self._now.newest])
        usual = np.where(state.baseline > 0.0, state.baseline, 1.0)
        place = int(np.argmax(size**2 / usual))
        pole, leakage = self._kernels.poles[place], 0.0
        for judge in self.slower_bands:
            ago = min(round(left / judge.period), HOPS - 1)
            heard = np.abs(judge.state.motion[judge.state.now[0].newest - ago]) ** 2
            heard = heard * judge.line_weights
            turn = np.exp(2j * math.pi * judge.centres[heard.argmax()] / self._thinned)
            responses = 1.0 / abs(1.0 - pole * turn) + 1.0 / abs(1.0 - pole / turn)
            leakage = max(leakage, responses * math.sqrt(float(heard.sum()) / judge.overlap))
        return bool(size[place] < _LEAKAGE * leakage)

    def _new_margin(self) -> tuple[float, float]:
        cutting, error = self.fit.cutting()
        now, stiffness = self._now, float(self._now.stiffness)
        # What has settled to roundings tells no stiffness, and without one there is no limit.
        if now.alarmed or now.holding or not (cutting > 2.0 * error and math.isfinite(stiffness)):
            return math.nan, math.nan
        root = complex(now.deeper_root)
        limit = cutting_limit(self._mechanics, cutting, stiffness, 1.0 / self.speed, root)
        return limit / cutting - 1.0, limit / cutting * error / cutting

    def _weigh_machine(self) -> None:
        """Believe the machine while it fits, judge without while it does not."""
        fit = self.fit
        if fit.verdict is Verdict.FITS:
            self._settings['believed'] = TRUSTED
        if fit.verdict is not Verdict.MISFIT:
            return
        self._settings['believed'] = REJECTED
        if fit.is_correctable and not self._now.alarmed and self._now.score < _UNSUSPICIOUS:
            self.correction = fit.frequency, fit.error

    def _identified(self) -> Identified:
        now = self._now
        sees_spindle = bool(self._settings['has_angle'][0])
        return Identified(
            float(now.growth),
            float(now.growth_error),
            float(now.omega) / (2.0 * math.pi),
            60.0 * self.speed if sees_spindle else math.nan,
            float(now.cutting),
            float(now.stiffness),
            float(now.cutting_error),
            # It was steady, or the tool left the cut within the windows.
            bool(now.saturated >= SATURATED or now.since_break <= now.since_alarm + ONSET),
        )
