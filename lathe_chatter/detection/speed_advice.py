"""A better spindle speed for the cut that was identified, or a smaller depth."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lathe_chatter.array_types import Array
from lathe_chatter.model import Cut, Machine
from lathe_chatter.model.quantity_fields import limits_of
from lathe_chatter.stability import critical_depths, recommend_speeds, rightmost_roots

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
ANOTHER_SPEED = 0.01
"""Part by which a speed must differ from the one that was advised for to be another."""
_RULE_HOLDS = 0.3
"""Part of the speeds by the rule of thumb that are stable; benchmarks/detection prints it."""
_SOME_DEPTH = 1e-3
"""m, where C is not known."""
_AROUND, _TRIED = 0.15, 61
"""Part of a speed by which others around it are tried, and how many are."""
_WIDE, _AS_GOOD = 0.04, 0.8
"""Width that an ordinary spindle can keep to; part of the damping that the middle must have."""
_LOOKS, _LOOKED_AT = 3, 200
"""Times that the speed of the deepest cut is looked for, ever closer, and speeds of each."""
_KEPT = 0.7
"""Part of the damping, and of the width, of the best speed with which the one that was said before
is kept to."""
_HIDDEN = 'grown chatter hides part of the force'
_RULE_MOST = 3
"""Waves a turn up to which the rule of thumb is tried: of more, fewer were stable than it says."""


@dataclass(frozen=True)
class AdvisedSpeed:
    """A spindle speed to change to.

    Attributes:
        spindle_speed_rpm: rev/min.
        growth_rate: Predicted, the greater one of open and seated, 1/s; nan for a rule of thumb.
        width: Of the stable speeds around it, as a part of it; nan for a rule of thumb.
        probability: That it is stable, as the rule of thumb has shown; nan for a prediction.
    """

    spindle_speed_rpm: float
    growth_rate: float = math.nan
    width: float = math.nan
    probability: float = math.nan


@dataclass(frozen=True)
class Advice:
    """What to do about chatter.

    Attributes:
        speeds: Speeds to change to, the first one first; empty where none is stable or nothing
            is known.
        depth_factor: What the depth has to be multiplied by to be stable, where no speed helps;
            1 otherwise, nan where nothing is known.
        depth_speed_rpm: The speed that goes with the reduced depth, rev/min.
        found_at_rpm: The speed at which the cut chattered that it is for, rev/min.
        at_best: Whether C w may be more than was heard, and the stable cuts so much fewer.
    """

    speeds: tuple[AdvisedSpeed, ...] = ()
    depth_factor: float = math.nan
    depth_speed_rpm: float = math.nan
    found_at_rpm: float = math.nan
    at_best: bool = False

    def after(self, earlier: Advice, depth: float | None = None) -> str:
        """What the operator, who has heard the earlier one, has to hear; empty for nothing.

        After a change of speed that was no cure that is also that the advice stands.

        Args:
            earlier: What was said before.
            depth: As for `in_words`.
        """
        words = self.in_words(depth)
        if self.differs_from(earlier) or not words:
            return words
        if not self.speeds and not math.isfinite(self.depth_factor):
            return ''
        moved = abs(self.found_at_rpm / earlier.found_at_rpm - 1.0) > ANOTHER_SPEED
        return f'the advice stands: {words}' if moved else ''

    def differs_from(self, earlier: Advice) -> bool:
        """Whether it says something, and another thing than the earlier one."""
        if not self.speeds:
            known = math.isfinite(self.depth_factor)
            if not known:
                return bool(self.in_words() and not earlier.in_words())
            return bool(earlier.speeds) or not math.isfinite(earlier.depth_factor)
        if not earlier.speeds or earlier.at_best > self.at_best:
            return True
        ratio = self.speeds[0].spindle_speed_rpm / earlier.speeds[0].spindle_speed_rpm
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
                expected = f' (growth rate {best.growth_rate:.1f} 1/s'
                if math.isfinite(best.width):
                    # Where none of the speeds that are tried around it is stable: their step.
                    tolerance = 50.0 * best.width or 200.0 * _AROUND / (_TRIED - 1)
                    less = '' if best.width else 'less than '
                    expected += f', stable within {less}+-{tolerance:.1f} %'
                expected += f', at best: {_HIDDEN}' if self.at_best else ''
                expected += ')'
            if math.isfinite(best.probability):
                chance = f'stable in {10.0 * best.probability:.0f} of 10 cases'
                expected = f' (a rule of thumb without a machine, {chance})'
            return f'try {best.spindle_speed_rpm:.0f} rev/min{expected}'
        if not math.isfinite(self.depth_factor):
            return 'no stable speed is known' if math.isfinite(self.found_at_rpm) else ''
        reduced = f'{100.0 * self.depth_factor:.0f} %'
        if depth is not None:
            reduced = f'{1e3 * depth * self.depth_factor:.3f} mm'
        further = f', or further: {_HIDDEN}' if self.at_best else ''
        at = f'at {self.depth_speed_rpm:.0f} rev/min{further}'
        return f'no stable speed, reduce the depth to {reduced} {at}'


def advise(  # noqa: PLR0913 -- what is known of a cut
    machine: Machine,
    cutting_stiffness: float,
    speed_range: tuple[float, float],
    current_rpm: float,
    *,
    seated: bool | None = None,
    cutting_error: float = 0.0,
    advised_rpm: float = math.nan,
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
        cutting_error: Standard error of C w, N/m.
        advised_rpm: The speed that was recommended before, from an estimate that was less sure; it
            comes first unless another is clearly better. nan for none.
    """
    if not cutting_stiffness > 0.0:
        return Advice()
    coefficient = machine.cutting_coefficient
    if not cutting_stiffness < coefficient * limits_of(Cut, 'depth_of_cut').high:
        # No such depth: C was told wrong, or not at all, and is not needed for a speed.
        coefficient = cutting_stiffness / _SOME_DEPTH
        machine = replace(machine, cutting_coefficient=coefficient)
    depth = cutting_stiffness / coefficient
    low, high = speed_range
    near = max(low, current_rpm / _NEAR), min(high, current_rpm * _NEAR)
    both = (False, True) if machine.bearing_stiffness else (False,)
    regimes = (both,) if seated is None else (both, (seated,))
    found: list[tuple[float, AdvisedSpeed]] = []
    for contacts in regimes:
        cut = _KnownCut(machine, depth, contacts)
        for limits in (near, speed_range):
            if limits[0] < limits[1]:
                found = _stable_in(cut, limits, current_rpm)
                if any(ratio > _DAMPED for ratio, _ in found):
                    break
        if found:
            break
    if found:
        found.sort(key=lambda entry: -entry[0])
        damped = [entry for entry in found if entry[0] > _DAMPED]
        if damped:
            damped.sort(key=lambda e: abs(math.log(e[1].spindle_speed_rpm / current_rpm)))
            first = damped[0]
            found.remove(first)
            found.insert(0, first)
        speeds = [speed for _, speed in found]
        near_ones = [speed for _, speed in damped[:_MOST]] or speeds[:1]
        best = _wide_enough(cut, near_ones, speed_range)
        best = _kept(cut, advised_rpm, best, speed_range)
        return Advice(_apart([best, *speeds])[:_MOST], 1.0, current_rpm)
    contacts = both if seated is None else (seated,)
    cut = _KnownCut(machine, depth, contacts)
    return _less_depth(cut, speed_range, cutting_error / cutting_stiffness)


def _apart(speeds: list[AdvisedSpeed]) -> tuple[AdvisedSpeed, ...]:
    """Those that are not nearly the same as one before."""
    kept: list[AdvisedSpeed] = []
    for speed in speeds:
        rpm = speed.spindle_speed_rpm
        if all(abs(rpm / other.spindle_speed_rpm - 1.0) > _SAME for other in kept):
            kept.append(speed)
    return tuple(kept)


class _KnownCut(NamedTuple):
    """A cut for which a speed is looked for, in each of some contacts (seated or not)."""

    machine: Machine
    depth: float
    contacts: tuple[bool, ...]

    def roots(self, speeds: Array) -> NDArray[np.complex128]:
        """The rightmost roots at speeds (n,), rev/min, in each contact (contacts, n)."""
        return np.array(
            [
                rightmost_roots(self.machine, speeds, self.depth, seated=seated)
                for seated in self.contacts
            ]
        )

    def growth_rate(self, rpm: float) -> float:
        """The greatest of them, 1/s."""
        return float(self.roots(np.array([rpm])).real.max())


def _wide_enough(
    cut: _KnownCut, near_ones: list[AdvisedSpeed], speed_range: tuple[float, float]
) -> AdvisedSpeed:
    """The middle of the first lobe that an ordinary spindle can keep to, else of the widest."""
    best = _centred(cut, near_ones[0], speed_range)
    for speed in near_ones[1:]:
        if best.width >= _WIDE:
            break
        other = _centred(cut, speed, speed_range)
        best = max(best, other, key=lambda each: each.width)
    return best


def _kept(
    cut: _KnownCut, advised_rpm: float, best: AdvisedSpeed, speed_range: tuple[float, float]
) -> AdvisedSpeed:
    """The middle of the lobe that was recommended before, unless the best is clearly better."""
    if not speed_range[0] <= advised_rpm <= speed_range[1]:
        return best
    before = AdvisedSpeed(advised_rpm, cut.growth_rate(advised_rpm))
    if not before.growth_rate < 0.0:
        return best
    before = _centred(cut, before, speed_range)
    damped = before.growth_rate < _KEPT * best.growth_rate
    return before if damped and before.width > _KEPT * min(best.width, _WIDE) else best


def _centred(
    cut: _KnownCut, speed: AdvisedSpeed, speed_range: tuple[float, float]
) -> AdvisedSpeed:
    """The middle of the stable speeds around a stable one, and how wide they are."""
    rpm = speed.spindle_speed_rpm
    speeds = np.asarray(rpm * np.linspace(1.0 - _AROUND, 1.0 + _AROUND, _TRIED), np.float64)
    stable = cut.roots(speeds).real.max(axis=0) < 0.0
    stable &= (speeds >= speed_range[0]) & (speeds <= speed_range[1])
    low = high = _TRIED // 2
    while low > 0 and stable[low - 1]:
        low -= 1
    while high < _TRIED - 1 and stable[high + 1]:
        high += 1
    middle = float(0.5 * (speeds[low] + speeds[high]))
    width = float(speeds[high] - speeds[low]) / middle
    growth = cut.growth_rate(middle)
    if not growth < speed.growth_rate * _AS_GOOD:  # an edge of another lobe, or hardly damped
        return replace(speed, width=width)
    return AdvisedSpeed(middle, growth, width)


def _stable_in(
    cut: _KnownCut, limits: tuple[float, float], current_rpm: float
) -> list[tuple[float, AdvisedSpeed]]:
    """The lowest of the damping ratios in the contacts, and its speed."""
    speeds: list[float] = []
    for seated in cut.contacts:
        advice = recommend_speeds(
            cut.machine,
            cut.depth,
            seated=seated,
            low_rpm=limits[0],
            high_rpm=limits[1],
            current_rpm=min(max(current_rpm, limits[0]), limits[1]),
            count=_CANDIDATES,
        )
        speeds += [speed.spindle_speed_rpm for speed in advice.speeds]
    if not speeds:
        return []
    roots = cut.roots(np.array(speeds))
    ratios, growths = (-roots.real / roots.imag).min(axis=0), roots.real.max(axis=0)
    return [
        (ratio, AdvisedSpeed(rpm, growth))
        for ratio, rpm, growth in zip(ratios.tolist(), speeds, growths.tolist(), strict=True)
        if ratio > 0.0
    ]


def _less_depth(cut: _KnownCut, speed_range: tuple[float, float], error: float) -> Advice:
    """The deepest cut that some speed keeps stable, in every contact.

    Args:
        cut: For which no speed is stable.
        speed_range: Lowest and highest speed allowed, rev/min.
        error: Standard error of C w, as a part of it.
    """
    low, high = speed_range
    for _ in range(_LOOKS):
        speeds = np.geomspace(low, high, _LOOKED_AT)
        limits = np.min(
            [critical_depths(cut.machine, speeds, seated=seated) for seated in cut.contacts],
            axis=0,
        )
        best = int(np.argmax(limits))
        low, high = speeds[max(best - 1, 0)], speeds[min(best + 1, _LOOKED_AT - 1)]
    share = _SHARE / (1.0 + 2.0 * min(error, 1.0))
    return Advice((), share * min(float(limits[best]) / cut.depth, 1.0), float(speeds[best]))


def rule_of_thumb(frequency: float, speed_range: tuple[float, float]) -> Advice:
    """60 f_c / k: a whole number k of vibrations a turn, the fewest that the range allows.

    Args:
        frequency: Of the chatter, Hz.
        speed_range: Lowest and highest speed allowed, rev/min.

    Returns:
        No speed where the spindle is too slow for so few vibrations a turn.
    """
    speeds = [60.0 * frequency / waves for waves in range(1, _RULE_MOST + 1)]
    inside = [speed for speed in speeds if speed_range[0] <= speed <= speed_range[1]]
    return Advice(tuple(AdvisedSpeed(speed, probability=_RULE_HOLDS) for speed in inside))
