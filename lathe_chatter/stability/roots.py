"""The rightmost characteristic roots: does a cut chatter, how fast, at what frequency.

Newton's method starts from the delay-free roots and from every half turn of the delayed phase
along the imaginary axis, where the roots of a delay hang like beads. What it finds is then held
against the argument principle: no root may lie further right, else the search is repeated from
a denser field. So every answer is proven, and none needs an eigenproblem that grows with tau.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lathe_chatter.arrays import Array, Integers
from lathe_chatter.model import Machine
from lathe_chatter.model.quantities import Quantity
from lathe_chatter.stability.characteristic import (
    CharacteristicEquation,
    Complex,
    checked,
    residual_tolerance,
)
from lathe_chatter.stability.root_count import count_right_of

_ITERATIONS = 12
_ITERATIONS_DENSE = 60
_DENSITIES = (1, 2, 4, 8)
"""Seeds per half turn of the delayed phase, from the first search to the last."""
_STRIP = 12.0
"""The first search gives up what wanders to Re s tau < -12: such a root is never rightmost."""
_MARGINS = (5e-13, 5e-11, 5e-9, 5e-7)
"""Re s may be beaten by this times |s|; above the first only where roots all but coincide."""
_LEFT, _TURNS = 36.0, 4.0
"""The dense search looks at -Re s tau up to the logarithm of rounding, in the first turns."""
_BATCH = 512
"""Cuts at a time: their seeds then stay in the cache."""
_COUNT = Quantity('number of roots', low=1.0, high=10000.0)


def rightmost_root(
    machine: Machine, spindle_speed_rpm: float, depth_of_cut: float, *, seated: bool
) -> complex:
    """The rightmost characteristic root: growth rate + i chatter angular frequency.

    Args:
        machine: Tool, workpiece, bearing and material.
        spindle_speed_rpm: Spindle speed, rev/min.
        depth_of_cut: w, m; 0 gives the least damped mode.
        seated: Whether the workpiece rests on its bearing (the screening function is 1).

    Returns:
        The root with the largest real part, 1/s, with imaginary part >= 0, rad/s.

    Raises:
        ParameterError: If speed or depth is not allowed.
    """
    return complex(rightmost_roots(machine, spindle_speed_rpm, depth_of_cut, seated=seated))


def rightmost_roots(
    machine: Machine,
    spindle_speed_rpm: ArrayLike,
    depth_of_cut: ArrayLike,
    *,
    seated: bool,
    proven: bool = True,
) -> Complex:
    """The rightmost roots of many cuts, each proven to be the rightmost.

    Args:
        machine: Tool, workpiece, bearing and material.
        spindle_speed_rpm: Spindle speeds of any shape, rev/min.
        depth_of_cut: Depths w, m; the two broadcast.
        seated: Whether the workpiece rests on its bearing.
        proven: False leaves out the proof, which takes two thirds of the time: for the coarse
            part of a search.

    Returns:
        Growth rate + i angular frequency, 1/s and rad/s, in the broadcast shape.

    Raises:
        ParameterError: If a speed or depth is not allowed.
    """
    equation = CharacteristicEquation.of(machine, seated=seated)
    speeds, depths = np.broadcast_arrays(
        checked('spindle_speed_rpm', spindle_speed_rpm), checked('depth_of_cut', depth_of_cut)
    )
    delay = 60.0 / speeds.ravel()
    stiffness = machine.cutting_coefficient * depths.ravel()
    roots = np.empty(delay.size, complex)
    for start in range(0, delay.size, _BATCH):
        batch = slice(start, start + _BATCH)
        roots[batch] = _rightmost(equation, stiffness[batch], delay[batch], proven=proven)
    return roots.reshape(speeds.shape)


def leading_roots(
    machine: Machine,
    spindle_speed_rpm: float,
    depth_of_cut: float,
    *,
    seated: bool,
    count: int = 6,
) -> Complex:
    """The `count` rightmost roots in the upper half plane, rightmost first.

    Args:
        machine: Tool, workpiece, bearing and material.
        spindle_speed_rpm: Spindle speed, rev/min.
        depth_of_cut: w, m. With 0 there are no more roots than modes.
        seated: Whether the workpiece rests on its bearing.
        count: How many; of a conjugate pair one is counted.

    Returns:
        Roots with imaginary part >= 0 (count,), 1/s and rad/s; fewer where fewer exist.

    Raises:
        ParameterError: If an argument is not allowed.
        ArithmeticError: If the roots found do not agree with their number.
    """
    equation = CharacteristicEquation.of(machine, seated=seated)
    wanted = int(_COUNT.check('count', count))
    delay = 60.0 / np.atleast_1d(checked('spindle_speed_rpm', spindle_speed_rpm))
    depth = np.atleast_1d(checked('depth_of_cut', depth_of_cut))
    stiffness = machine.cutting_coefficient * depth
    for density in _DENSITIES:
        seeds = _dense_seeds(equation, stiffness, delay, density, beyond=wanted)
        found = _polish(equation, stiffness, delay, seeds, dense=True).points
        roots = _distinct(found, wanted)
        if roots.size == 0:
            continue
        margin = _MARGINS[1] * np.abs(roots).max()
        line = np.array([roots[-1].real - margin])
        expected = np.where(roots.imag > 0.0, 2, 1).sum()
        if count_right_of(equation, stiffness, delay, line)[0] == expected:
            return roots
    raise ArithmeticError('the characteristic roots found do not agree with their number')


class _Owned(NamedTuple):
    """Points of the complex plane and the number (in its batch) of the cut each belongs to."""

    owner: Integers
    points: Complex


def _rightmost(
    equation: CharacteristicEquation, stiffness: Array, delay: Array, *, proven: bool
) -> Complex:
    """The rightmost roots of a batch of cuts (n,)."""
    seeds = _seeds(equation, stiffness, delay)
    found = _polish(equation, stiffness, delay, seeds, dense=False)
    best = _best(found, stiffness.size)
    open_cuts = np.flatnonzero(~np.isfinite(best.real))
    if proven:
        open_cuts = _unproven(equation, stiffness, delay, best, _MARGINS[0])
    attempts = [(density, _MARGINS[0]) for density in _DENSITIES]
    attempts += [(_DENSITIES[-1], margin) for margin in _MARGINS[1:]]
    for density, margin in attempts:
        if open_cuts.size == 0:
            break
        k, tau = stiffness[open_cuts], delay[open_cuts]
        seeds = _dense_seeds(equation, k, tau, density)
        better = _best(_polish(equation, k, tau, seeds, dense=True), k.size)
        best[open_cuts] = np.where(better.real > best[open_cuts].real, better, best[open_cuts])
        open_cuts = open_cuts[_unproven(equation, k, tau, best[open_cuts], margin)]
    if open_cuts.size:
        raise ArithmeticError('the rightmost characteristic root could not be proven')
    return best.real + 1j * np.abs(best.imag)


def _unproven(
    equation: CharacteristicEquation, stiffness: Array, delay: Array, best: Complex, margin: float
) -> Integers:
    """The cuts for which a root may lie further right than the best one found."""
    unproven = np.ones(best.size, bool)
    known = np.flatnonzero(np.isfinite(best.real))
    distance = margin * np.abs(best[known])
    line = best.real[known] + distance
    near = (np.abs(best.imag[known]), distance)
    right = count_right_of(equation, stiffness[known], delay[known], line, near)
    unproven[known] = right != 0
    return np.flatnonzero(unproven)


def _seeds(equation: CharacteristicEquation, stiffness: Array, delay: Array) -> _Owned:
    """Where Newton's method starts: the axis at every half turn, and the delay-free roots."""
    some, which = np.unique(stiffness, return_inverse=True)
    free = equation.delay_free_roots(np.append(some, 0.0))
    free = np.hstack((free[which], np.broadcast_to(free[-1], (stiffness.size, 4))))
    top = 1.1 * np.abs(free).max(axis=1) + np.pi / delay
    row = _half_turns(delay, np.ceil(top * delay / np.pi).astype(np.int64), 1)
    owner, column = np.nonzero(free.imag >= 0.0)
    return _Owned(
        np.concatenate((row.owner, owner)), np.concatenate((row.points, free[owner, column]))
    )


def _dense_seeds(
    equation: CharacteristicEquation, stiffness: Array, delay: Array, density: int, beyond: int = 0
) -> _Owned:
    """More seeds: also along the curve |e^(-s tau)| = |1 + 1/(C w G)| that far roots follow."""
    few = _seeds(equation, stiffness, delay)
    top = np.bincount(few.owner) + 2 * beyond
    row = _half_turns(delay, top * density, density)
    k, tau = stiffness[row.owner], delay[row.owner]
    with np.errstate(divide='ignore', invalid='ignore'):
        flexible = k * equation.receptance(row.points.imag)
        decay = np.log(np.abs(1.0 + 1.0 / flexible)) / tau
    curve = row.points - np.where(np.isfinite(decay), decay, 0.0)
    # And a lattice behind the first turns, for real roots and what the modes push far left.
    left, up = np.meshgrid(np.arange(0.0, _LEFT, 1.0 / density), np.arange(0.0, _TURNS, 0.5))
    lattice = (2j * np.pi * up - left).ravel() / delay[:, None]
    lattice_owner = np.repeat(np.arange(delay.size), lattice.shape[1])
    return _Owned(
        np.concatenate((few.owner, row.owner, row.owner, lattice_owner)),
        np.concatenate((few.points, row.points, curve, lattice.ravel())),
    )


def _half_turns(delay: Array, counts: Integers, density: int) -> _Owned:
    """The first `counts` points (n,) of the imaginary axis, `density` to a half turn."""
    owner = np.repeat(np.arange(delay.size), counts)
    place = np.arange(owner.size) - np.repeat(np.cumsum(counts) - counts, counts)
    return _Owned(owner, 1j * np.pi / density * (place + 0.5) / delay[owner])


def _polish(
    equation: CharacteristicEquation, stiffness: Array, delay: Array, seeds: _Owned, *, dense: bool
) -> _Owned:
    """Newton's method from all seeds at once; what does not arrive is dropped."""
    owner, s = seeds
    k, tau = stiffness[owner], delay[owner]
    arrived: list[_Owned] = []
    with np.errstate(over='ignore', invalid='ignore', divide='ignore'):
        for _ in range(_ITERATIONS_DENSE if dense else _ITERATIONS):
            newton = equation.value_and_slope(s, k, tau)
            done = newton.residual <= residual_tolerance(s, tau)
            # One step more than the residual asks for: it costs nothing and ends at rounding.
            s = s - newton.value / np.where(newton.slope == 0.0, 1.0, newton.slope)
            finite = np.isfinite(newton.size) & np.isfinite(s)
            arrived.append(_Owned(owner[done & finite], s[done & finite]))
            going = ~done & finite
            if not dense:
                going &= s.real * tau > -_STRIP
            owner, s, k, tau = owner[going], s[going], k[going], tau[going]
            if s.size == 0:
                break
    return _Owned(*(np.concatenate(parts) for parts in zip(*arrived, strict=True)))


def _best(found: _Owned, count: int) -> Complex:
    """The rightmost of each cut's points (count,); -inf where it has none."""
    best = np.full(count, -np.inf, complex)
    order = np.argsort(found.points.real)
    best[found.owner[order]] = found.points[order]
    return best


def _distinct(points: Complex, count: int) -> Complex:
    """The first `count` points, each once, in the upper half plane, the rightmost first."""
    height = np.abs(points.imag)
    upper = points.real + 1j * np.where(height > 1e-9 * np.abs(points), height, 0.0)
    upper = upper[np.argsort(-upper.real)]
    kept: list[complex] = []
    for point in upper.tolist():
        if all(abs(point - other) > 1e-8 * abs(other) for other in kept):
            kept.append(point)
        if len(kept) == count:
            break
    return np.array(kept, complex)
