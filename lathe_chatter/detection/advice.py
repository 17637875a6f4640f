"""A better spindle speed for the cut that was identified."""

from __future__ import annotations

import math

from lathe_chatter.model import Machine
from lathe_chatter.stability import recommend_speeds, rightmost_root

_CANDIDATES = 8
_DAMPED = 0.01
"""Damping ratio of the slowest vibration that is good enough to stay near the present speed."""
_NEAR = 2.0
"""A speed within this factor of the present one is looked for first."""


def better_speed(
    machine: Machine,
    cutting_stiffness: float,
    speed_range: tuple[float, float],
    current_rpm: float,
) -> float:
    """A speed at which the cut is well damped whether or not the bearing carries.

    A cut that chatters across a clearance is open and seated in turn, so a speed has to suit
    both. Only C w enters, so that C need not be known.

    Args:
        machine: Tool, workpiece and bearing as they are known.
        cutting_stiffness: C w as identified, N/m.
        speed_range: Lowest and highest speed allowed, rev/min.
        current_rpm: The speed now, rev/min.

    Returns:
        The nearest speed that is well damped, else the best damped, rev/min; nan where no
        speed is stable in both.
    """
    near = max(speed_range[0], current_rpm / _NEAR), min(speed_range[1], current_rpm * _NEAR)
    for low, high in (near, speed_range):
        if low < high:
            found = _stable_in_both(machine, cutting_stiffness, (low, high), current_rpm)
            damped = [speed for speed, ratio in found if ratio > _DAMPED]
            if damped:
                return min(damped, key=lambda speed: abs(math.log(speed / current_rpm)))
            if found:
                return max(found, key=lambda entry: entry[1])[0]
    return math.nan


def _stable_in_both(
    machine: Machine, cutting_stiffness: float, limits: tuple[float, float], current_rpm: float
) -> list[tuple[float, float]]:
    """Speeds, rev/min, with the lower of their two damping ratios."""
    depth = cutting_stiffness / machine.cutting_coefficient
    found = []
    for seated in (False, True):
        advice = recommend_speeds(
            machine,
            depth,
            seated=seated,
            low_rpm=limits[0],
            high_rpm=limits[1],
            current_rpm=current_rpm,
            count=_CANDIDATES,
        )
        for speed in advice.speeds:
            other = rightmost_root(machine, speed.spindle_speed_rpm, depth, seated=not seated)
            ratio = min(-speed.growth_rate / speed.angular_frequency, -other.real / other.imag)
            if ratio > 0.0:
                found.append((speed.spindle_speed_rpm, ratio))
    return found


def rule_of_thumb(frequency: float, speed_range: tuple[float, float]) -> float:
    """60 f_c / k: a whole number k of vibrations a turn, the fewest that the range allows."""
    waves = max(1, math.ceil(60.0 * frequency / speed_range[1]))
    speed = 60.0 * frequency / waves
    return speed if speed >= speed_range[0] else math.nan
