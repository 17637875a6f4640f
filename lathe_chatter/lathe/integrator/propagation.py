"""The exact solution of the machine over a piece of time with one regime and a quintic input.

Within a piece neither contact nor cutting changes, so the machine is linear with the surface
U(t) that the tool meets as its only input, and the displacements are power series in time:

    a_{k+2} = dt^2 / ((k+1)(k+2)) [xi/m - omega^2 a_k - C w/m (a_k - b_k - U_k)]
              - 2 zeta omega dt / (k+2) a_{k+1}

for the tool, and with the bearing for the workpiece b (equations (8a) and (8b), term by term).
With |lambda| dt <= 0.12 the terms fall faster than 0.12^k/k!, so the series ends at rounding
level: nothing is approximated but U, which is a quintic through U, U' and U'' at both ends.

Whole steps repeat with the same length, so for them the series is summed once per regime
into a matrix; the pieces around an event are summed as they come.
"""

from __future__ import annotations

import numpy as np

from lathe_chatter.arrays import Array
from lathe_chatter.compiled import compiled

TERMS = 13
"""Coefficients of a series: 0.12^13/13! is 2e-22."""
_SQUARES = np.array([1.0 / ((k + 1.0) * (k + 2.0)) for k in range(TERMS - 2)])
_INVERSES = np.array([1.0 / (k + 2.0) for k in range(TERMS - 2)])
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

ROWS = 14
FORCE_ROW = 11
"""Of the matrix of a regime, see `step_matrices`."""
OUT_OF_CUT, IN_CUT, ENGAGED = 0, 1, 2
REGIMES = 4
"""A regime is the sum of IN_CUT and ENGAGED where they hold."""


@compiled(borrows=True)
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


@compiled(borrows=True)
def solve_piece(
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
    on_tool = square * mechanics[TOOL_CUTTING] if cutting else 0.0
    on_workpiece = square * mechanics[WORKPIECE_CUTTING] if cutting else 0.0
    bearing = square * mechanics[BEARING_STIFFNESS] if regime & ENGAGED != 0 else 0.0
    tool_spring = square * mechanics[TOOL_STIFFNESS]
    workpiece_spring = square * mechanics[WORKPIECE_STIFFNESS] + bearing
    tool_damping = mechanics[TOOL_DAMPING] * duration
    workpiece_damping = mechanics[WORKPIECE_DAMPING] * duration
    # The last two coefficients stay in registers: each term waits for the one before.
    a0, a1 = state[0], state[1] * duration
    b0, b1 = state[2], state[3] * duration
    push_tool = square * force * mechanics[TOOL_COMPLIANCE]
    push_workpiece = bearing * mechanics[CLEARANCE]
    tool[0], tool[1], workpiece[0], workpiece[1] = a0, a1, b0, b1
    for k in range(TERMS - 2):
        chip = a0 - b0
        if k < 6:
            chip -= surface[k]
        pull_tool = push_tool - tool_spring * a0 - on_tool * chip
        pull_workpiece = push_workpiece - workpiece_spring * b0 + on_workpiece * chip
        push_tool = 0.0
        push_workpiece = 0.0
        a2 = _SQUARES[k] * pull_tool - (_INVERSES[k] * tool_damping) * a1
        b2 = _SQUARES[k] * pull_workpiece - (_INVERSES[k] * workpiece_damping) * b1
        tool[k + 2], workpiece[k + 2] = a2, b2
        a0, a1, b0, b1 = a1, a2, b1, b2


@compiled(borrows=True)
def value_at(series: Array, terms: int, place: float) -> float:
    """A power series at `place`."""
    total: float = series[terms - 1]
    for k in range(terms - 2, -1, -1):
        total = total * place + series[k]
    return total


@compiled(borrows=True)
def slope_at(series: Array, terms: int, place: float) -> float:
    """The derivative of a power series at `place`."""
    total: float = (terms - 1) * series[terms - 1]
    for k in range(terms - 2, 0, -1):
        total = total * place + k * series[k]
    return total


@compiled(inline=True, borrows=True)
def value_and_slope(series: Array, terms: int, place: float) -> tuple[float, float]:
    """A power series and its derivative at `place`."""
    value, slope = series[terms - 1], 0.0
    for k in range(terms - 2, -1, -1):
        slope = slope * place + value
        value = value * place + series[k]
    return value, slope


@compiled(inline=True, borrows=True)
def state_at(tool: Array, workpiece: Array, place: float, duration: float, state: Array) -> None:
    """Write the state (4,) at `place` of a solved piece that lasts `duration`, s."""
    state[0], tool_slope = value_and_slope(tool, TERMS, place)
    state[2], workpiece_slope = value_and_slope(workpiece, TERMS, place)
    state[1], state[3] = tool_slope / duration, workpiece_slope / duration


@compiled(inline=True, borrows=True)
def response(
    m0: float, m1: float, m2: float, m3: float, m4: float, m5: float, m6: float, m7: float,
    m8: float, m9: float, m10: float, x0: float, x1: float, x2: float, x3: float,
    u0: float, u1: float, u2: float, u3: float, u4: float, u5: float,
) -> float:  # fmt: skip
    """One component of the state after a whole step: a row of the matrix times its inputs.

    The order of the sums is stated here once, for one lathe and for many: equal bits.
    """
    return (
        (m0 * x0 + m1 * x1) + (m2 * x2 + m3 * x3)
        + ((m4 * u0 + m5 * u1) + (m6 * u2 + m7 * u3))
        + ((m8 * u4 + m9 * u5) + m10)
    )  # fmt: skip


@compiled(inline=True, borrows=True)
def whole_step(
    m: Array, x0: float, x1: float, x2: float, x3: float,
    u0: float, u1: float, u2: float, u3: float, u4: float, u5: float,
) -> tuple[float, float, float, float]:  # fmt: skip
    """The state after a whole step by the matrix of its regime.

    Args:
        m: The matrix of the regime (ROWS, 4).
        x0: Tool displacement at the start; x1 its velocity, x2 and x3 those of the workpiece.
        u0: The surface at the start; u1 and u2 its derivatives by time, u3 to u5 at the end.

    Returns:
        The state at the end, in the same order.
    """
    return (
        response(
            m[0, 0], m[1, 0], m[2, 0], m[3, 0], m[4, 0], m[5, 0], m[6, 0], m[7, 0], m[8, 0],
            m[9, 0], m[10, 0], x0, x1, x2, x3, u0, u1, u2, u3, u4, u5,
        ),
        response(
            m[0, 1], m[1, 1], m[2, 1], m[3, 1], m[4, 1], m[5, 1], m[6, 1], m[7, 1], m[8, 1],
            m[9, 1], m[10, 1], x0, x1, x2, x3, u0, u1, u2, u3, u4, u5,
        ),
        response(
            m[0, 2], m[1, 2], m[2, 2], m[3, 2], m[4, 2], m[5, 2], m[6, 2], m[7, 2], m[8, 2],
            m[9, 2], m[10, 2], x0, x1, x2, x3, u0, u1, u2, u3, u4, u5,
        ),
        response(
            m[0, 3], m[1, 3], m[2, 3], m[3, 3], m[4, 3], m[5, 3], m[6, 3], m[7, 3], m[8, 3],
            m[9, 3], m[10, 3], x0, x1, x2, x3, u0, u1, u2, u3, u4, u5,
        ),
    )  # fmt: skip


@compiled(inline=True, borrows=True)
def bend(
    a0: float, a1: float, a2: float, a3: float, on_surface: float, on_force: float,
    constant: float, x0: float, x1: float, x2: float, x3: float, met: float, force: float,
) -> float:  # fmt: skip
    """r'' from the last rows of a matrix, in one order of the sums like `response`."""
    return ((a0 * x0 + a1 * x1) + (a2 * x2 + a3 * x3)) + (
        (on_surface * met + on_force * force) + constant
    )


@compiled(inline=True, borrows=True)
def relative_acceleration(
    m: Array, x0: float, x1: float, x2: float, x3: float, met: float,
    force: float,
) -> float:  # fmt: skip
    """r'' = x_t'' - x_wp'' of a state that meets the surface at `met`, m/s2."""
    return bend(
        m[12, 0], m[12, 1], m[12, 2], m[12, 3], m[13, 0], m[13, 1], m[13, 2],
        x0, x1, x2, x3, met, force,
    )  # fmt: skip


@compiled()
def step_matrices(step: float, mechanics: Array) -> Array:
    """The exact response to a whole step in each regime (REGIMES, ROWS, 4).

    Rows 0-9 are what one unit of an input adds to the state (4) at the end: the state (4) at
    the start, U, U' and U'' at the start and then at the end of the step; row 10 is what the
    bearing's clearance adds, row 11 what a force of 1 N on the tool does. They are sums of the
    same series as a piece: no second method. Rows 12 and 13 are the relative acceleration per
    unit of the state (4), then of U, of a force on the tool, and its constant part.
    """
    result = np.zeros((REGIMES, ROWS, 4))
    tool, workpiece = np.zeros(TERMS), np.zeros(TERMS)
    surface, state, ends = np.zeros(6), np.zeros(4), np.zeros(6)
    bare = mechanics.copy()
    bare[CLEARANCE] = 0.0
    for regime in range(REGIMES):
        for source in range(12):
            state[:] = 0.0
            ends[:] = 0.0
            if source < 4:
                state[source] = 1.0
            elif source < 10:
                order = (source - 4) % 3
                ends[source - 4] = 1.0 if order == 0 else step if order == 1 else step * step
            quintic(ends[0], ends[1], ends[2], ends[3], ends[4], ends[5], surface)
            constants = mechanics if source == 10 else bare
            force = 1.0 if source == FORCE_ROW else 0.0
            solve_piece(state, step, regime, constants, force, surface, tool, workpiece)
            state_at(tool, workpiece, 1.0, step, state)
            result[regime, source] = state
        cutting = 0.0
        if regime & IN_CUT != 0:
            cutting = mechanics[TOOL_CUTTING] + mechanics[WORKPIECE_CUTTING]
        bearing = mechanics[BEARING_STIFFNESS] if regime & ENGAGED != 0 else 0.0
        result[regime, 12, 0] = -mechanics[TOOL_STIFFNESS] - cutting
        result[regime, 12, 1] = -mechanics[TOOL_DAMPING]
        result[regime, 12, 2] = mechanics[WORKPIECE_STIFFNESS] + bearing + cutting
        result[regime, 12, 3] = mechanics[WORKPIECE_DAMPING]
        result[regime, 13, 0] = cutting
        result[regime, 13, 1] = mechanics[TOOL_COMPLIANCE]
        result[regime, 13, 2] = -bearing * mechanics[CLEARANCE]
    return result
