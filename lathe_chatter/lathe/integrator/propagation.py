"""The exact solution of the machine over a piece of time with one regime and a quintic input.

Within a piece neither contact nor cutting changes, so the machine is linear: in its coordinates,
measured from the rest of the regime,

    z' = generator z + b_u U(t) + b_t f_t + b_c [f_c + delta(t) r'] + b_w f_w(t)

with the surface U that the tool meets, forces f_t on the tool and f_c between tool and workpiece
that are held for a sample, the force f_w of an unbalance on the workpiece, and by how much the
process damps more (delta) than at the target speed. The solution is a power series; with
|lambda| dt <= 0.25 its terms fall faster than 0.25^k/k!, so it ends at rounding level: nothing is
approximated but U and f_w, quintics through values, slopes and curvatures at both ends.

Whole steps repeat with the same length, so for them the series is summed once per regime
(coefficients.py); the pieces around an event are summed as they come.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.compiled import compiled
from lathe_chatter.lathe.integrator.simd_vectors import (
    LANES,
    after,
    fma,
    lane,
    lanes_at,
    powers,
    put,
    six,
    spread,
    total,
)
from lathe_chatter.lathe.integrator.state_layout import (
    BY_CUTTING_FORCE,
    BY_SURFACE,
    BY_TOOL_FORCE,
    BY_UNBALANCE,
    COUPLED,
    OF_CUTTING_FORCE,
    OF_ITSELF,
    OF_PARTNER,
    OF_SURFACE,
    OF_TOOL_FORCE,
    OF_UNBALANCE,
    OWN,
    PARTNER,
    RATE,
    RELATIVE_RATE_ROW,
    SERIES,
    SERIES_BEGIN,
)

TERMS = 2 * LANES
"""Terms of a series after the first: 0.25^17/17! is 2e-25."""
RATE_STEP = 0.25
"""Largest |lambda| dt of a step, see `TERMS`; the quintic errs by 2.2e-5 of its sixth power."""
_SHORT = 0.06
"""Up to this |lambda| dt half of the terms do: 0.06^9/9! is 3e-17."""
_GIVEN = 6
"""Derivatives of a quintic."""
_LEAST = 1e-20
"""A duration that is none, but may be divided by."""
WEIGHTS = np.array([[1.0 / math.factorial(k + 1) for k in range(TERMS)]])
"""Of the terms at the end of a piece."""


@compiled(inline=True, borrows=True, inner=True)
def quintic(
    u0: float, d0: float, e0: float, u1: float, d1: float, e1: float, out: Array, row: int
) -> None:
    """The quintic on [0, 1] with these values, slopes and curvatures: eight derivatives at 0."""
    rise = u1 - u0 - d0 - 0.5 * e0
    steep = d1 - d0 - e0
    bend = e1 - e0
    third = 6.0 * (10.0 * rise - 4.0 * steep + 0.5 * bend)
    fourth = 24.0 * (-15.0 * rise + 7.0 * steep - bend)
    fifth = 120.0 * (6.0 * rise - 3.0 * steep + 0.5 * bend)
    # At once: who reads eight numbers waits for each that was written by itself.
    put(out, row, 0, six(u0, d0, e0, third, fourth, fifth))


@compiled(inline=True, borrows=True, inner=True)
def solve_piece(
    z: Array, duration: float, rules: Array, answers: Array, generator: Array, direct: Array,
    forces: Array, given: Array, series: Array, work: Array, end: Array,
) -> bool:  # fmt: skip
    """The power series of all coordinates on [0, 1] times `duration`, and its sum at 1.

    Coordinates in pairs answer to their start and to each derivative of what is given by series
    that are known but for powers of the duration: eight terms at once, none waits for another.

    Args:
        z: The coordinates at the start (2n,).
        duration: Length of the piece, steps.
        rules: The coefficients of the regime (ROWS, 2n).
        answers: The series that are known (2n SERIES, TERMS).
        generator: For coordinates that are coupled (2n, 2n).
        direct: Whether they are, and how fast the regime is (DIRECT,).
        forces: Of what acts beside the surface (6,): on the tool and between tool and workpiece,
            N; 1 if there is an unbalance, 2 if the damping varies too, and the three
            coefficients on [0, 1] of what it has more than at the target speed, N per m/step.
        given: Derivatives at the start of the surface met, m, and of the force of an unbalance,
            N, for a time of `duration` (2, TERMS); none from the sixth on.
        series: Written: the derivatives of the coordinates, from the first on (2n, TERMS).
        work: Room (3, 2n + TERMS).
        end: Written: the coordinates at the end (2n,).

    Returns:
        Whether all of the terms count; else the first `LANES` do.
    """
    n = z.shape[0] // 2
    coupled = direct[COUPLED] != 0.0 or forces[2] == 2.0
    wide = coupled or duration * direct[RATE] > _SHORT
    if coupled:
        _solve_coupled(
            z, duration, rules, generator, direct[COUPLED] != 0.0, forces, given, series, work
        )
    else:
        low = powers(max(duration, _LEAST))
        high = low * lane(low, LANES - 1)
        # The derivatives as they are, not for a time of the duration.
        met = lanes_at(given, 0, 0) / after(1.0, low)
        turning = lanes_at(given, 1, 0) / after(1.0, low) if forces[2] != 0.0 else met
        for i in range(2 * n):
            start, partner = z[i], z[i + n if i < n else i - n]
            put(series, i, 0, low * _answer(answers, i, 0, start, partner, forces, met, turning))
            if wide:
                more = _answer(answers, i, LANES, start, partner, forces, met, turning)
                put(series, i, LANES, high * more)
    weights, more = lanes_at(WEIGHTS, 0, 0), lanes_at(WEIGHTS, 0, LANES)
    for i in range(2 * n):
        terms = weights * lanes_at(series, i, 0)
        if wide:
            terms = fma(more, lanes_at(series, i, LANES), terms)
        end[i] = z[i] + total(terms)
    return wide  # type: ignore[no-any-return]  # a bool


@compiled(inline=True, borrows=True, inner=True)
def _answer(
    answers: Array, i: int, first: int, start: float, partner: float, forces: Array, met: Any,
    turning: Any,
) -> Any:  # fmt: skip
    """Eight derivatives by time of coordinate `i`, from number `first` + 1 on."""
    row, first = i * SERIES, first + SERIES_BEGIN
    terms = fma(
        start, lanes_at(answers, row + OF_ITSELF, first),
        partner * lanes_at(answers, row + OF_PARTNER, first),
    )  # fmt: skip
    if forces[0] != 0.0 or forces[1] != 0.0:
        terms = fma(forces[0], lanes_at(answers, row + OF_TOOL_FORCE, first), terms)
        terms = fma(forces[1], lanes_at(answers, row + OF_CUTTING_FORCE, first), terms)
    for j in range(_GIVEN):
        terms = fma(lane(met, j), lanes_at(answers, row + OF_SURFACE, first - j), terms)
        if forces[2] != 0.0:
            terms = fma(lane(turning, j), lanes_at(answers, row + OF_UNBALANCE, first - j), terms)
    return terms


@compiled(borrows=True, inner=True)
def _solve_coupled(
    z: Array, duration: float, rules: Array, generator: Array, coupled: bool, forces: Array,
    given: Array, series: Array, work: Array,
) -> None:  # fmt: skip
    """The series where every coordinate pushes every other: by itself, or through the damping.

    The recurrence runs on k! times the terms, the derivatives: its chain is then short.
    """
    n = z.shape[0] // 2
    met, turning = duration * lanes_at(given, 0, 0), duration * lanes_at(given, 1, 0)
    on_tool, between = duration * forces[0], duration * forces[1]
    for i in range(2 * n):
        push = rules[BY_SURFACE, i] * met
        if forces[2] != 0.0:
            push = fma(rules[BY_UNBALANCE, i], turning, push)
        held = rules[BY_TOOL_FORCE, i] * on_tool + rules[BY_CUTTING_FORCE, i] * between
        put(series, i, 0, push + after(held, spread(0.0)))
    term, following, rates = work[0], work[1], work[2]
    for i in range(2 * n):
        term[i] = z[i]
    for k in range(TERMS):
        for i in range(2 * n):
            sum_of = series[i, k] if k < LANES else 0.0
            if coupled:
                for j in range(2 * n):
                    sum_of = fma(duration * generator[i, j], term[j], sum_of)
            else:
                partner = i + n if i < n else i - n
                sum_of = fma(duration * rules[OWN, i], term[i], sum_of)
                sum_of = fma(duration * rules[PARTNER, i], term[partner], sum_of)
            following[i] = sum_of
        if forces[2] == 2.0:
            rates[k] = 0.0
            for i in range(2 * n):
                rates[k] = fma(rules[RELATIVE_RATE_ROW, i], term[i], rates[k])
            damped = forces[3] * rates[k]
            if k >= 1:
                damped += forces[4] * k * rates[k - 1]
            if k >= 2:
                damped += forces[5] * k * (k - 1.0) * rates[k - 2]
            for i in range(2 * n):
                following[i] += rules[BY_CUTTING_FORCE, i] * (duration * damped)
        for i in range(2 * n):
            series[i, k] = term[i] = following[i]


@compiled(borrows=True, inner=True)
def turn_coupled(step_matrix: Array, z: Array, moved: Array) -> None:
    """Take the steps of a block whose coordinates are all coupled: pushes in, coordinates out."""
    for k in range(LANES):
        for i in range(z.shape[0]):
            total = moved[i, k]
            for j in range(z.shape[0]):
                total = fma(step_matrix[i, j], z[j], total)
            moved[i, k] = total
        for i in range(z.shape[0]):
            z[i] = moved[i, k]


@compiled(inline=True, borrows=True, inner=True)
def coordinates_at(z: Array, series: Array, wide: bool, place: float, there: Array) -> None:
    """Write the coordinates (2n,) at `place` of a solved piece that began with `z`."""
    low = powers(place)
    weights = low * lanes_at(WEIGHTS, 0, 0)
    more = (low * lane(low, LANES - 1)) * lanes_at(WEIGHTS, 0, LANES)
    for i in range(z.shape[0]):
        terms = weights * lanes_at(series, i, 0)
        if wide:
            terms = fma(more, lanes_at(series, i, LANES), terms)
        there[i] = z[i] + total(terms)


@compiled(inline=True, borrows=True, inner=True)
def read_outputs(outputs: Array, z: Array, out: Array) -> None:
    """What the coordinates mean (1, OUTPUTS), by the outputs (2n + 1, OUTPUTS) of the regime."""
    seen = lanes_at(outputs, z.shape[0], 0)
    for i in range(z.shape[0]):
        seen = fma(z[i], lanes_at(outputs, i, 0), seen)
    put(out, 0, 0, seen)


@compiled(inline=True, borrows=True, inner=True)
def value_and_slope(series: Array, last: int, place: float) -> tuple[float, float]:
    """A power series up to term `last`, and its derivative, at `place`."""
    value, slope = series[last], 0.0
    for k in range(last - 1, -1, -1):
        slope = fma(slope, place, value)
        value = fma(value, place, series[k])
    return value, slope
