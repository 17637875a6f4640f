"""When a speed is recommended, from which estimate; the answer is found when somebody asks."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

from lathe_chatter.detection.speed_advice import ANOTHER_SPEED, Advice, advise, rule_of_thumb
from lathe_chatter.model import Machine
from lathe_chatter.model.machine_file import narrowed

SPEEDS = (60.0, 30_000.0)
"""Slowest and fastest speed to recommend where nothing else is said, rev/min."""
_ADVISED_AT = (0, 3, 10, 30)
"""Hops after the alarm, and after a change of speed that was no cure, at which a speed is
recommended, each time from a better estimate."""
_WITHIN_REACH = 2.0
"""Times the present speed, that a spindle is taken to reach of which nothing else is known."""
_CLEAR_CONTACT = 0.15
"""Part of k_bc by which k may be off where the bearing carries throughout, or not at all."""
_SURE = 2.0
"""Standard errors by which a growth rate is surely one, and C w as heard may be more than as told.
"""
_VAGUE = 10.0
"""Standard error of the growth rate from which on nothing is recommended, 1/s."""


def speeds_to_recommend(spindle: tuple[float, float] | None) -> tuple[float, float]:
    """The usual ones that a spindle has too, rev/min; its own where it has none of those."""
    return narrowed(SPEEDS, spindle) or spindle or SPEEDS


class Identified(NamedTuple):
    """What is known of a cut that chatters.

    Attributes:
        growth_rate: 1/s.
        growth_error: Its standard error, 1/s.
        frequency: Of the chatter, Hz.
        spindle_speed_rpm: rev/min.
        cutting_stiffness: C w, N/m; nan without a model.
        workpiece_stiffness: N/m; nan without a model.
        cutting_error: Standard error of C w, N/m.
        grown: Whether it grows no more, or the tool may have left the cut: then C w may be more.
    """

    growth_rate: float
    growth_error: float
    frequency: float
    spindle_speed_rpm: float
    cutting_stiffness: float
    workpiece_stiffness: float
    cutting_error: float = 0.0
    grown: bool = False

    def as_told(self, cutting: float) -> Identified:
        """Of grown chatter that with C w as it is told, N/m; itself where that explains it not.

        C may be told wrong: less than is heard it cannot be, and nothing is known then.
        """
        heard, error = self.cutting_stiffness, self.cutting_error
        if not (self.grown and cutting > heard - _SURE * error):
            return self
        return self._replace(cutting_stiffness=max(cutting, heard), grown=False)


@dataclass(frozen=True)
class AdviceRequest:
    """A cut that chatters, to which the answer is found when somebody asks, and once.

    Attributes:
        known: Of the cut.
        machine: Tool, workpiece and bearing; None where C w was not identified, and the rule
            60 f_c / k has to do.
        speed_range: Slowest and fastest spindle speed that may be recommended, rev/min.
        earlier: Of the same cut, from an estimate that was less sure: its answer is kept to unless
            another is clearly better.
        changed: Whether it is `earlier` itself for another depth or range of speeds: however often
            these change, what is kept to is the answer before the first change.
    """

    known: Identified
    machine: Machine | None
    speed_range: tuple[float, float]
    earlier: AdviceRequest | None = field(default=None, repr=False, compare=False)
    changed: bool = field(default=False, repr=False, compare=False)

    def within(self, speed_range: tuple[float, float]) -> AdviceRequest:
        """The same with another range of speeds: itself, with its answer, where it is the same."""
        same = speed_range == self.speed_range
        return self if same else self._changed(speed_range=speed_range)

    def as_told(self, cutting: float) -> AdviceRequest:
        """With C w as it is told, N/m, if it rests on grown chatter."""
        known = self.known if self.machine is None else self.known.as_told(cutting)
        return self if known is self.known else self._changed(known=known)

    def at_depth(self, factor: float) -> AdviceRequest | None:
        """For a depth of cut that is so many times as large, nan for unknown: None then."""
        if self.machine is None:  # the rule of thumb is the same at every depth
            return self
        if not math.isfinite(factor):
            return None
        cutting, error = self.known.cutting_stiffness, self.known.cutting_error
        known = self.known._replace(
            cutting_stiffness=factor * cutting, cutting_error=factor * error
        )
        return self._changed(known=known)

    def _changed(self, **changes: Any) -> AdviceRequest:
        earlier = self.earlier if self.changed else self
        return replace(self, **changes, earlier=earlier, changed=True)

    @cached_property
    def answer(self) -> Advice:
        """What to do, some 10 ms after it is asked for first."""
        known, (slowest, fastest) = self.known, self.speed_range
        if fastest >= SPEEDS[1]:  # nobody has said what the spindle can
            fastest = min(_WITHIN_REACH * known.spindle_speed_rpm, fastest)  # may be nan
        if self.machine is None:
            found = rule_of_thumb(known.frequency, (slowest, fastest))
        else:
            found = advise(
                self.machine,
                known.cutting_stiffness,
                (slowest, fastest),
                known.spindle_speed_rpm,
                seated=_seated(self.machine, known.workpiece_stiffness),
                cutting_error=known.cutting_error,
                advised_rpm=self._advised_before(),
            )
        at_best = known.grown and self.machine is not None
        return replace(found, found_at_rpm=known.spindle_speed_rpm, at_best=at_best)

    def _advised_before(self) -> float:
        """The speed that was recommended before, rev/min; nan for none."""
        if self.earlier is None or self.earlier.machine is None:
            return math.nan
        speeds = self.earlier.answer.speeds
        return speeds[0].spindle_speed_rpm if speeds else math.nan


class SpeedAdviser:
    """Recommends speeds while there is chatter, and keeps to the estimate that is best.

    Chatter that has grown so far that the tool leaves the cut grows no more, and C w looks less
    than it is: a speed chosen for it would chatter. So an estimate counts only if it is surer
    than those before, and its growth rate is not clearly below theirs; and where nothing is heard
    but such chatter, C w counts as it is told.

    Args:
        machine: Tool, workpiece and bearing; None where nothing is known.
        speed_range: Slowest and fastest spindle speed that may be recommended, rev/min.

    Attributes:
        machine: As given, or as `judge_with` was told.
        request: For the advice that stands; None where there is none.
    """

    def __init__(self, machine: Machine | None, speed_range: tuple[float, float]) -> None:
        """Nothing chatters yet."""
        self.machine = machine
        self.speed_range = speed_range
        self.forget()

    def forget(self) -> None:
        """Begin anew, as with another run."""
        self._advised_at = self._cutting = math.nan
        self.end()

    def end(self) -> None:
        """There is no chatter; where some was, what is tried against it is not forgotten."""
        self.request: AdviceRequest | None = None
        self._error = math.inf
        self._surely_grew = -math.inf

    def judge_with(self, machine: Machine | None) -> None:
        """Take another machine: what was recommended stands until there is an estimate with it."""
        self.machine = machine
        self._error = math.inf
        self._surely_grew = -math.inf

    def keep_to(self, speed_range: tuple[float, float]) -> None:
        """Recommend no other speeds; for what chatters already another one is found, if need be.

        Args:
            speed_range: As for the constructor.
        """
        self.speed_range = speed_range
        if self.request is not None:
            self.request = self.request.within(speed_range)

    def follow_depth(self, factor: float) -> None:
        """Recommend for another depth; what is heard of that amid chatter is not believed.

        Args:
            factor: The depth of cut over that of before; nan where nobody knows.
        """
        if self.request is not None:
            self.request = self.request.at_depth(factor)
            self._error = 0.0

    def follow_cutting(self, cutting: float) -> None:
        """Take C w of what is cut now as it is told, where it cannot be heard.

        Args:
            cutting: N/m; nan where nobody knows.
        """
        self._cutting = cutting
        if self.request is not None:
            self.request = self.request.as_told(cutting)

    def is_due(self, hops_after_alarm: int) -> bool:
        """Whether a speed is to be recommended now."""
        return hops_after_alarm in _ADVISED_AT

    def doubt(self, growth: float, error: float, hops_after_alarm: int) -> None:
        """Recommend nothing while a cut that was not surely found to grow is surely stable.

        Args:
            growth: Rate of the newest estimate, 1/s.
            error: Its standard error, 1/s.
            hops_after_alarm: While they are few; of chatter that has grown C w looks less.
        """
        request = self.request
        if request is None or request.machine is None or hops_after_alarm > _ADVISED_AT[-1]:
            return
        known = request.known
        unsure = not known.grown and known.growth_rate < _SURE * known.growth_error
        if unsure and growth < -_SURE * error:
            self.end()

    def consider(self, known: Identified, hops_after_alarm: int, *, modelled: bool) -> None:
        """Recommend from an estimate, if it is better than those before.

        Args:
            known: The estimate.
            hops_after_alarm: At 0 there is nothing before.
            modelled: Whether C w was identified; else the rule 60 f_c / k has to do.
        """
        if hops_after_alarm == 0:
            self.end()
        growth, error = known.growth_rate, known.growth_error
        if growth < -error or error > _VAGUE:
            return  # it dies down, or nobody knows
        tried = abs(known.spindle_speed_rpm / self._advised_at - 1.0) > ANOTHER_SPEED
        if tried and growth < error:
            return  # what was recommended may yet be the cure
        self._advised_at = known.spindle_speed_rpm
        if self.machine is None or not modelled:
            self.request = AdviceRequest(known, None, self.speed_range)
            return
        if not error < self._error or growth + error < self._surely_grew:
            return
        self._error = error
        self._surely_grew = max(self._surely_grew, growth - error)
        earlier = None if tried else self.request
        known = known._replace(grown=known.grown or tried).as_told(self._cutting)
        self.request = AdviceRequest(known, self.machine, self.speed_range, earlier)


def _seated(machine: Machine, stiffness: float) -> bool | None:
    """Whether the bearing carries throughout, or not at all; None in between."""
    if not machine.bearing_stiffness:
        return False
    open_ = machine.workpiece_stiffness(seated=False)
    part = (stiffness - open_) / machine.bearing_stiffness
    if abs(part) < _CLEAR_CONTACT:
        return False
    return True if abs(part - 1.0) < _CLEAR_CONTACT else None
