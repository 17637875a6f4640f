"""The exact solution of a piece and of a whole step against the matrix exponential."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.linalg import expm
from support.python_entry import with_entry

from lathe_chatter.array_types import Array
from lathe_chatter.lathe.integrator import propagation
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.lathe.integrator.coefficients import (
    Constants,
    constants_of,
    motion,
)
from lathe_chatter.lathe.integrator.propagation import TERMS
from lathe_chatter.lathe.integrator.state_layout import SERIES_SIZE
from lathe_chatter.lathe.integrator.surface import between_nodes
from lathe_chatter.model import Cut, Machine, Mode
from lathe_chatter.model.machine_and_sampling import LatheSetup

solve_piece, quintic = with_entry(propagation.solve_piece), with_entry(propagation.quintic)
coordinates_at = with_entry(propagation.coordinates_at)
value_and_slope = with_entry(propagation.value_and_slope)

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


def _solved(
    constants: Constants, regime: int, z: Array, duration: float, given: Array
) -> tuple[Array, Array, bool]:
    """The end of a piece, its series, and whether all of it counts; with forces and unbalance."""
    width = len(z)
    series, end = np.empty((width, TERMS)), np.empty(width)
    work = np.empty((3, width + TERMS))
    basis = constants.bases[regime]
    direct = np.zeros(layout.DIRECT)
    direct[layout.COUPLED], direct[layout.RATE] = float(not basis.in_pairs), basis.rate
    forces = np.array([_TOOL_FORCE, _BETWEEN, 1.0, 0.0, 0.0, 0.0])
    wide = solve_piece(
        z, duration, constants.rules[regime], constants.answers[regime].reshape((-1, SERIES_SIZE)),
        basis.generator, direct, forces, given, series, work, end,
    )  # fmt: skip
    return end, series, wide


@pytest.mark.parametrize('regime', range(layout.REGIMES))
@pytest.mark.parametrize('duration', [0.2, 0.37, 1.0])
@pytest.mark.parametrize('machine', _MACHINES.values(), ids=_MACHINES)
def test_a_piece_is_the_matrix_exponential(machine: Machine, regime: int, duration: float) -> None:
    constants = constants_of(LatheSetup(machine), _CUT, 1)
    n = len(constants.shapes.frequency)
    moved, surface, turning = _start(n, regime)
    basis = constants.bases[regime]
    z = basis.inverse @ (moved - constants.rests[regime])
    given = np.zeros((2, TERMS))
    given[0, :6], given[1, :6] = surface, turning
    end, series, wide = _solved(constants, regime, z, duration, given)
    by_time = duration ** np.arange(6)
    start = np.concatenate([moved, surface / by_time, turning / by_time, [1.0]])
    expected = (_exact(machine, constants, regime, duration) @ start)[: 2 * n]
    found = basis.vectors @ end + constants.rests[regime]
    assert np.abs(found - expected).max() < 1e-11 * np.abs(expected).max()
    middle = np.empty(2 * n)
    coordinates_at(z, series, wide, 0.4, middle)
    weights = np.array([1.0 / math.factorial(k + 1) for k in range(TERMS if wide else TERMS // 2)])
    by_series = [
        Polynomial(np.append(z[i], series[i, : len(weights)] * weights))(0.4) for i in range(2 * n)
    ]
    assert middle == pytest.approx(by_series, rel=1e-13, abs=1e-20)


@pytest.mark.parametrize('regime', range(layout.REGIMES))
@pytest.mark.parametrize('machine', _MACHINES.values(), ids=_MACHINES)
def test_a_whole_step_is_the_piece_of_that_length(machine: Machine, regime: int) -> None:
    constants = constants_of(LatheSetup(machine), _CUT, 1)
    n = len(constants.shapes.frequency)
    moved, ends, turning = _start(n, 7 + regime)
    basis, rules = constants.bases[regime], constants.rules[regime]
    z = basis.inverse @ moved
    given = np.zeros((2, TERMS))
    quintic(*ends, given, 0)
    quintic(*turning, given, 1)
    end, _, _ = _solved(constants, regime, z, 1.0, given)
    found = expm(basis.generator) @ z
    found += ends @ rules[layout.STEP_SURFACE : layout.STEP_SURFACE + 6]
    found += turning @ rules[layout.STEP_UNBALANCE : layout.STEP_UNBALANCE + 6]
    found += rules[layout.STEP_TOOL_FORCE] * _TOOL_FORCE
    found += rules[layout.STEP_CUTTING_FORCE] * _BETWEEN
    assert np.abs(found - end).max() < 1e-13 * np.abs(end).max()
    if basis.in_pairs:
        partners = np.append(np.arange(n, 2 * n), np.arange(n))
        turned = rules[layout.STEP_OWN] * z + rules[layout.STEP_PARTNER] * z[partners]
        assert turned == pytest.approx(expm(basis.generator) @ z, rel=1e-12, abs=1e-12)


def test_only_nearly_equal_eigenvalues_stay_coupled() -> None:
    for name, machine in _MACHINES.items():
        constants = constants_of(LatheSetup(machine), _CUT.with_changes(depth_of_cut=0.0), 1)
        coupled = [regime for regime, basis in constants.bases.items() if not basis.in_pairs]
        assert bool(coupled) == (name != 'one mode each'), name


def test_the_quintic_has_the_given_values_slopes_and_curvatures() -> None:
    given = [0.3, -1.0, 2.0, 0.7, -1.3, 0.4]
    derivatives = np.zeros((1, 8))
    quintic(*given, derivatives, 0)
    p = Polynomial([d / math.factorial(k) for k, d in enumerate(derivatives[0])])
    found = [q(place) for place in (0.0, 1.0) for q in (p, p.deriv(), p.deriv(2))]
    assert found == pytest.approx(given, rel=1e-14)


@pytest.mark.parametrize('part', [0.0, 0.3, 0.999])
def test_the_weights_between_two_nodes_are_those_of_the_quintic(part: float) -> None:
    given = [0.3, -1.0, 2.0, 0.7, -1.3, 0.4]
    derivatives = np.zeros((1, 8))
    quintic(*given, derivatives, 0)
    p = Polynomial([d / math.factorial(k) for k, d in enumerate(derivatives[0])])
    u0, d0, e0, u1, d1, e1 = given
    found = between_nodes(part) @ [u1 - u0, d0, d1, e0, e1]
    assert found == pytest.approx([p(part) - u0, p.deriv()(part), p.deriv(2)(part)], rel=1e-12)


def test_a_series_with_its_slope() -> None:
    series = np.random.default_rng(3).normal(size=TERMS)
    p = Polynomial(series)
    found = value_and_slope(series, TERMS - 1, 0.7)
    assert found == pytest.approx((p(0.7), p.deriv()(0.7)), rel=1e-14)
