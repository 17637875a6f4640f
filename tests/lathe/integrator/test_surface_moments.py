"""A corner met inside a step against quadrature, and against the pieces on either side of it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import BPoly
from scipy.linalg import expm
from support.python_entry import with_entry

from lathe_chatter.array_types import Array
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.lathe.integrator import step_block_layout as at
from lathe_chatter.lathe.integrator import surface, surface_moments
from lathe_chatter.lathe.integrator.coefficients import constants_of
from lathe_chatter.lathe.integrator.surface_moments import MOMENTS
from lathe_chatter.model import Cut, Machine, Mode
from lathe_chatter.model.machine_and_sampling import LatheSetup

corner_moments = with_entry(surface_moments.corner_moments)
_START, _LANE = 7.25, 3
_MACHINES = {
    'in pairs': Machine(Mode(0.05, 775.0, 0.05), Mode(0.08, 650.0, 0.03)),
    'coupled': Machine(Mode(0.05, 775.0, 1.0), Mode(0.08, 650.0, 0.03)),
}


def _ends(seed: int) -> Array:
    """Height, slope and curvature at the start of a step, at the corner and at the end (3, 3)."""
    return np.random.default_rng(seed).normal(size=(3, 3)) * 1e-6


def _moments(ends: Array, corner: float, width: float) -> Array:
    nodes, block = np.zeros((surface.NODE_SIZE, 3)), np.zeros((at.ROWS, 8))
    nodes[surface.PLACE, 1] = corner
    nodes[[surface.HEIGHT, surface.SLOPE_BEFORE, surface.CURVATURE_BEFORE], 1] = ends[1]
    block[[at.HEIGHT, at.SLOPE, at.CURVATURE], _LANE] = ends[2]
    corner_moments(nodes, 1, _START, *ends[0], _START + width, block, _LANE)
    found: Array = block[at.MOMENT : at.MOMENT + MOMENTS, _LANE]
    return found


@pytest.mark.parametrize('part', [0.01, 0.3, 0.95])
@pytest.mark.parametrize('width', [1.0, 0.9])
def test_moments_are_the_integrals(part: float, width: float) -> None:
    ends, corner = _ends(1), _START + part * width
    places = [_START, corner, _START + width]
    met = BPoly.from_derivatives(places, ends)
    smooth = BPoly.from_derivatives(places[::2], ends[::2])

    def integrand(t: float, m: int) -> float:
        place = _START + t * width
        return float(met(place) - smooth(place)) * (1.0 - t) ** m / math.factorial(m)

    expected = [
        sum(quad(integrand, *side, args=(m,), epsrel=1e-12)[0] for side in ((0, part), (part, 1)))
        for m in range(MOMENTS)
    ]
    assert _moments(ends, corner, width) == pytest.approx(expected, rel=1e-9, abs=1e-18)


def _propagated(generator: Array, push: Array, z: Array, met: Array, duration: float) -> Array:
    """The coordinates after a piece that meets a polynomial of these six derivatives."""
    n = len(z)
    system = np.zeros((n + 6, n + 6))
    system[:n, :n], system[:n, n] = generator, push
    system[n : n + 5, n + 1 :] = np.eye(5)
    moved: Array = (expm(system * duration) @ np.append(z, met))[:n]
    return moved


@pytest.mark.parametrize('machine', _MACHINES.values(), ids=_MACHINES)
@pytest.mark.parametrize('part', [0.1, 0.6])
def test_a_step_over_a_corner_is_the_pieces_beside_it(machine: Machine, part: float) -> None:
    constants = constants_of(LatheSetup(machine), Cut(3000.0, 1e-3), 1)
    regime = layout.IN_CUT
    rules, generator = constants.rules[regime], constants.bases[regime].generator
    push = rules[layout.BY_SURFACE]
    ends, z = _ends(2), np.random.default_rng(3).normal(size=len(push)) * 1e-6
    met = BPoly.from_derivatives([0.0, part, 1.0], ends)
    expected = z
    for begin, duration in ((0.0, part), (part, 1.0 - part)):
        derivatives = np.array([met(begin, nu=k) for k in range(6)])
        expected = _propagated(generator, push, expected, derivatives, duration)
    whole = np.concatenate([ends[0], ends[2]])
    found = expm(generator) @ z + whole @ rules[layout.STEP_SURFACE : layout.STEP_SURFACE + 6]
    moments = _moments(ends, _START + part, 1.0)
    beside = moments @ rules[layout.STEP_MOMENT : layout.STEP_MOMENT + MOMENTS]
    size = np.abs(beside).max()
    assert np.abs(found + beside - expected).max() < 1e-6 * size
    assert np.abs(found - expected).max() > 0.5 * size
