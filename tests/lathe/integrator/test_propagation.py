"""The exact solution of a piece and of a whole step against the matrix exponential."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.linalg import expm

from lathe_chatter.arrays import Array
from lathe_chatter.lathe.integrator import propagation
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.lathe.integrator.coefficients import (
    Constants,
    between_nodes,
    constants_of,
    motion,
)
from lathe_chatter.lathe.integrator.propagation import TERMS
from lathe_chatter.model import Cut, Machine, Mode
from lathe_chatter.model.lathe_setup import LatheSetup

_SEVERAL = Machine(
    [Mode(0.4, 2000.0, 0.03, chip=0.8, force=-0.3), Mode(1.2, 1100.0, 0.02)],
    [Mode(3.0, 700.0, 0.01, bearing=-0.5), Mode(5.0, 1300.0, 1.0, chip=0.4, bearing=2.0)],
    bearing_stiffness=2e6,
)
_MACHINES = {
    'one mode each': Machine(Mode(0.05, 775.0, 0.05), Mode(0.08, 650.0, 0.03)),
    'several': _SEVERAL,
    'critically damped': Machine(Mode(0.05, 775.0, 1.0), Mode(0.08, 650.0, 0.03)),
}
_CUT = Cut(3000.0, 1e-3, bearing_contact='both_sides', process_damping=1e3)
_TOOL_FORCE, _BETWEEN = 2.0, -0.7


def _exact(machine: Machine, constants: Constants, regime: int, duration: float) -> Array:
    """The propagator of motion, surface, unbalance (six derivatives each) and of 1 (2n + 13)."""
    shapes, settings = constants.shapes, constants.settings
    matrix, push = motion(machine, shapes, settings, regime)
    n = len(push) // 2
    square, in_cut = settings[layout.STEP_LENGTH] ** 2, regime & layout.IN_CUT
    system = np.zeros((2 * n + 13, 2 * n + 13))
    system[: 2 * n, : 2 * n] = matrix
    if in_cut:
        system[n : 2 * n, 2 * n] = settings[layout.CUTTING_STIFFNESS] * shapes.apart * square
    system[n : 2 * n, 2 * n + 6] = shapes.on_workpiece * square
    for first in (2 * n, 2 * n + 6):
        system[first : first + 5, first + 1 : first + 6] = np.eye(5)
    held = shapes.on_tool * _TOOL_FORCE - in_cut * shapes.apart * _BETWEEN
    system[: 2 * n, -1] = push
    system[n : 2 * n, -1] += held * square
    result: Array = expm(system * duration)
    return result


def _start(n: int, seed: int) -> tuple[Array, Array, Array]:
    rng = np.random.default_rng(seed)
    return rng.normal(size=2 * n) * 1e-6, rng.normal(size=6) * 1e-6, rng.normal(size=6) * 1e-1


@pytest.mark.parametrize('regime', range(layout.REGIMES))
@pytest.mark.parametrize('duration', [0.2, 0.37, 1.0])
@pytest.mark.parametrize('machine', _MACHINES.values(), ids=_MACHINES)
def test_a_piece_is_the_matrix_exponential(machine: Machine, regime: int, duration: float) -> None:
    constants = constants_of(LatheSetup(machine), _CUT, 1)
    n = len(constants.shapes.frequency)
    shape = (0.0,) * n
    moved, surface, turning = _start(n, regime)
    basis = constants.bases[regime]
    z = basis.inverse @ (moved - constants.rests[regime])
    series, work, end = np.empty((TERMS, 2 * n)), np.empty((5, 2 * n + TERMS)), np.empty(2 * n)
    forces = np.array([_TOOL_FORCE, _BETWEEN, 1.0, 0.0, 0.0, 0.0])
    propagation.solve_piece(
        z, duration, constants.rules[regime], basis.generator, not basis.in_pairs, forces,
        surface, turning, series, work, end, shape,
    )  # fmt: skip
    derivatives = [
        given[k] * math.factorial(k) / duration**k
        for given in (surface, turning)
        for k in range(6)
    ]
    start = np.concatenate([moved, derivatives, [1.0]])
    expected = (_exact(machine, constants, regime, duration) @ start)[: 2 * n]
    found = basis.vectors @ end + constants.rests[regime]
    assert np.abs(found - expected).max() < 1e-11 * np.abs(expected).max()
    middle = np.empty(2 * n)
    propagation.coordinates_at(series, 0.4, middle, shape)
    by_series = [Polynomial(series[:, i])(0.4) for i in range(2 * n)]
    assert middle == pytest.approx(by_series, rel=1e-13, abs=1e-20)


@pytest.mark.parametrize('regime', range(layout.REGIMES))
@pytest.mark.parametrize('machine', _MACHINES.values(), ids=_MACHINES)
def test_a_whole_step_is_the_piece_of_that_length(machine: Machine, regime: int) -> None:
    constants = constants_of(LatheSetup(machine), _CUT, 1)
    n = len(constants.shapes.frequency)
    moved, ends, turning = _start(n, 7 + regime)
    basis, rules = constants.bases[regime], constants.rules[regime]
    z = basis.inverse @ moved
    step_matrix = expm(basis.generator)
    in_cut = bool(regime & layout.IN_CUT)
    call: Any = propagation
    found = call.whole_step.py_func(
        z, rules, step_matrix, not basis.in_pairs, in_cut, *ends, np.empty(2 * n), (0.0,) * n
    )
    found = call.add_held_forces.py_func(rules, _TOOL_FORCE, _BETWEEN, found, (0.0,) * n)
    found = call.add_unbalance.py_func(rules, *turning, found, (0.0,) * n)
    hold, turns = np.empty(6), np.empty(6)
    propagation.quintic(*ends, hold)
    propagation.quintic(*turning, turns)
    series, work, end = np.empty((TERMS, 2 * n)), np.empty((5, 2 * n + TERMS)), np.empty(2 * n)
    propagation.solve_piece(
        z, 1.0, rules, basis.generator, not basis.in_pairs,
        np.array([_TOOL_FORCE, _BETWEEN, 1.0, 0.0, 0.0, 0.0]), hold, turns, series, work, end,
        (0.0,) * n,
    )  # fmt: skip
    assert np.abs(np.array(found) - end).max() < 1e-13 * np.abs(end).max()


def test_only_nearly_equal_eigenvalues_stay_coupled() -> None:
    for name, machine in _MACHINES.items():
        constants = constants_of(LatheSetup(machine), _CUT.with_changes(depth_of_cut=0.0), 1)
        coupled = [regime for regime, basis in constants.bases.items() if not basis.in_pairs]
        assert bool(coupled) == (name != 'one mode each'), name


def test_the_quintic_has_the_given_values_slopes_and_curvatures() -> None:
    given = [0.3, -1.0, 2.0, 0.7, -1.3, 0.4]
    coefficients = np.empty(6)
    propagation.quintic(*given, coefficients)
    p = Polynomial(coefficients)
    found = [q(place) for place in (0.0, 1.0) for q in (p, p.deriv(), p.deriv(2))]
    assert found == pytest.approx(given, rel=1e-14)


@pytest.mark.parametrize('part', [0.0, 0.3, 0.999])
def test_the_weights_between_two_nodes_are_those_of_the_quintic(part: float) -> None:
    given = [0.3, -1.0, 2.0, 0.7, -1.3, 0.4]
    coefficients = np.empty(6)
    propagation.quintic(*given, coefficients)
    p = Polynomial(coefficients)
    u0, d0, e0, u1, d1, e1 = given
    found = between_nodes(part) @ [u1 - u0, d0, d1, e0, e1]
    assert found == pytest.approx([p(part) - u0, p.deriv()(part), p.deriv(2)(part)], rel=1e-12)


def test_a_series_with_its_slope() -> None:
    series = np.random.default_rng(3).normal(size=TERMS)
    p = Polynomial(series)
    found = propagation.value_and_slope(series, 0.7)
    assert found == pytest.approx((p(0.7), p.deriv()(0.7)), rel=1e-14)
