"""`Estimate`: the state of the cut and the figures that explain it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from lathe_chatter.detection.speed_advice import Advice
from lathe_chatter.detection.speed_adviser import AdviceRequest
from lathe_chatter.html_table import html_table
from lathe_chatter.model import Machine

IDLE, STABLE, WATCH, CHATTER, FORCED, UNKNOWN = (
    'idle',
    'stable',
    'watch',
    'chatter',
    'forced',
    'unknown',
)
STATES = (IDLE, STABLE, WATCH, CHATTER, FORCED, UNKNOWN)
RECOMMENDED_SPEED = 'recommended_speed_rpm'
FIGURES = ('growth_rate', 'frequency', 'amplitude', RECOMMENDED_SPEED, 'margin')
"""What of an estimate is published, where it is known, each under its name."""
HEARD = tuple(name for name in FIGURES if name != RECOMMENDED_SPEED)
"""Those that need not be looked for."""


class Mode(str, Enum):
    """With how much the detector has to work."""

    FULL = 'both displacements and the machine are known'
    CORRECTED = 'both displacements, and the machine with its tool as it is heard'
    MISFIT = 'no machine, for the one that was told does not fit what is heard'
    MANY_MODES = 'no machine, for the one that was told has more than a plain mode each'
    FAR_APART = 'no machine, for the bodies of the one that was told are far apart in frequency'
    ONE_SENSOR = 'the motion of one body only'
    MIXTURE = 'sound or force alone, which does not tell how fast a vibration grows'
    NO_MACHINE = 'the machine is not known'
    NO_SPINDLE = 'the spindle is not seen'
    NOMINAL = 'a spindle speed that is only nominal, and so without a machine'
    BLIND = 'no sensor that can be believed'
    TOO_SLOW = 'a sample rate that is too low for the frequencies that are looked for'
    WAITING = 'no samples yet'

    @classmethod
    def of(
        cls,
        machine: Machine | None,
        *,
        angle: bool,
        workpiece: bool,
        mixed: bool = False,
        nominal: bool = False,
    ) -> Mode:
        """The mode for what is there; the gravest lack names it."""
        if mixed:
            return cls.MIXTURE if angle else cls.NO_SPINDLE
        if not angle:
            return cls.NO_SPINDLE
        if nominal:
            return cls.NOMINAL
        if not workpiece:
            return cls.ONE_SENSOR
        return cls.FULL if machine is not None else cls.NO_MACHINE

    @property
    def knows_machine(self) -> bool:
        """Whether a machine is believed."""
        return self in {Mode.FULL, Mode.CORRECTED}

    @property
    def sees_spindle(self) -> bool:
        """Whether the spindle speed is known."""
        return self is not Mode.NO_SPINDLE and self is not Mode.WAITING


@dataclass(frozen=True)
class Estimate:
    """The detector's knowledge after a sample; nan or None where something is not known.

    Attributes:
        time: Of the newest sample taken into account, s.
        state: `idle` (the spindle stands or nothing is cut), `stable`, `watch` (chatter is
            suspected), `chatter`, `forced` (vibration, but the spindle's own), or `unknown`
            (too little data, a ramp, a gap).
        chatter: The alarm; it stays until the chatter has died out.
        mode: With how much the detector has to work.
        growth_rate: Real part of the rightmost root of the identified cut, 1/s; without a machine
            that of the vibration itself, where this tells whether the cut is stable.
        growth_rate_error: Its standard error, 1/s.
        frequency: Of the chatter, or of the least damped vibration, Hz.
        amplitude: Of the tool's vibration in the band that is not the spindle's own, m; of the
            workpiece's where the tool was told not to give.
        spindle_speed_rpm: rev/min.
        cutting_stiffness: C w, N/m.
        workpiece_stiffness: What carries the workpiece: k_wp, up to k_wp + k_bc, N/m; nan where
            its standard error is more than an eighth of k_bc, as in most quiet cuts, only one
            body gives, or there is no bearing.
        bearing_engaged: Whether the workpiece rests on its bearing, at least in part; None where
            that is less sure than by two standard errors.
        once_per_turn: Variance at one spindle angle from turn to turn, over all variance: near
            1 for chatter, near 0 for vibration that is the spindle's own.
        score: Suspicion; 1 raises the alarm.
        request: For advice about the chatter; `advice` is the answer.
        machine_fit: What is heard of a machine that was told wrong; empty where it fits.
        margin: By what fraction the depth of cut may still grow, negative beyond the limit; known
            while there is no alarm.
        margin_error: Its standard error.
        tool_frequency: That has taken the place of the tool's told natural frequency, Hz; nan
            where none has.
        faults: What is wrong with sensors that should be there, each in some words.
    """

    time: float = math.nan
    state: str = UNKNOWN
    chatter: bool = False
    mode: Mode = Mode.WAITING
    growth_rate: float = math.nan
    growth_rate_error: float = math.nan
    frequency: float = math.nan
    amplitude: float = math.nan
    spindle_speed_rpm: float = math.nan
    cutting_stiffness: float = math.nan
    workpiece_stiffness: float = math.nan
    bearing_engaged: bool | None = None
    once_per_turn: float = math.nan
    score: float = math.nan
    request: AdviceRequest | None = None
    faults: tuple[str, ...] = ()
    machine_fit: str = ''
    margin: float = math.nan
    margin_error: float = math.nan
    tool_frequency: float = math.nan

    @property
    def doubling_time(self) -> float:
        """Time in which the chatter doubles, s; infinite where it does not grow."""
        if self.growth_rate <= 0.0:
            return math.inf
        return math.log(2.0) / self.growth_rate

    @property
    def waves_per_revolution(self) -> float:
        """Vibrations in a spindle turn."""
        if not self.spindle_speed_rpm > 0.0:
            return math.nan
        return 60.0 * self.frequency / self.spindle_speed_rpm

    @property
    def advice(self) -> Advice:
        """What to do about the chatter: it is looked for when it is asked for first."""
        return Advice() if self.request is None else self.request.answer

    @property
    def recommended_speed_rpm(self) -> float:
        """A spindle speed at which the cut would be stable, rev/min."""
        return self.advice.speeds[0].spindle_speed_rpm if self.advice.speeds else math.nan

    def _repr_html_(self) -> str:
        """As a notebook shows it: what is known."""
        error = f'{self.growth_rate_error:.2g}'
        rows: list[tuple[str, object, str]] = [
            ('state', self.state, ''),
            ('chatter', 'yes' if self.chatter else 'no', ''),
            ('works with', self.mode.value, ''),
            ('time', self.time, 's'),
            ('growth rate', self.growth_rate, f'1/s, with a standard error of {error}'),
            ('frequency', self.frequency, 'Hz'),
            ('amplitude', self.amplitude, 'm'),
            ('spindle speed', self.spindle_speed_rpm, 'rev/min'),
            ('cutting stiffness C w', self.cutting_stiffness, 'N/m'),
            ('recommended speed', self.recommended_speed_rpm, 'rev/min'),
        ]
        return html_table('Estimate', [row for row in rows if row[1] == row[1]])
