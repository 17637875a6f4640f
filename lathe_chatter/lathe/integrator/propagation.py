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

from typing import Any

import numpy as np

from lathe_chatter.arrays import Array
from lathe_chatter.compiled import compiled
from lathe_chatter.lathe.integrator.registers import with_entry
from lathe_chatter.lathe.integrator.state_layout import (
    BY_CUTTING_FORCE,
    BY_SURFACE,
    BY_TOOL_FORCE,
    BY_UNBALANCE,
    OUTPUTS,
    OWN,
    PARTNER,
    RELATIVE_RATE_ROW,
    STEP_CUTTING_FORCE,
    STEP_OWN,
    STEP_PARTNER,
    STEP_SURFACE,
    STEP_TOOL_FORCE,
    STEP_UNBALANCE,
)

TERMS = 13
"""Coefficients of a series: 0.25^13/13! is 2e-18."""
RATE_STEP = 0.25
"""Largest |lambda| dt of a step, see `TERMS`; the quintic errs by 2.2e-5 of its sixth power."""
FACTORIAL = np.cumprod(np.append(1.0, np.arange(1.0, TERMS + 1.0)))
INVERSE_FACTORIAL = 1.0 / FACTORIAL

Shape = tuple[float, ...]
"""One entry a mode: its length is a constant to the compiler, so that short loops unroll."""


@compiled(inline=True, borrows=True)
def quintic(u0: float, d0: float, e0: float, u1: float, d1: float, e1: float, out: Array) -> None:
    """Coefficients (6,) of the quintic on [0, 1] with these values, slopes and curvatures."""
    rise = u1 - u0 - d0 - 0.5 * e0
    steep = d1 - d0 - e0
    bend = e1 - e0
    out[0] = u0
    out[1] = d0
    out[2] = 0.5 * e0
    out[3] = 10.0 * rise - 4.0 * steep + 0.5 * bend
    out[4] = -15.0 * rise + 7.0 * steep - bend
    out[5] = 6.0 * rise - 3.0 * steep + 0.5 * bend


@compiled(inline=True, borrows=True)
def solve_piece(
    z: Array, duration: float, rules: Array, generator: Array, coupled: bool, forces: Array,
    surface: Array, unbalance: Array, series: Array, work: Array, end: Array, shape: Shape,
) -> None:  # fmt: skip
    """Fill the power series of all coordinates on [0, 1] times `duration`, and sum them at 1.

    The recurrence runs on k! times the terms: its chain is then a product and two sums.

    Args:
        z: The coordinates at the start (2n,).
        duration: Length of the piece, steps.
        rules: The coefficients of the regime (ROWS, 2n).
        generator: The same where they are coupled (2n, 2n).
        coupled: Whether they are.
        forces: Of what acts beside the surface (6,): on the tool and between tool and workpiece,
            N; 1 if there is an unbalance, 2 if the damping varies too, and the three
            coefficients on [0, 1] of what it has more than at the target speed, N per m/step.
        surface: Coefficients (6,) of the surface met, on [0, 1].
        unbalance: The same of the force of an unbalance, N.
        series: Written (TERMS, 2n).
        work: Room (5, 2n + TERMS).
        end: Written: the coordinates at the end (2n,).
        shape: One entry a mode.
    """
    n = len(shape)
    unbalanced, varies = forces[2] != 0.0, forces[2] == 2.0
    for i in range(2 * n):
        work[0, i] = duration * rules[OWN, i]
        work[1, i] = duration * rules[PARTNER, i]
        work[2, i] = duration * rules[BY_SURFACE, i]
        work[3, i] = z[i]
        series[0, i] = z[i]
        end[i] = z[i]
    for k in range(TERMS - 1):
        met = surface[k] * FACTORIAL[k] if k < 6 else 0.0
        if coupled:
            for i in range(2 * n):
                total = work[2, i] * met
                for j in range(2 * n):
                    total += duration * generator[i, j] * work[3, j]
                work[4, i] = total
        else:
            for i in range(n):
                x, y = work[3, i], work[3, n + i]
                work[4, i] = (work[0, i] * x + work[2, i] * met) + work[1, i] * y
                work[4, n + i] = (work[0, n + i] * y + work[2, n + i] * met) + work[1, n + i] * x
        if k == 0 and (forces[0] != 0.0 or forces[1] != 0.0):
            on_tool, between = duration * forces[0], duration * forces[1]
            for i in range(2 * n):
                work[4, i] += rules[BY_TOOL_FORCE, i] * on_tool
                work[4, i] += rules[BY_CUTTING_FORCE, i] * between
        if unbalanced:
            if k < 6:
                turning = duration * unbalance[k] * FACTORIAL[k]
                for i in range(2 * n):
                    work[4, i] += rules[BY_UNBALANCE, i] * turning
            if varies:
                rate = 0.0
                for i in range(2 * n):
                    rate += rules[RELATIVE_RATE_ROW, i] * work[3, i]
                work[4, 2 * n + k] = rate
                damped = forces[3] * rate
                if k >= 1:
                    damped += forces[4] * k * work[4, 2 * n + k - 1]
                if k >= 2:
                    damped += forces[5] * k * (k - 1.0) * work[4, 2 * n + k - 2]
                for i in range(2 * n):
                    work[4, i] += rules[BY_CUTTING_FORCE, i] * (duration * damped)
        for i in range(2 * n):
            work[3, i] = work[4, i]
            series[k + 1, i] = work[4, i] * INVERSE_FACTORIAL[k + 1]
            end[i] += series[k + 1, i]


@compiled(borrows=True, apart=True)
def coordinates_at(series: Array, place: float, z: Array, shape: Shape) -> None:
    """Write the coordinates (2n,) at `place` of a solved piece."""
    for i in range(2 * len(shape)):
        z[i] = series[TERMS - 1, i]
    for k in range(TERMS - 2, -1, -1):
        for i in range(2 * len(shape)):
            z[i] = z[i] * place + series[k, i]


@compiled(merged=True, borrows=True)
def whole_step(
    z: Any, rules: Array, step_matrix: Array, coupled: bool, in_cut: bool,
    u0: float, d0: float, e0: float, u1: float, d1: float, e1: float, end: Any,
    shape: Shape,
) -> Any:  # fmt: skip
    """`end` as the coordinates (2n,) after a whole step that meets the quintic of these ends."""
    n = len(shape)
    if coupled:
        for i in range(2 * n):
            total = 0.0
            for j in range(2 * n):
                total += step_matrix[i, j] * z[j]
            end = with_entry(end, i, total)
    else:
        for i in range(n):
            x, y = z[i], z[n + i]
            end = with_entry(end, i, rules[STEP_OWN, i] * x + rules[STEP_PARTNER, i] * y)
            end = with_entry(
                end, n + i, rules[STEP_OWN, n + i] * y + rules[STEP_PARTNER, n + i] * x
            )
    if in_cut:
        for i in range(2 * n):
            more = (
                (rules[STEP_SURFACE, i] * u0 + rules[STEP_SURFACE + 1, i] * d0)
                + (rules[STEP_SURFACE + 2, i] * e0 + rules[STEP_SURFACE + 3, i] * u1)
                + (rules[STEP_SURFACE + 4, i] * d1 + rules[STEP_SURFACE + 5, i] * e1)
            )
            end = with_entry(end, i, end[i] + more)
    return end


@compiled(merged=True, borrows=True)
def add_held_forces(rules: Array, on_tool: float, between: float, end: Any, shape: Shape) -> Any:
    """`end` with what forces, N, held for a whole step have done."""
    for i in range(2 * len(shape)):
        more = rules[STEP_TOOL_FORCE, i] * on_tool + rules[STEP_CUTTING_FORCE, i] * between
        end = with_entry(end, i, end[i] + more)
    return end


@compiled(merged=True, borrows=True)
def add_unbalance(
    rules: Array, f0: float, g0: float, h0: float, f1: float, g1: float, h1: float, end: Any,
    shape: Shape,
) -> Any:  # fmt: skip
    """`end` with what the force of an unbalance has done in a whole step, by its ends, N."""
    for i in range(2 * len(shape)):
        more = (
            (rules[STEP_UNBALANCE, i] * f0 + rules[STEP_UNBALANCE + 1, i] * g0)
            + (rules[STEP_UNBALANCE + 2, i] * h0 + rules[STEP_UNBALANCE + 3, i] * f1)
            + (rules[STEP_UNBALANCE + 4, i] * g1 + rules[STEP_UNBALANCE + 5, i] * h1)
        )
        end = with_entry(end, i, end[i] + more)
    return end


@compiled(inline=True, borrows=True)
def read_outputs(outputs: Array, z: Any, out: Array, shape: Shape) -> None:
    """What the coordinates mean (OUTPUTS,), by the outputs (2n + 1, OUTPUTS) of the regime."""
    for j in range(OUTPUTS):
        out[j] = outputs[2 * len(shape), j]
    for i in range(2 * len(shape)):
        for j in range(OUTPUTS):
            out[j] += outputs[i, j] * z[i]


@compiled(inline=True, borrows=True)
def value_and_slope(series: Array, place: float) -> tuple[float, float]:
    """A power series (TERMS,) and its derivative at `place`."""
    value, slope = series[TERMS - 1], 0.0
    for k in range(TERMS - 2, -1, -1):
        slope = slope * place + value
        value = value * place + series[k]
    return value, slope
