"""The pieces of a step solved as power series, and the first event inside one."""

from __future__ import annotations

from typing import NamedTuple

from lathe_chatter.array_types import Array
from lathe_chatter.compiled import compiled
from lathe_chatter.lathe.integrator import piece_plan as at
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.lathe.integrator.first_crossing import NEVER, first_crossing, may_turn_back
from lathe_chatter.lathe.integrator.propagation import TERMS, WEIGHTS, quintic, solve_piece
from lathe_chatter.lathe.integrator.simd_vectors import LANES, before, fma, lanes_at, put, spread
from lathe_chatter.lathe.integrator.state_layout import (
    BEARING_V,
    BEARING_X,
    TOOL_V,
    TOOL_X,
    WORKPIECE_V,
    WORKPIECE_X,
)

ABOVE, BELOW, CHIP, NOTHING = 0, 1, 2, -1
"""What is watched: either side of the bearing, and the chip."""


class Machine(NamedTuple):
    """The coefficients of all regimes, see `coefficients.Constants`."""

    rules: Array  # (REGIMES, ROWS, 2n)
    outputs: Array  # (REGIMES, 2n + 1, OUTPUTS)
    direct: Array  # (REGIMES, DIRECT)
    answers: Array  # (REGIMES, 2n SERIES, SERIES_SIZE)
    moves: Array  # (REGIMES, REGIMES, 2n + 1, 2n)
    matrices: Array  # (REGIMES, 2, 2n, 2n)


class Scratch(NamedTuple):
    """Room to work in, so that no piece has to ask for memory."""

    piece: Array  # by the names of piece_plan.py (14,) and more
    end: Array  # coordinates at the end of the piece (2n,)
    other: Array  # coordinates (2n,)
    seen: Array  # what they mean (1, OUTPUTS)
    series: Array  # (2n, TERMS)
    work: Array  # (3, 2n + TERMS)
    given: Array  # the surface met and the force of an unbalance (2, TERMS)
    forces: Array  # (6,)
    margin: Array  # of an event (1, TERMS + 1)
    block: Array  # of plain steps (step_block_layout.ROWS, LANES)
    moved: Array  # the coordinates in it (2n, LANES)


@compiled(inline=True, borrows=True, inner=True)
def solve_series(
    z: Array, regime: int, machine: Machine, scratch: Scratch, f0: float, g0: float, h0: float,
    f1: float, g1: float, h1: float,
) -> bool:  # fmt: skip
    """The series of the planned piece; the ends of the force of an unbalance are given by time.

    Returns:
        Whether all of its terms count, see `propagation.solve_piece`.
    """
    piece, duration = scratch.piece, scratch.piece[at.DURATION]
    square = duration * duration
    quintic(
        piece[at.MET_0], piece[at.RATE_0] * duration, piece[at.BEND_0] * square,
        piece[at.MET_1], piece[at.RATE_1] * duration, piece[at.BEND_1] * square, scratch.given, 0,
    )  # fmt: skip
    if scratch.forces[2] != 0.0:
        quintic(f0, g0 * duration, h0 * square, f1, g1 * duration, h1 * square, scratch.given, 1)
    return solve_piece(
        z, duration, machine.rules[regime], machine.answers[regime], machine.matrices[regime, 0],
        machine.direct[regime], scratch.forces, scratch.given, scratch.series, scratch.work,
        scratch.end,
    )  # fmt: skip


@compiled(inline=True, borrows=True, inner=True)
def first_event(
    numbers: Array, regime: int, outputs: Array, settings: Array, scratch: Scratch, wide: bool
) -> tuple[float, int]:
    """The first event in a solved piece, if there is one.

    Args:
        numbers: The remembered numbers, at the start of the piece.
        regime: There.
        outputs: What the coordinates mean in it (2n + 1, OUTPUTS).
        settings: What machine and cut ask for.
        scratch: With the outputs at the end of the piece, and its series.
        wide: Whether all terms of that count.

    Returns:
        Its place in [0, 1] or `NEVER`, and what it is.
    """
    piece, seen = scratch.piece, scratch.seen
    duration, clearance = piece[at.DURATION], settings[layout.CLEARANCE]
    touch, place, event = regime >> 1, NEVER, NOTHING
    for kind in range(3):
        if kind == CHIP:
            if settings[layout.MAY_LEAVE_CUT] == 0.0:
                continue
            side = 1.0 if regime & layout.IN_CUT != 0 else -1.0
            start = side * (numbers[layout.RELATIVE] - piece[at.MET_0])
            slope = side * (numbers[layout.RELATIVE_RATE] - piece[at.RATE_0])
            end = side * (seen[0, TOOL_X] - seen[0, WORKPIECE_X] - piece[at.MET_1])
            slope_end = side * (seen[0, TOOL_V] - seen[0, WORKPIECE_V] - piece[at.RATE_1])
        else:
            elsewhere = touch != layout.FREE and touch != kind + 1
            if settings[layout.SIDES] <= kind or elsewhere:
                continue
            sign = 1.0 if kind == ABOVE else -1.0
            side = -sign if touch == layout.FREE else sign
            start = side * (numbers[layout.AT_BEARING] - sign * clearance)
            slope = side * numbers[layout.AT_BEARING_RATE]
            end = side * (seen[0, BEARING_X] - sign * clearance)
            slope_end = side * seen[0, BEARING_V]
        if not may_turn_back(start, slope, end, slope_end, duration):
            continue
        last = _margin(start, side, kind == CHIP, outputs, scratch, wide)
        found = first_crossing(scratch.margin[0], last, end, slope_end * duration)
        if found < place:
            place, event = found, kind
    return (place, event) if place <= 1.0 else (NEVER, NOTHING)


@compiled(inline=True, borrows=True, inner=True)
def _margin(
    start: float, side: float, of_chip: bool, outputs: Array, scratch: Scratch, wide: bool
) -> int:
    """Write the power series of a margin that begins with `start`; its last term that counts."""
    low, high = spread(0.0), spread(0.0)
    for i in range(scratch.series.shape[0]):
        share = outputs[i, BEARING_X]
        if of_chip:
            share = outputs[i, TOOL_X] - outputs[i, WORKPIECE_X]
        low = fma(side * share, lanes_at(scratch.series, i, 0), low)
        if wide:
            high = fma(side * share, lanes_at(scratch.series, i, LANES), high)
    if of_chip:
        low = fma(-side, before(lanes_at(scratch.given, 0, 0)), low)
    scratch.margin[0, 0] = start
    put(scratch.margin, 0, 1, low * lanes_at(WEIGHTS, 0, 0))
    if wide:
        put(scratch.margin, 0, 1 + LANES, high * lanes_at(WEIGHTS, 0, LANES))
    return TERMS if wide else LANES


@compiled(inline=True, borrows=True, inner=True)
def kind_of(event: int, regime: int) -> tuple[int, int]:
    """The kind of an event as it is told, and the regime after it."""
    if event == CHIP:
        leaves = regime & layout.IN_CUT != 0
        return layout.TOOL_LEAVES if leaves else layout.TOOL_ENTERS, regime ^ layout.IN_CUT
    if regime >> 1 == layout.FREE:
        return layout.BEARING_ENGAGES, regime + 2 * (event + 1)
    return layout.BEARING_RELEASES, regime & layout.IN_CUT
