"""When a speed is recommended, and from which of the estimates that follow an alarm."""

from __future__ import annotations

import math
from typing import NamedTuple

from lathe_chatter.detection.speed_advice import Advice, advise, rule_of_thumb
from lathe_chatter.model import Machine

_ADVISED_AT = (0, 2, 4, 7, 10, 15, 20, 30)
"""Hops after the alarm, and after a change of speed that was no cure, at which a speed is
recommended, each time from a better estimate."""
_CLEAR_CONTACT = 0.15
"""Part of k_bc by which k may be off where the bearing carries throughout, or not at all."""

_VAGUE = 10.0
"""Standard error of the growth rate from which on nothing is recommended, 1/s."""


class Identified(NamedTuple):
    """What is known of a cut that chatters.

    Attributes:
        growth_rate: 1/s.
        growth_error: Its standard error, 1/s.
        frequency: Of the chatter, Hz.
        spindle_speed_rpm: rev/min.
        cutting_stiffness: C w, N/m; nan without a model.
        workpiece_stiffness: N/m; nan without a model.
    """

    growth_rate: float
    growth_error: float
    frequency: float
    spindle_speed_rpm: float
    cutting_stiffness: float
    workpiece_stiffness: float


class Adviser:
    """Recommends speeds while there is chatter, and keeps to the estimate that is best.

    Chatter that has grown so far that the tool leaves the cut grows no more, and C w looks less
    than it is: a speed chosen for it would chatter. So an estimate counts only if it is surer
    than those before, and its growth rate is not clearly below theirs.

    Args:
        machine: Tool, workpiece and bearing; None where nothing is known.
        speed_range: Slowest and fastest spindle speed that may be recommended, rev/min.

    Attributes:
        advice: The one that stands.
    """

    def __init__(self, machine: Machine | None, speed_range: tuple[float, float]) -> None:
        """Nothing chatters yet."""
        self._machine = machine
        self._speed_range = speed_range
        self.forget()

    def forget(self) -> None:
        """There is no chatter."""
        self.advice = Advice()
        self._error = math.inf
        self._surely_grew = -math.inf

    def is_asked(self, hops_after_alarm: int) -> bool:
        """Whether a speed is to be recommended now."""
        return hops_after_alarm in _ADVISED_AT

    def consider(self, known: Identified, hops_after_alarm: int, *, modelled: bool) -> None:
        """Recommend from an estimate, if it is better than those before.

        Args:
            known: The estimate.
            hops_after_alarm: At 0 there is nothing before.
            modelled: Whether C w was identified; else the rule 60 f_c / k has to do.
        """
        if hops_after_alarm == 0:
            self.forget()
        growth, error = known.growth_rate, known.growth_error
        if growth < -error or error > _VAGUE:
            return  # it dies down, or nobody knows
        if self._machine is None or not modelled:
            self.advice = rule_of_thumb(known.frequency, self._speed_range)
            return
        if not error < self._error or growth + error < self._surely_grew:
            return
        self._error = error
        self._surely_grew = max(self._surely_grew, growth - error)
        self.advice = advise(
            self._machine,
            known.cutting_stiffness,
            self._speed_range,
            known.spindle_speed_rpm,
            seated=_seated(self._machine, known.workpiece_stiffness),
        )


def _seated(machine: Machine, stiffness: float) -> bool | None:
    """Whether the bearing carries throughout, or not at all; None in between."""
    open_ = machine.workpiece_stiffness(seated=False)
    part = (stiffness - open_) / max(machine.bearing_stiffness, 1e-9 * open_)
    if abs(part) < _CLEAR_CONTACT:
        return False
    return True if abs(part - 1.0) < _CLEAR_CONTACT else None
