"""Where a piece of a step ends, and which surface the tool meets there.

A piece ends where the step does, unless before that the tool meets a corner in the surface of
the turn before, a speed ramp ends, or the surface met is finer than the step.
"""

from __future__ import annotations

from typing import NamedTuple

from lathe_chatter.arrays import Array, Integers
from lathe_chatter.compiled import compiled
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.lathe.integrator import surface
from lathe_chatter.lathe.integrator.spindle import speed_and_slope, time_to_turn, turned

DETAIL = 1.5
"""A piece may meet this many steps' worth of surface, as finely as that was cut."""


class Scratch(NamedTuple):
    """Room to work in, so that no piece has to ask for memory."""

    piece: Array  # (PIECE_SIZE,)
    end: Array  # state at the end of the piece (4,)
    tool: Array  # power series of the piece (TERMS,)
    workpiece: Array  # the same
    hold: Array  # the quintic of the surface met (6,)
    margin: Array  # of an event (TERMS,)


# The surface at both ends of a piece, by time, and what belongs to its far end.
(
    MET_0, RATE_0, BEND_0, MET_1, RATE_1, BEND_1,  # m, m/s, m/s2
    DURATION, ANGLE_1, ANGLE_LOW_1, FED_1, FED_LOW_1, SPEED_1, SPEED_SLOPE_1,
    HEIGHT_1, SLOPE_1, CURVATURE_1,  # of the surface met there, by angle
) = range(16)  # fmt: skip
PIECE_SIZE = 16


@compiled(inline=True, borrows=True)
def add(high: float, low: float, increment: float) -> tuple[float, float]:
    """Compensated addition: a turn of 10^5 steps sums as exactly as one step."""
    increment += low
    total = high + increment
    return total, increment - (total - high)


@compiled(inline=True, borrows=True)
def plan_piece(
    numbers: Array, counts: Integers, nodes: Array, settings: Array, slope: float, limit: float,
    merge: float, piece: Array,
) -> tuple[int, bool, bool]:  # fmt: skip
    """Where a piece of at most `limit` s ends, and what the tool meets there, into `piece`.

    Returns:
        The node at or before the place met, whether it is just there, whether a ramp ends.
    """
    speed, phase = numbers[layout.SPEED], numbers[layout.PHASE]
    variation = settings[layout.VARIATION]
    frequency = settings[layout.VARIATION_FREQUENCY]
    steady = slope == 0.0 and variation == 0.0
    duration, ramp_ends = limit, False
    if slope != 0.0:
        to_target = (settings[layout.TARGET_SPEED] - speed) / slope
        ramp_ends = to_target <= limit + merge
        if to_target < limit - merge:
            duration = to_target
    rise = speed * duration
    if not steady:
        rise = turned(duration, speed, slope, variation, phase, frequency)
    node = counts[layout.POINTER]
    pitch = nodes[node + 1, surface.PITCH]
    if rise > DETAIL * pitch:
        duration, ramp_ends = duration * (0.8 * DETAIL * pitch / rise), False
        rise = speed * duration
        if not steady:
            rise = turned(duration, speed, slope, variation, phase, frequency)
    angle, angle_low = numbers[layout.ANGLE], numbers[layout.ANGLE_LOW]
    piece[ANGLE_1], piece[ANGLE_LOW_1] = add(angle, angle_low, rise)
    place, near, at_node = piece[ANGLE_1] - 1.0, merge * speed, False
    while nodes[node + 1, surface.ANGLE] < place - near:
        node += 1
        if nodes[node, surface.ORDER] <= surface.LAST_ORDER:
            rise = nodes[node, surface.ANGLE] + 1.0 - angle - angle_low
            duration, ramp_ends, at_node = rise / speed, False, True
            if not steady:
                duration = time_to_turn(rise, speed, slope, variation, phase, frequency)
            piece[ANGLE_1], piece[ANGLE_LOW_1] = add(angle, angle_low, rise)
            break
    if not at_node and nodes[node + 1, surface.ANGLE] <= place + near:
        node, at_node = node + 1, True

    if at_node:
        piece[HEIGHT_1] = nodes[node, surface.HEIGHT]
        piece[SLOPE_1] = nodes[node, surface.SLOPE_BEFORE]
        piece[CURVATURE_1] = nodes[node, surface.CURVATURE_BEFORE]
    else:
        piece[HEIGHT_1], piece[SLOPE_1], piece[CURVATURE_1] = surface.surface_at(
            nodes, node, place
        )
    piece[DURATION] = duration
    piece[SPEED_1], piece[SPEED_SLOPE_1] = speed, 0.0
    if not steady:
        piece[SPEED_1], piece[SPEED_SLOPE_1] = speed_and_slope(
            speed + slope * duration, slope, variation, phase + frequency * duration, frequency
        )
    feed = settings[layout.FEED_SPEED]
    piece[FED_1], piece[FED_LOW_1] = add(
        numbers[layout.FED], numbers[layout.FED_LOW], feed * duration
    )
    piece[MET_1] = piece[HEIGHT_1] - piece[FED_1]
    piece[RATE_1] = piece[SLOPE_1] * piece[SPEED_1] - feed
    piece[BEND_1] = (
        piece[CURVATURE_1] * (piece[SPEED_1] * piece[SPEED_1])
        + piece[SLOPE_1] * piece[SPEED_SLOPE_1]
    )
    return node, at_node, ramp_ends
