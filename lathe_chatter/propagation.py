"""The exact solution of the machine over a piece of time with one regime and a quintic input.

Within a piece neither contact nor cutting changes, so the machine is linear with the surface
U(t) that the tool meets as its only input, and the displacements are power series in time:

    (k+2)(k+1) a_{k+2} = dt^2 [xi/m - omega^2 a_k - C w/m (a_k - b_k - U_k)]
                         - 2 zeta omega dt (k+1) a_{k+1}

for the tool, and with the bearing for the workpiece b (equations (8a) and (8b), term by term).
With |lambda| dt <= 0.12 the terms fall faster than 0.12^k/k!, so the series ends at rounding
level: nothing is approximated but U, which is a quintic through U, U' and U'' at both ends.

Whole steps repeat with the same length, so for them the series is summed once per regime
into a matrix; the pieces around an event are summed as they come.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from lathe_chatter.model import Array

TERMS = 14
"""Coefficients of a series: 0.12^14/14! is 1e-24."""
RATE_STEP = 0.12
"""Largest |lambda| dt of a step, see `TERMS`."""

# The mechanical constants of a machine with its cut, in one vector.
(
    TOOL_STIFFNESS,  # k_t / m_t
    TOOL_DAMPING,  # c_t / m_t
    TOOL_CUTTING,  # C w / m_t
    TOOL_COMPLIANCE,  # 1 / m_t
    WORKPIECE_STIFFNESS,  # k_wp / m_wp
    WORKPIECE_DAMPING,  # c_wp / m_wp
    WORKPIECE_CUTTING,  # C w / m_wp
    BEARING_STIFFNESS,  # k_bc / m_wp
    CLEARANCE,  # gamma
) = range(9)
MECHANICS_SIZE = 9

# The inputs of a whole step: the state at its start, the surface at both ends, what is constant.
INPUTS = 12
OUT_OF_CUT, IN_CUT, ENGAGED = 0, 1, 2
REGIMES = 4
"""A regime is the sum of IN_CUT and ENGAGED where they hold."""


@njit(cache=True, error_model='numpy')
def quintic(  # noqa: PLR0913, PLR0917 -- value and two derivatives at both ends
    u0: float, d0: float, e0: float, u1: float, d1: float, e1: float, out: Array
) -> None:
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


@njit(cache=True, error_model='numpy')
def solve_piece(  # noqa: PLR0913, PLR0917 -- the inner loop takes plain numbers
    state: Array,
    duration: float,
    regime: int,
    mechanics: Array,
    force: float,
    surface: Array,
    tool: Array,
    workpiece: Array,
) -> None:
    """Fill the power series (TERMS,) of both displacements on [0, 1] times `duration`.

    Args:
        state: Tool and workpiece displacement and velocity at the start (4,).
        duration: Length of the piece, s.
        regime: Sum of IN_CUT and ENGAGED.
        mechanics: The constants of machine and cut.
        force: A constant force on the tool, N.
        surface: Coefficients (6,) of the surface that the tool meets, on [0, 1].
        tool: Written: series of the tool displacement.
        workpiece: Written: series of the workpiece displacement.
    """
    square = duration * duration
    cutting = regime & IN_CUT != 0
    on_tool = mechanics[TOOL_CUTTING] if cutting else 0.0
    on_workpiece = mechanics[WORKPIECE_CUTTING] if cutting else 0.0
    bearing = mechanics[BEARING_STIFFNESS] if regime & ENGAGED != 0 else 0.0
    tool_spring = mechanics[TOOL_STIFFNESS]
    workpiece_spring = mechanics[WORKPIECE_STIFFNESS] + bearing
    tool_damping = mechanics[TOOL_DAMPING] * duration
    workpiece_damping = mechanics[WORKPIECE_DAMPING] * duration
    tool[0] = state[0]
    tool[1] = state[1] * duration
    workpiece[0] = state[2]
    workpiece[1] = state[3] * duration
    push_tool = force * mechanics[TOOL_COMPLIANCE]
    push_workpiece = bearing * mechanics[CLEARANCE]
    for k in range(TERMS - 2):
        chip = tool[k] - workpiece[k]
        if k < 6:
            chip -= surface[k]
        pull_tool = push_tool - tool_spring * tool[k] - on_tool * chip
        pull_workpiece = push_workpiece - workpiece_spring * workpiece[k] + on_workpiece * chip
        push_tool = 0.0
        push_workpiece = 0.0
        scale = 1.0 / ((k + 1.0) * (k + 2.0))
        tool[k + 2] = scale * (square * pull_tool - tool_damping * (k + 1.0) * tool[k + 1])
        workpiece[k + 2] = scale * (
            square * pull_workpiece - workpiece_damping * (k + 1.0) * workpiece[k + 1]
        )


@njit(cache=True, error_model='numpy')
def value_at(series: Array, terms: int, place: float) -> float:
    """A power series at `place`."""
    total: float = series[terms - 1]
    for k in range(terms - 2, -1, -1):
        total = total * place + series[k]
    return total


@njit(cache=True, error_model='numpy')
def slope_at(series: Array, terms: int, place: float) -> float:
    """The derivative of a power series at `place`."""
    total: float = (terms - 1) * series[terms - 1]
    for k in range(terms - 2, 0, -1):
        total = total * place + k * series[k]
    return total


@njit(cache=True, error_model='numpy')
def end_state(tool: Array, workpiece: Array, duration: float, state: Array) -> None:
    """Write the state (4,) at the end of a solved piece."""
    state[0] = value_at(tool, TERMS, 1.0)
    state[1] = slope_at(tool, TERMS, 1.0) / duration
    state[2] = value_at(workpiece, TERMS, 1.0)
    state[3] = slope_at(workpiece, TERMS, 1.0) / duration


@njit(cache=True, error_model='numpy', inline='always')
def whole_step(  # noqa: PLR0913, PLR0917 -- plain arrays
    state: Array, ends: Array, matrices: Array, regime: int, force: float, end: Array
) -> None:
    """Write the state (4,) after a whole step, by `step_matrices`.

    `ends` holds the surface with its first two derivatives by time at both ends (6,).
    """
    x0, x1, x2, x3 = state[0], state[1], state[2], state[3]
    u0, u1, u2, u3, u4, u5 = ends[0], ends[1], ends[2], ends[3], ends[4], ends[5]
    for k in range(4):
        end[k] = (
            (matrices[regime, 0, k] * x0 + matrices[regime, 1, k] * x1)
            + (matrices[regime, 2, k] * x2 + matrices[regime, 3, k] * x3)
        ) + (
            (matrices[regime, 4, k] * u0 + matrices[regime, 5, k] * u1)
            + (matrices[regime, 6, k] * u2 + matrices[regime, 7, k] * u3)
            + (matrices[regime, 8, k] * u4 + matrices[regime, 9, k] * u5)
            + (matrices[regime, 10, k] * force + matrices[regime, 11, k])
        )


@njit(cache=True, error_model='numpy')
def step_matrices(step: float, mechanics: Array) -> Array:
    """The exact response (REGIMES, INPUTS, 4) of the state after a whole step to each input.

    Inputs: the state (4), then U, U' and U'' at the start and U, U' and U'' at the end of the
    step (6, in SI), a constant force of 1 N on the tool, and the number 1 (the bearing's
    clearance). The columns are sums of the same series as a piece: no second method.
    """
    result = np.zeros((REGIMES, INPUTS, 4))
    tool, workpiece = np.zeros(TERMS), np.zeros(TERMS)
    surface, state, ends = np.zeros(6), np.zeros(4), np.zeros(6)
    bare = mechanics.copy()
    bare[CLEARANCE] = 0.0
    for regime in range(REGIMES):
        for source in range(INPUTS):
            state[:] = 0.0
            ends[:] = 0.0
            force = 0.0
            if source < 4:
                state[source] = 1.0
            elif source < 10:
                order = (source - 4) % 3
                ends[source - 4] = 1.0 if order == 0 else step if order == 1 else step * step
            elif source == 10:
                force = 1.0
            quintic(ends[0], ends[1], ends[2], ends[3], ends[4], ends[5], surface)
            constants = mechanics if source == 11 else bare
            solve_piece(state, step, regime, constants, force, surface, tool, workpiece)
            end_state(tool, workpiece, step, state)
            result[regime, source] = state
    return result
