"""Stability lobes in closed form: where a root stands on the imaginary axis.

At the boundary s = i omega, so with the receptance G = G_t + G_wp of tool and workpiece

    C w = -1 / (2 Re G(i omega)),    omega tau = 2 pi j + 3 pi + 2 arg G(i omega),

with lobe number j = 0, 1, ... and -pi < arg G < -pi/2: every chatter frequency with Re G < 0
gives one depth and, for each lobe, one spindle speed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lathe_chatter.arrays import Array, Integers
from lathe_chatter.model import Machine
from lathe_chatter.model.quantities import Quantity
from lathe_chatter.stability.characteristic import CharacteristicEquation, Complex, checked

_PHASE_STEP = 0.2
"""Largest change of each part of the phase between two points of a frequency grid, rad."""
_LEAST_DAMPING = 1e-9
"""What a mode without damping is taken to have where a limit is computed."""
_REFINEMENTS = 100
_BATCH = 32
_LOBES = Quantity('number of lobes', low=1.0, high=1e6)
_POINTS = Quantity('points of a lobe', low=2.0, high=1e7)
_DEPTH_LIMIT = Quantity('largest depth of the boundary', 'm', high=1e3, exclusive=True)


@dataclass(frozen=True)
class LobeBoundary:
    """Points of the stability boundary, one row for each lobe.

    Attributes:
        spindle_speed_rpm: rev/min (lobes, points).
        depth_of_cut: Critical depth w, m (lobes, points); one row repeated without a copy.
        lobe: Lobe number j, 0 at the highest speeds (lobes, points).
        angular_frequency: Of the chatter, rad/s (lobes, points).
    """

    spindle_speed_rpm: Array
    depth_of_cut: Array
    lobe: Integers
    angular_frequency: Array


def lobe_boundary(
    machine: Machine,
    *,
    seated: bool,
    depth_limit: float = 0.005,
    lobes: int = 20,
    points: int = 500,
) -> LobeBoundary:
    """The first `lobes` lobes up to a depth, dense where the receptance turns fast.

    Args:
        machine: Tool, workpiece, bearing and material.
        seated: Whether the workpiece rests on its bearing.
        depth_limit: Points above this depth are left out, m.
        lobes: How many, from j = 0.
        points: Frequencies, the same for every lobe.

    Returns:
        The boundary; without points where every depth up to the limit is stable.

    Raises:
        ParameterError: If an argument is not allowed.
    """
    limit = _DEPTH_LIMIT.check('depth_limit', depth_limit)
    count = int(_LOBES.check('lobes', lobes))
    wanted = int(_POINTS.check('points', points))
    equation = damped_equation(machine, seated=seated)
    crossings = crossing_frequencies(equation, machine.cutting_stiffness(limit))
    bands = crossings.reshape(-1, 2) if crossings.size % 2 == 0 else np.zeros((0, 2))
    share = wanted // max(len(bands), 1)
    frequency = np.concatenate(
        [np.zeros(0), *(_dense_where_steep(equation, low, high, share) for low, high in bands)]
    )
    receptance = equation.receptance(frequency)
    depth = -0.5 / (machine.cutting_coefficient * receptance.real) if frequency.size else frequency
    number = np.arange(count)
    phase = echo_phase(receptance) + 2.0 * np.pi * number[:, None]
    shape = phase.shape
    np.divide(60.0 * frequency, phase, out=phase)
    return LobeBoundary(
        phase,
        np.broadcast_to(depth, shape),
        np.broadcast_to(number[:, None], shape),
        np.broadcast_to(frequency, shape),
    )


def critical_depth(machine: Machine, spindle_speed_rpm: float, *, seated: bool) -> float:
    """The depth of cut from which on chatter grows at this spindle speed.

    Args:
        machine: Tool, workpiece, bearing and material.
        spindle_speed_rpm: Spindle speed, rev/min.
        seated: Whether the workpiece rests on its bearing.

    Returns:
        The smallest w at which a root reaches the imaginary axis, m; infinite for a material
        that needs no force, next to 0 where any cut excites a mode without damping.

    Raises:
        ParameterError: If the speed is not allowed.
    """
    return float(critical_depths(machine, spindle_speed_rpm, seated=seated))


def critical_depths(machine: Machine, spindle_speed_rpm: ArrayLike, *, seated: bool) -> Array:
    """`critical_depth` at spindle speeds of any shape.

    Every frequency at which the phase condition holds is bracketed on a grid fine enough to
    follow each pole, each zero and the delay; the one with the smallest depth counts.
    """
    speeds = checked('spindle_speed_rpm', spindle_speed_rpm)
    delay = 60.0 / speeds.ravel()
    depth = np.full(delay.size, np.inf)
    if machine.cutting_coefficient > 0.0:
        equation = damped_equation(machine, seated=seated)
        order = np.argsort(delay)
        # Neighbours share a grid: it is as fine as the longest delay among them asks for.
        for batch in np.split(order, np.arange(_BATCH, delay.size, _BATCH)):
            stiffness = _critical_stiffness(equation, delay[batch])
            depth[batch] = stiffness / machine.cutting_coefficient
    return depth.reshape(speeds.shape)


def damped_equation(machine: Machine, *, seated: bool) -> CharacteristicEquation:
    """The equation for a search along the imaginary axis, on which no pole may lie."""
    return CharacteristicEquation.of(machine, seated=seated, least_damping=_LEAST_DAMPING)


def crossing_frequencies(equation: CharacteristicEquation, cutting_stiffness: float) -> Array:
    """The frequencies, rising, at which 2 C w Re G(i omega) = -1: the boundary at one depth.

    Args:
        equation: Machine and contact regime, with some damping.
        cutting_stiffness: C w, N/m.

    Returns:
        Angular frequencies, rad/s (at most 4,).
    """

    def excess(omega: Array) -> tuple[Any, Any]:
        receptance = equation.receptance(omega)
        slope = 1j * receptance * equation.receptance_log_slope(1j * omega)
        return (
            1.0 + 2.0 * cutting_stiffness * receptance.real,
            2.0 * cutting_stiffness * slope.real,
        )

    # Far above both modes G is that of a free mass, -1 / (mu omega^2): the last crossing is at
    # sqrt(2) times the frequency that C w alone would give.
    free = np.abs(equation.delay_free_roots(np.array([0.0, cutting_stiffness])))
    top = 4.0 * float(free.max())
    near = _near_poles_and_zeros(equation, 0.0, top)
    grid = np.unique(np.concatenate((near, np.geomspace(1e-2 * float(free.min()), top, 100))))
    negative = excess(grid)[0] < 0.0
    cell = np.flatnonzero(negative[1:] != negative[:-1])
    return _solve(excess, grid[cell], grid[cell + 1])


def echo_phase(receptance: Complex) -> Array:
    """The phase omega tau, 0 to 2 pi, by which the surface lags: 3 pi + 2 arg G."""
    lag: Array = 3.0 * np.pi - 2.0 * np.abs(np.angle(receptance))
    return lag


def _critical_stiffness(equation: CharacteristicEquation, delay: Array) -> Array:
    """The smallest C w with a root on the imaginary axis, at delays (n,)."""
    frequency = _frequency_grid(equation, float(delay.max()), float(delay.min()))
    receptance = equation.receptance(frequency)
    turns = (np.outer(delay, frequency) - echo_phase(receptance)) / (2.0 * np.pi)
    lobe = np.floor(turns)
    row, column = np.nonzero(lobe[:, 1:] != lobe[:, :-1])
    possible = np.minimum(receptance.real[column], receptance.real[column + 1]) < 0.0
    row, column = row[possible], column[possible]
    wanted = np.maximum(lobe[row, column], lobe[row, column + 1])
    crossing = delay[row]

    def excess(omega: Array) -> tuple[Any, Any]:
        phase = omega * crossing - echo_phase(equation.receptance(omega))
        slope = crossing - 2.0 * equation.receptance_log_slope(1j * omega).real
        return phase / (2.0 * np.pi) - wanted, slope / (2.0 * np.pi)

    omega = _solve(excess, frequency[column], frequency[column + 1])
    real = equation.receptance(omega).real
    stiffness = np.full(delay.size, np.inf)
    np.minimum.at(stiffness, row[real < 0.0], -0.5 / real[real < 0.0])
    return stiffness


def _solve(function: Callable[[Array], tuple[Any, Any]], low: Array, high: Array) -> Array:
    """The root between low and high (n,) of a function that gives its values and slopes.

    Newton's method, kept inside brackets that every iteration shortens.
    """
    rising = function(high)[0] >= 0.0
    omega = 0.5 * (low + high)
    for _ in range(_REFINEMENTS):
        value, slope = function(omega)
        above = (value >= 0.0) == rising
        low, high = np.where(above, low, omega), np.where(above, omega, high)
        with np.errstate(divide='ignore', invalid='ignore'):
            step = omega - value / slope
        following = np.where((step >= low) & (step <= high), step, 0.5 * (low + high))
        settled = np.abs(following - omega) <= 1e-15 * omega
        omega = following
        if settled.all():
            break
    return omega


def _poles_and_zeros(equation: CharacteristicEquation) -> tuple[Any, Any]:
    """Heights and half-widths, rad/s, of everything that turns the phase of G."""
    free = equation.delay_free_roots(np.zeros(1))[0]
    points = np.concatenate((free, np.roots(equation.flexible)))
    return np.abs(points.imag), np.maximum(np.abs(points.real), 1e-9 * np.abs(points))


def _near_poles_and_zeros(equation: CharacteristicEquation, low: float, high: float) -> Array:
    """Frequencies low..high between which no pole or zero turns the phase by more than a step."""
    height, width = _poles_and_zeros(equation)
    angle = np.arange(-0.5 * np.pi + _PHASE_STEP / 2.0, 0.5 * np.pi, _PHASE_STEP)
    near = (height[:, None] + width[:, None] * np.tan(angle)).ravel()
    inside: Array = near[(near > low) & (near < high)]
    return inside


def _frequency_grid(equation: CharacteristicEquation, longest: float, shortest: float) -> Array:
    """Frequencies on which neither omega tau nor the phase of a pole or zero steps far.

    The grid ends past the last minimum of Re G, omega^2 = omega_n^2 (1 + 2 zeta), and two more
    turns: what lies beyond is deeper.
    """
    free = equation.delay_free_roots(np.zeros(1))
    top = 2.0 * float(np.abs(free).max()) + 4.0 * np.pi / shortest
    even = np.linspace(0.0, top, math.ceil(top * longest / _PHASE_STEP) + 2)[1:]
    return np.unique(np.concatenate((even, _near_poles_and_zeros(equation, 0.0, top))))


def _dense_where_steep(
    equation: CharacteristicEquation, low: float, high: float, points: int
) -> Array:
    """Frequencies low..high, equally spaced in the phase that poles and zeros contribute."""
    height, width = _poles_and_zeros(equation)
    near = _near_poles_and_zeros(equation, low, high)
    grid = np.unique(np.concatenate((near, np.linspace(low, high, 33))))
    phase = np.arctan((grid[:, None] - height) / width).sum(axis=1)
    phase += np.pi * (grid - low) / (high - low)
    return np.interp(np.linspace(phase[0], phase[-1], points), phase, grid)
