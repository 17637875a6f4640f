"""Which spindle speed to change to, or which depth, so that a cut is stable.

At one depth the roots cross the imaginary axis at no more than four frequencies, each at a
series of delays tau = (phase + 2 pi j) / omega, and every crossing of one frequency goes the
same way whatever j is (its root tendency). A machine without delay is stable, so counting the
crossings on the way from tau = 0 gives every stable interval of speed exactly, without a scan.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lathe_chatter.arrays import Array
from lathe_chatter.errors import ParameterError
from lathe_chatter.model import Machine
from lathe_chatter.model.quantities import Quantity
from lathe_chatter.stability.characteristic import CharacteristicEquation, Complex, checked
from lathe_chatter.stability.lobes import (
    critical_depth,
    crossing_frequencies,
    damped_equation,
    echo_phase,
)
from lathe_chatter.stability.roots import rightmost_roots

_SAMPLES = 9
_ZOOMS = 2
_INTERVALS = 8
"""Intervals looked into, widest first: those of the highest lobes are slivers."""
_HALVINGS = 14
_COUNT = Quantity('number of recommended speeds', low=1.0, high=1000.0)
_MARGIN = Quantity('relative distance from an edge of stability', high=0.5)


@dataclass(frozen=True)
class SpeedAdvice:
    """A stable spindle speed.

    Attributes:
        spindle_speed_rpm: rev/min.
        growth_rate: Real part of the rightmost root there, negative, 1/s.
        angular_frequency: Of the slowest decaying vibration, rad/s.
        low_rpm: Where the stable interval around the speed begins, rev/min.
        high_rpm: Where it ends, rev/min.
    """

    spindle_speed_rpm: float
    growth_rate: float
    angular_frequency: float
    low_rpm: float
    high_rpm: float


@dataclass(frozen=True)
class CuttingAdvice:
    """What to do about chatter.

    Attributes:
        speeds: Stable speeds at the present depth, the best damped first; empty if none is.
        stable_depth: A depth, not above the present one, that is stable at `stable_speed_rpm`:
            the present depth where `speeds` is not empty, m.
        stable_speed_rpm: The speed that goes with it, rev/min.
        depth_at_current_speed: The critical depth at the present speed, m; None where no
            present speed was given.
    """

    speeds: tuple[SpeedAdvice, ...]
    stable_depth: float
    stable_speed_rpm: float
    depth_at_current_speed: float | None


def recommend_speeds(  # noqa: PLR0913 -- a cut, a range and how careful to be
    machine: Machine,
    depth_of_cut: float,
    *,
    seated: bool,
    low_rpm: float = 1000.0,
    high_rpm: float = 12000.0,
    current_rpm: float | None = None,
    count: int = 3,
    margin: float = 0.02,
) -> CuttingAdvice:
    """The best damped spindle speeds at a depth, one for each stable interval of speed.

    Args:
        machine: Tool, workpiece, bearing and material, given or identified.
        depth_of_cut: w, m.
        seated: Whether the workpiece rests on its bearing.
        low_rpm: Slowest speed to consider, rev/min.
        high_rpm: Fastest speed to consider, rev/min.
        current_rpm: The present speed, for `CuttingAdvice.depth_at_current_speed`; the stable
            interval nearest to it is always considered.
        count: How many speeds at most.
        margin: How far a speed stays from the edges of its interval, as a fraction of the
            speed; half of the interval where it is too narrow for that.

    Returns:
        The speeds, or the depth to fall back to where there is none.

    Raises:
        ParameterError: If an argument is not allowed or the range of speeds is empty.
    """
    at_most = int(_COUNT.check('count', count))
    apart = _MARGIN.check('margin', margin)
    depth = float(checked('depth_of_cut', depth_of_cut))
    present = None
    if current_rpm is not None:
        present = float(checked('spindle_speed_rpm', current_rpm))
    intervals = stable_speed_intervals(
        machine, depth, seated=seated, low_rpm=low_rpm, high_rpm=high_rpm
    )
    here = None if present is None else critical_depth(machine, present, seated=seated)
    if intervals.size:
        considered = _worth_a_look(intervals, present)
        speeds = _best_speeds(machine, depth, considered, seated=seated, margin=apart)
        speeds = sorted(speeds, key=lambda advice: advice.growth_rate)[:at_most]
        return CuttingAdvice(tuple(speeds), depth, speeds[0].spindle_speed_rpm, here)
    shallower, rpm = _deepest_stable(machine, depth, seated=seated, low=low_rpm, high=high_rpm)
    return CuttingAdvice((), shallower, rpm, here)


def stable_speed_intervals(
    machine: Machine, depth_of_cut: float, *, seated: bool, low_rpm: float, high_rpm: float
) -> Array:
    """Every interval of spindle speed in which a cut of this depth is stable.

    Args:
        machine: Tool, workpiece, bearing and material.
        depth_of_cut: w, m.
        seated: Whether the workpiece rests on its bearing.
        low_rpm: Where to begin, rev/min.
        high_rpm: Where to end, rev/min.

    Returns:
        Lower and upper ends (n, 2), rev/min, rising.

    Raises:
        ParameterError: If an argument is not allowed or the range of speeds is empty.
    """
    slow = float(checked('spindle_speed_rpm', low_rpm))
    fast = float(checked('spindle_speed_rpm', high_rpm))
    if not slow < fast:
        raise ParameterError(
            'high_rpm', high_rpm, 'rev/min', f'above low_rpm, {low_rpm:g} rev/min'
        )
    equation = damped_equation(machine, seated=seated)
    stiffness = machine.cutting_stiffness(float(checked('depth_of_cut', depth_of_cut)))
    return _stable_intervals(equation, stiffness, slow, fast)


def _stable_intervals(
    equation: CharacteristicEquation, stiffness: float, slow: float, fast: float
) -> Array:
    """`stable_speed_intervals` of an equation."""
    longest = 60.0 / slow
    delays, changes = [np.zeros(1)], [np.zeros(1, np.int64)]
    if stiffness > 0.0:
        frequency = crossing_frequencies(equation, stiffness)
        phase = echo_phase(equation.receptance(frequency))
        outward = _tendency(equation, stiffness, frequency)
        for omega, first, way in zip(frequency, phase, outward, strict=True):
            series = np.arange(first, omega * longest, 2.0 * np.pi) / omega
            delays.append(series)
            changes.append(np.full(series.size, way))
    delay = np.concatenate(delays)
    order = np.argsort(delay, kind='stable')
    unstable = np.cumsum(np.concatenate(changes)[order])
    shortest = np.append(delay[order], longest)
    stable = np.flatnonzero(unstable == 0)
    ends = np.array([shortest[stable + 1], shortest[stable]]).T
    with np.errstate(divide='ignore'):
        speeds = np.clip(60.0 / ends, slow, fast)[::-1]
    intervals: Array = speeds[speeds[:, 1] > speeds[:, 0]]
    return intervals


def _tendency(equation: CharacteristicEquation, stiffness: float, frequency: Array) -> Array:
    """+1 where a longer delay moves the root at i omega to the right, -1 to the left.

    From 1 + C w G (1 - e) = 0 with e = e^(-s tau):  1 / (ds/dtau) = -G' (1 - e) / (G s e) - tau/s,
    whose real part does not depend on tau at s = i omega.
    """
    receptance = equation.receptance(frequency)
    echo = 1.0 + 1.0 / (stiffness * receptance)
    s = 1j * frequency
    inverse = -equation.receptance_log_slope(s) * (1.0 - echo) / (s * echo)
    return np.where(inverse.real > 0.0, 1, -1)


def _worth_a_look(intervals: Array, present: float | None) -> Array:
    """The relatively widest intervals, and the one nearest to the present speed."""
    width = np.log(intervals[:, 1] / intervals[:, 0])
    chosen = set(np.argsort(-width)[:_INTERVALS].tolist())
    if present is not None:
        outside = np.maximum(intervals[:, 0] - present, present - intervals[:, 1])
        chosen.add(int(np.argmin(outside)))
    return intervals[sorted(chosen)]


def _best_speeds(
    machine: Machine, depth: float, intervals: Array, *, seated: bool, margin: float
) -> list[SpeedAdvice]:
    """The best damped speed of each interval (n, 2), by a scan and two finer ones."""
    low, high = intervals[:, 0], intervals[:, 1]
    # A range limit is no edge of stability, but to stay as far from it costs little.
    inset = np.minimum(margin * np.sqrt(low * high), 0.25 * (high - low))
    shortest, longest = 60.0 / (high - inset), 60.0 / (low + inset)
    # One piece for each lobe that an interval spans: each may hold a best speed.
    equation = CharacteristicEquation.of(machine, seated=seated)
    turn = 2.0 * np.pi / np.abs(equation.delay_free_roots(np.zeros(1))).max()
    pieces = np.ceil((longest - shortest) / turn).astype(np.int64)
    owner = np.repeat(np.arange(pieces.size), pieces)
    place = np.arange(owner.size) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    length = ((longest - shortest) / pieces)[owner]
    start = shortest[owner] + place * length
    scan = _scan(machine, depth, start, start + length, seated=seated)
    order = np.argsort(-scan.roots.real, kind='stable')
    best = np.zeros(pieces.size, np.int64)
    best[owner[order]] = order
    scan = _Scan(scan.delays[best], scan.roots[best], scan.shorter[best], scan.longer[best])
    for _ in range(_ZOOMS):
        scan = _scan(machine, depth, scan.shorter, scan.longer, seated=seated)
    speeds = 60.0 / scan.delays
    roots = rightmost_roots(machine, speeds, depth, seated=seated)
    return [
        SpeedAdvice(rpm, root.real, root.imag, slow, fast)
        for rpm, root, slow, fast in zip(
            speeds.tolist(), roots.tolist(), low.tolist(), high.tolist(), strict=True
        )
    ]


class _Scan(NamedTuple):
    """The best of some evenly spaced delays (n,), its root, and its neighbours."""

    delays: Array
    roots: Complex
    shorter: Array
    longer: Array


def _scan(machine: Machine, depth: float, start: Array, end: Array, *, seated: bool) -> _Scan:
    """Look for the best damped delay in each of n intervals."""
    delay = start[:, None] + (end - start)[:, None] * np.linspace(0.0, 1.0, _SAMPLES)
    roots = rightmost_roots(machine, 60.0 / delay, depth, seated=seated, proven=False)
    best = np.argmin(roots.real, axis=1)
    rows = np.arange(best.size)
    return _Scan(
        delay[rows, best],
        roots[rows, best],
        delay[rows, np.maximum(best - 1, 0)],
        delay[rows, np.minimum(best + 1, _SAMPLES - 1)],
    )


def _deepest_stable(
    machine: Machine, depth: float, *, seated: bool, low: float, high: float
) -> tuple[float, float]:
    """The deepest cut, to 1e-4 of it, below an unstable depth that some speed keeps stable."""
    equation = damped_equation(machine, seated=seated)
    stable, unstable, speed = 0.0, depth, low
    for _ in range(_HALVINGS):
        middle = 0.5 * (stable + unstable)
        found = _stable_intervals(equation, machine.cutting_stiffness(middle), low, high)
        if found.size:
            widest = found[np.argmax(found[:, 1] / found[:, 0])]
            stable, speed = middle, float(np.sqrt(widest[0] * widest[1]))
        else:
            unstable = middle
    return stable, speed
