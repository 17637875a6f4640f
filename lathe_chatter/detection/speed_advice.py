"""A better spindle speed for the cut that was identified, or a smaller depth."""

from __future__ import annotations

import math
from dataclasses import dataclass

from lathe_chatter.model import Cut, Machine
from lathe_chatter.model.quantities import limits_of
from lathe_chatter.stability import recommend_speeds, rightmost_root

_CANDIDATES = 8
_DAMPED = 0.01
"""Damping ratio of the slowest vibration that is good enough to stay near the present speed."""
_NEAR = 2.0
"""A speed within this factor of the present one is looked for first."""
_SHARE = 0.98
"""Of the stable depth that is recommended, against what was identified a little wrong."""
_MOST = 3
_SAME = 0.02
"""Part by which speeds may differ that come from one cut, identified twice."""
_RULE_LEAST, _RULE_MOST = 1, 3
"""Waves a turn that the rule of thumb tries: of more, fewer than half were stable."""


@dataclass(frozen=True)
class AdvisedSpeed:
    """A spindle speed to change to.

    Attributes:
        spindle_speed_rpm: rev/min.
        growth_rate: Predicted, the greater one of open and seated, 1/s; nan for a rule of thumb.
    """

    spindle_speed_rpm: float
    growth_rate: float = math.nan


@dataclass(frozen=True)
class Advice:
    """What to do about chatter.

    Attributes:
        speeds: Speeds to change to, the first one first; empty where none is stable or nothing
            is known.
        depth_factor: What the depth has to be multiplied by to be stable, where no speed helps;
            1 otherwise, nan where nothing is known.
        depth_speed_rpm: The speed that goes with the reduced depth, rev/min.
    """

    speeds: tuple[AdvisedSpeed, ...] = ()
    depth_factor: float = math.nan
    depth_speed_rpm: float = math.nan

    def is_news_after(self, told: Advice) -> bool:
        """Whether it says something, and another thing than what was told before."""
        if not self.speeds:
            known = math.isfinite(self.depth_factor)
            return known and (bool(told.speeds) or not math.isfinite(told.depth_factor))
        if not told.speeds:
            return True
        ratio = self.speeds[0].spindle_speed_rpm / told.speeds[0].spindle_speed_rpm
        return abs(ratio - 1.0) > _SAME

    def in_words(self, depth: float | None = None) -> str:
        """A sentence for the operator; empty where nothing is known.

        Args:
            depth: The present depth of cut where it is known, m.
        """
        if self.speeds:
            best = self.speeds[0]
            expected = ''
            if math.isfinite(best.growth_rate):
                expected = f' (growth rate {best.growth_rate:.1f} 1/s)'
            return f'try {best.spindle_speed_rpm:.0f} rev/min{expected}'
        if not math.isfinite(self.depth_factor):
            return ''
        reduced = f'{100.0 * self.depth_factor:.0f} %'
        if depth is not None:
            reduced = f'{1e3 * depth * self.depth_factor:.3f} mm'
        return (
            f'no stable speed, reduce the depth to {reduced} at {self.depth_speed_rpm:.0f} rev/min'
        )


def advise(
    machine: Machine,
    cutting_stiffness: float,
    speed_range: tuple[float, float],
    current_rpm: float,
    *,
    seated: bool | None = None,
) -> Advice:
    """Speeds at which the cut is well damped whether or not the bearing carries.

    A cut that chatters across a clearance is open and seated in turn, so a speed should suit
    both; where none does, one that suits the present contact. Only C w enters, so that C need
    not be known. A well damped speed near the present one comes first, then the best damped.

    Args:
        machine: Tool, workpiece and bearing as they are known.
        cutting_stiffness: C w as identified, N/m.
        speed_range: Lowest and highest speed allowed, rev/min.
        current_rpm: The speed now, rev/min.
        seated: Whether the bearing carries throughout, or not at all; None where it does now
            and then, or nobody knows.
    """
    if not (cutting_stiffness > 0.0 and machine.cutting_coefficient > 0.0):
        return Advice()
    depth = cutting_stiffness / machine.cutting_coefficient
    if depth > limits_of(Cut, 'depth_of_cut').high:
        return Advice()  # C, or what was identified, is not to be believed
    low, high = speed_range
    near = max(low, current_rpm / _NEAR), min(high, current_rpm * _NEAR)
    both = (False, True)
    regimes = (both,) if seated is None else (both, (seated,))
    found: list[tuple[float, AdvisedSpeed]] = []
    for contacts in regimes:
        for limits in (near, speed_range):
            if limits[0] < limits[1]:
                found = _stable_in(machine, depth, limits, current_rpm, contacts)
                if any(ratio > _DAMPED for ratio, _ in found):
                    break
        if found:
            break
    if found:
        found.sort(key=lambda entry: -entry[0])
        damped = [entry for entry in found if entry[0] > _DAMPED]
        if damped:
            first = min(damped, key=lambda e: abs(math.log(e[1].spindle_speed_rpm / current_rpm)))
            found.remove(first)
            found.insert(0, first)
        return Advice(tuple(speed for _, speed in found[:_MOST]), 1.0, current_rpm)
    return _less_depth(machine, depth, speed_range, both if seated is None else (seated,))


def _stable_in(
    machine: Machine,
    depth: float,
    limits: tuple[float, float],
    current_rpm: float,
    contacts: tuple[bool, ...],
) -> list[tuple[float, AdvisedSpeed]]:
    """The lowest of the damping ratios in some contacts (seated or not), and its speed."""
    found = []
    for seated in contacts:
        advice = recommend_speeds(
            machine,
            depth,
            seated=seated,
            low_rpm=limits[0],
            high_rpm=limits[1],
            current_rpm=min(max(current_rpm, limits[0]), limits[1]),
            count=_CANDIDATES,
        )
        for speed in advice.speeds:
            rpm = speed.spindle_speed_rpm
            roots = [rightmost_root(machine, rpm, depth, seated=contact) for contact in contacts]
            ratio = min(-root.real / root.imag for root in roots)
            if ratio > 0.0:
                found.append((ratio, AdvisedSpeed(rpm, max(root.real for root in roots))))
    return found


def _less_depth(
    machine: Machine, depth: float, speed_range: tuple[float, float], contacts: tuple[bool, ...]
) -> Advice:
    """The deepest cut that some speed keeps stable, in every contact."""
    shallower, rpm = depth, math.nan
    for seated in contacts:
        advice = recommend_speeds(
            machine,
            shallower,
            seated=seated,
            low_rpm=speed_range[0],
            high_rpm=speed_range[1],
            count=1,
        )
        shallower, rpm = advice.stable_depth, advice.stable_speed_rpm
    return Advice((), _SHARE * shallower / depth, rpm)


def rule_of_thumb(frequency: float, speed_range: tuple[float, float]) -> Advice:
    """60 f_c / k: a whole number k of vibrations a turn, the fewest that the range allows.

    Args:
        frequency: Of the chatter, Hz.
        speed_range: Lowest and highest speed allowed, rev/min.
    """
    if not frequency > 0.0:
        return Advice()
    fewest = max(_RULE_LEAST, math.ceil(60.0 * frequency / speed_range[1]))
    speeds = [60.0 * frequency / waves for waves in range(fewest, fewest + _RULE_MOST)]
    return Advice(tuple(AdvisedSpeed(speed) for speed in speeds if speed >= speed_range[0]))
