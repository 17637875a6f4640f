"""The pieces of a step solved as power series, and the first event inside one."""

from __future__ import annotations

from typing import NamedTuple

from lathe_chatter.arrays import Array
from lathe_chatter.compiled import compiled
from lathe_chatter.lathe.integrator import piece as at
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.lathe.integrator.events import NEVER, first_crossing, may_turn_back
from lathe_chatter.lathe.integrator.propagation import TERMS, Shape, quintic, solve_piece
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
    moves: Array  # (REGIMES, REGIMES, 2n + 1, 2n)
    matrices: Array  # (REGIMES, 2, 2n, 2n)


class Scratch(NamedTuple):
    """Room to work in, so that no piece has to ask for memory."""

    piece: Array  # (PIECE_SIZE,)
    end: Array  # coordinates at the end of the piece (2n,)
    seen: Array  # what they mean (OUTPUTS,)
    series: Array  # (TERMS, 2n)
    work: Array  # (5, 2n + TERMS)
    hold: Array  # the quintic of the surface met (6,)
    turning: Array  # that of the force of an unbalance (6,)
    forces: Array  # (6,)
    margin: Array  # of an event (TERMS,)
    room: Array  # for coordinates (2, 2n)


@compiled(inline=True, borrows=True)
def solve_series(
    z: Array, regime: int, machine: Machine, scratch: Scratch, ends: tuple[float, ...],
    shape: Shape,
) -> None:  # fmt: skip
    """The power series of the planned piece; `ends` are those of the force of an unbalance."""
    piece = scratch.piece
    duration = piece[at.DURATION]
    square = duration * duration
    quintic(
        piece[at.MET_0], piece[at.RATE_0] * duration, piece[at.BEND_0] * square,
        piece[at.MET_1], piece[at.RATE_1] * duration, piece[at.BEND_1] * square, scratch.hold,
    )  # fmt: skip
    if scratch.forces[2] != 0.0:
        quintic(
            ends[0], ends[1] * duration, ends[2] * square,
            ends[3], ends[4] * duration, ends[5] * square, scratch.turning,
        )  # fmt: skip
    solve_piece(
        z, duration, machine.rules[regime], machine.matrices[regime, 0],
        machine.direct[regime, layout.COUPLED] != 0.0, scratch.forces, scratch.hold,
        scratch.turning, scratch.series, scratch.work, scratch.end, shape,
    )  # fmt: skip


@compiled(inline=True, borrows=True)
def first_event(
    numbers: Array, regime: int, machine: Machine, settings: Array, scratch: Scratch,
    solved: bool, shape: Shape,
) -> tuple[float, int, bool]:  # fmt: skip
    """The first event in the planned piece.

    Args:
        numbers: The remembered numbers, at the start of the piece.
        regime: There.
        machine: The coefficients.
        settings: What machine and cut ask for.
        scratch: With the outputs at the end of the piece, and the series if it is `solved`.
        solved: Whether the series is there; else the first margin that may turn back ends this.
        shape: One entry a mode.

    Returns:
        Its place in [0, 1] or `NEVER`, what it is, and whether the series is wanted.
    """
    piece, seen, margin = scratch.piece, scratch.seen, scratch.margin
    outputs, n2 = machine.outputs[regime], 2 * len(shape)
    duration, clearance = piece[at.DURATION], settings[layout.CLEARANCE]
    touch, place, event = regime >> 1, NEVER, NOTHING
    for kind in range(3):
        if kind == CHIP:
            if settings[layout.MAY_LEAVE_CUT] == 0.0:
                continue
            side = 1.0 if regime & layout.IN_CUT != 0 else -1.0
            start = side * (numbers[layout.RELATIVE] - piece[at.MET_0])
            slope = side * (numbers[layout.RELATIVE_RATE] - piece[at.RATE_0])
            end = side * (seen[TOOL_X] - seen[WORKPIECE_X] - piece[at.MET_1])
            slope_end = side * (seen[TOOL_V] - seen[WORKPIECE_V] - piece[at.RATE_1])
        else:
            elsewhere = touch != layout.FREE and touch != kind + 1
            if settings[layout.SIDES] <= kind or elsewhere:
                continue
            sign = 1.0 if kind == ABOVE else -1.0
            side = -sign if touch == layout.FREE else sign
            start = side * (numbers[layout.AT_BEARING] - sign * clearance)
            slope = side * numbers[layout.AT_BEARING_RATE]
            end = side * (seen[BEARING_X] - sign * clearance)
            slope_end = side * seen[BEARING_V]
        if not may_turn_back(start, slope, end, slope_end, duration):
            continue
        if not solved:
            return NEVER, NOTHING, True
        for k in range(TERMS):
            total = 0.0
            if kind == CHIP:
                for i in range(n2):
                    total += (outputs[i, TOOL_X] - outputs[i, WORKPIECE_X]) * scratch.series[k, i]
                if k < 6:
                    total -= scratch.hold[k]
            else:
                for i in range(n2):
                    total += outputs[i, BEARING_X] * scratch.series[k, i]
            margin[k] = side * total
        if kind == CHIP:
            margin[0] += side * (outputs[n2, TOOL_X] - outputs[n2, WORKPIECE_X])
        else:
            margin[0] += side * (outputs[n2, BEARING_X] - sign * clearance)
        found = first_crossing(margin, end, slope_end * duration)
        if found < place:
            place, event = found, kind
    return (place, event, False) if place <= 1.0 else (NEVER, NOTHING, False)


@compiled(inline=True, borrows=True)
def kind_of(event: int, regime: int) -> tuple[int, int]:
    """The kind of an event as it is told, and the regime after it."""
    if event == CHIP:
        leaves = regime & layout.IN_CUT != 0
        return layout.TOOL_LEAVES if leaves else layout.TOOL_ENTERS, regime ^ layout.IN_CUT
    if regime >> 1 == layout.FREE:
        return layout.BEARING_ENGAGES, regime + 2 * (event + 1)
    return layout.BEARING_RELEASES, regime & layout.IN_CUT
