"""A corner of the surface that is met inside a whole step, as moments of the step's input.

A jump in the third derivative of the surface is one in the fifth of the motion: no node need be
left there, and the step need not be divided. The surface met is the quintic through both ends of
the step and a difference, itself two quintics from corner to either end. The machine answers to
that by its moments,

    z(1) = ... + sum_m generator^m b_u mu_m,   mu_m = integral of (1 - t)^m/m! difference(t)

on [0, 1]. These are linear in what the difference is at the corner, and polynomials in the place
of that; the fifth and further ones are below rounding.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.polynomial import Polynomial

from lathe_chatter.array_types import Array
from lathe_chatter.compiled import compiled
from lathe_chatter.lathe.integrator import step_block_layout as at
from lathe_chatter.lathe.integrator import surface
from lathe_chatter.lathe.integrator.simd_vectors import LANES, fma, lane, lanes_at, spread

MOMENTS = 5


def _table() -> Array:
    """Coefficients in the corner's place: of value, slope and curvature, eight rows each."""
    result = np.zeros((3 * LANES, LANES))
    a, b = Polynomial([0.0, 1.0]), Polynomial([1.0, -1.0])
    for i, cardinal in enumerate(surface.hermite().T[:3]):
        for m in range(MOMENTS):
            later = sum(c * math.factorial(k) / math.factorial(k + m + 1)
                        for k, c in enumerate(cardinal))  # fmt: skip
            moment = later * b ** (m + 1 + i)
            for j in range(m + 1):  # before the corner 1 - t is b and the way to that
                share = sum(c / (k + j + 1) for k, c in enumerate(cardinal)) / math.factorial(j)
                rest = b ** (m - j) / math.factorial(m - j)
                moment = moment + (-1.0) ** i * share * a ** (i + 1 + j) * rest
            result[i * LANES : i * LANES + len(moment.coef), m] = moment.coef
    return result


_TABLE = _table()


@compiled(borrows=True, inner=True)
def corner_moments(
    nodes: Array, corner: int, place0: float, height0: float, slope0: float, curvature0: float,
    place1: float, block: Array, k: int,
) -> None:  # fmt: skip
    """Write the moments of a corner that step `k` of a block meets between these two ends."""
    place = nodes[surface.PLACE, corner]
    height, slope, curvature = surface.quintic_at(
        place0, height0, slope0, curvature0,
        place1, block[at.HEIGHT, k], block[at.SLOPE, k], block[at.CURVATURE, k], place,
    )  # fmt: skip
    width = place1 - place0
    part = (place - place0) / width
    value = nodes[surface.HEIGHT, corner] - height
    rate = (nodes[surface.SLOPE_BEFORE, corner] - slope) * width
    bend = (nodes[surface.CURVATURE_BEFORE, corner] - curvature) * (width * width)
    of_value = of_rate = of_bend = spread(0.0)
    for power in range(LANES - 1, -1, -1):
        of_value = fma(part, of_value, lanes_at(_TABLE, power, 0))
        of_rate = fma(part, of_rate, lanes_at(_TABLE, LANES + power, 0))
        of_bend = fma(part, of_bend, lanes_at(_TABLE, 2 * LANES + power, 0))
    moments = fma(value, of_value, fma(rate, of_rate, bend * of_bend))
    for m in range(MOMENTS):
        block[at.MOMENT + m, k] = lane(moments, m)
