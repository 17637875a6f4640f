"""The exact solution of a piece against the matrix exponential of the paper's matrices."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.linalg import expm

from lathe_chatter.arrays import Array
from lathe_chatter.lathe.integrator import propagation
from lathe_chatter.lathe.integrator.propagation import ENGAGED, IN_CUT, TERMS
from lathe_chatter.model import Machine, Mode

_MACHINE = Machine(Mode(0.05, 775.0, 0.05), Mode(0.08, 650.0, 0.03), bearing_stiffness=2e4)
_DEPTH, _CLEARANCE = 1e-3, 5e-6
_REGIMES = [0, IN_CUT, ENGAGED, IN_CUT + ENGAGED]


def _mechanics() -> Array:
    tool, workpiece = _MACHINE.tool, _MACHINE.workpiece
    cutting = _MACHINE.cutting_stiffness(_DEPTH)
    constants = np.empty(propagation.MECHANICS_SIZE)
    constants[propagation.TOOL_STIFFNESS] = tool.stiffness / tool.mass
    constants[propagation.TOOL_DAMPING] = tool.damping / tool.mass
    constants[propagation.TOOL_CUTTING] = cutting / tool.mass
    constants[propagation.TOOL_COMPLIANCE] = 1.0 / tool.mass
    constants[propagation.WORKPIECE_STIFFNESS] = workpiece.stiffness / workpiece.mass
    constants[propagation.WORKPIECE_DAMPING] = workpiece.damping / workpiece.mass
    constants[propagation.WORKPIECE_CUTTING] = cutting / workpiece.mass
    constants[propagation.BEARING_STIFFNESS] = _MACHINE.bearing_stiffness / workpiece.mass
    constants[propagation.CLEARANCE] = _CLEARANCE
    return constants


def _solved(
    state: Array, duration: float, regime: int, force: float, surface: Array
) -> tuple[Array, Array]:
    tool, workpiece = np.zeros(TERMS), np.zeros(TERMS)
    propagation.solve_piece(state, duration, regime, _mechanics(), force, surface, tool, workpiece)
    return tool, workpiece


def _by_matrix_exponential(
    state: Array, duration: float, regime: int, force: float, surface: Array
) -> Array:
    """The same with the surface as six more states, each the derivative of the one before."""
    depth = _DEPTH if regime & IN_CUT else 0.0
    a, b, d = _MACHINE.matrices(depth, seated=bool(regime & ENGAGED))
    system = np.zeros((11, 11))
    system[:4, :4] = a
    system[:4, 4] = b[:, 0]  # the surface stands where the delayed r stands in equation (2)
    system[4:9, 5:10] = np.eye(5)
    system[:4, 10] = d * _CLEARANCE
    system[1, 10] += force / _MACHINE.tool.mass
    derivatives = [
        surface[k] * math.factorial(k) / duration**k for k in range(6)
    ]  # of the surface by time at the start
    start = np.concatenate([state, derivatives, [1.0]])
    scale = np.array([1e-6, 1e-3, 1e-6, 1e-3, *(1e-6 / duration**k for k in range(6)), 1.0])
    balanced = system * scale / scale[:, None]
    return (scale * (expm(balanced * duration) @ (start / scale)))[:4]


@pytest.mark.parametrize('regime', _REGIMES)
@pytest.mark.parametrize('duration', [1e-7, 3.7e-5, 1e-4])
def test_a_piece_is_the_matrix_exponential(regime: int, duration: float) -> None:
    rng = np.random.default_rng(regime)
    state = rng.normal(size=4) * [1e-5, 1e-2, 1e-5, 1e-2]
    surface, force = rng.normal(size=6) * 1e-5, 2.0
    tool, workpiece = _solved(state, duration, regime, force, surface)
    end = np.empty(4)
    propagation.state_at(tool, workpiece, 1.0, duration, end)
    exact = _by_matrix_exponential(state, duration, regime, force, surface)
    assert end == pytest.approx(exact, rel=1e-12, abs=1e-18)


@pytest.mark.parametrize('regime', _REGIMES)
def test_the_series_solves_the_equations_all_along_the_piece(regime: int) -> None:
    """Not only at its end: events are located on it."""
    rng = np.random.default_rng(10 + regime)
    state = rng.normal(size=4) * [1e-5, 1e-2, 1e-5, 1e-2]
    surface, duration = rng.normal(size=6) * 1e-5, 1e-4
    tool, workpiece = _solved(state, duration, regime, 0.0, surface)
    depth = _DEPTH if regime & IN_CUT else 0.0
    a, b, d = _MACHINE.matrices(depth, seated=bool(regime & ENGAGED))
    for place in (0.0, 0.3, 0.8, 1.0):
        series = [Polynomial(tool), Polynomial(workpiece)]
        x = [p(place) for p in series]
        v = [p.deriv()(place) / duration for p in series]
        acceleration = [p.deriv(2)(place) / duration**2 for p in series]
        now = np.array([x[0], v[0], x[1], v[1]])
        wanted = a @ now + b[:, 0] * Polynomial(surface)(place) + d * _CLEARANCE
        assert acceleration == pytest.approx(wanted[[1, 3]], rel=1e-11)


def test_the_quintic_has_the_given_values_slopes_and_curvatures() -> None:
    given = [0.3, -1.0, 2.0, 0.7, -1.3, 0.4]
    coefficients = np.empty(6)
    propagation.quintic(*given, coefficients)
    p = Polynomial(coefficients)
    found = [q(place) for place in (0.0, 1.0) for q in (p, p.deriv(), p.deriv(2))]
    assert found == pytest.approx(given, rel=1e-14)


def test_values_and_slopes_of_a_series() -> None:
    series = np.random.default_rng(3).normal(size=TERMS)
    p = Polynomial(series)
    assert propagation.value_at(series, TERMS, 0.7) == pytest.approx(p(0.7), rel=1e-14)
    assert propagation.slope_at(series, TERMS, 0.7) == pytest.approx(p.deriv()(0.7), rel=1e-14)
