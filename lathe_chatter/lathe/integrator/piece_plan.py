"""Where a piece of a step ends, and which surface the tool meets there.

A piece ends where the step does, unless before that the tool meets a corner in the surface of
the turn before, a speed ramp ends, or the surface met is finer than the step.
"""

from __future__ import annotations

import math

from lathe_chatter.array_types import Array, Integers
from lathe_chatter.compiled import compiled
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.lathe.integrator import surface
from lathe_chatter.lathe.integrator.spindle import speed_and_slope, time_to_turn, turned

DETAIL = 1.5
"""A piece may meet this many steps' worth of surface, as finely as that was cut."""

# The surface at both ends of a piece, by time, and what belongs to its far end.
(
    MET_0, RATE_0, BEND_0, MET_1, RATE_1, BEND_1,  # m, m/step, m/step2
    DURATION, PLACE_1, AHEAD_1, SPEED_1, ACCELERATION_1,
    HEIGHT_1, SLOPE_1, CURVATURE_1,  # of the surface met there, by place
) = range(14)  # fmt: skip


@compiled(inline=True, borrows=True, inner=True)
def by_time(
    slope: float, curvature: float, lead: float, speed: float, acceleration: float
) -> tuple[float, float]:
    """U' and U'' by time of a surface with this slope and curvature by place."""
    return (
        slope * speed - lead * (1.0 - speed),
        curvature * (speed * speed) + (slope + lead) * acceleration,
    )


@compiled(borrows=True, inner=True)
def plan_piece(
    numbers: Array, counts: Integers, nodes: Array, settings: Array, base: float, slope: float,
    limit: float, piece: Array,
) -> tuple[int, bool, bool]:  # fmt: skip
    """Where a piece of at most `limit` steps ends, and what the tool meets there, into `piece`.

    Args:
        numbers: The remembered numbers.
        counts: The remembered integers.
        nodes: The surface.
        settings: What machine and cut ask for.
        base: The speed over the target speed, without its variation.
        slope: Of the speed over the target speed, per step, while that ramps.
        limit: Steps.
        piece: Written but for what belongs to its start.

    Returns:
        The node at or before the place met, whether it is just there, whether a ramp ends.
    """
    phase = numbers[layout.PHASE]
    variation, frequency = settings[layout.VARIATION], settings[layout.VARIATION_FREQUENCY]
    turn, merge = settings[layout.TURN], surface.MERGE
    steady = slope == 0.0 and variation == 0.0
    duration, ramp_ends = limit, False
    if slope != 0.0:
        to_target = (1.0 - base) / slope
        ramp_ends = to_target <= limit + merge
        if to_target < limit - merge:
            duration = to_target
    rise = base * duration
    if not steady:
        rise = turned(duration, base, slope, variation, phase, frequency)
    node = counts[layout.POINTER]
    pitch = nodes[surface.PITCH, node + 1]
    if rise > DETAIL * pitch:
        duration, ramp_ends = duration * (0.8 * DETAIL * pitch / rise), False
        rise = base * duration
        if not steady:
            rise = turned(duration, base, slope, variation, phase, frequency)
    here = numbers[layout.PLACE]
    place, near, at_node = here + rise - turn, merge * base, False
    while nodes[surface.PLACE, node + 1] < place - near:
        node += 1
        if nodes[surface.ORDER, node] <= surface.LAST_ORDER:
            place, ramp_ends, at_node = nodes[surface.PLACE, node], False, True
            rise = max(place + turn - here, 0.0)  # two corners may be at one place
            duration = rise if base == 1.0 else rise / base
            if not steady:
                duration = time_to_turn(rise, base, slope, variation, phase, frequency)
            break
    if not at_node and nodes[surface.PLACE, node + 1] <= place + near:
        node, at_node = node + 1, True
    if at_node:
        piece[HEIGHT_1] = nodes[surface.HEIGHT, node]
        piece[SLOPE_1] = nodes[surface.SLOPE_BEFORE, node]
        piece[CURVATURE_1] = nodes[surface.CURVATURE_BEFORE, node]
    else:
        piece[HEIGHT_1], piece[SLOPE_1], piece[CURVATURE_1] = surface.surface_at(
            nodes, node, place
        )
    piece[DURATION], piece[PLACE_1] = duration, here + rise
    if steady and duration == limit:  # a step ends on the grid, whatever pieces it had
        whole = math.floor(piece[PLACE_1] + 0.5)
        if abs(piece[PLACE_1] - whole) < 1e-6:
            piece[PLACE_1] = whole
    piece[SPEED_1], piece[ACCELERATION_1] = base, 0.0
    if not steady:
        piece[SPEED_1], piece[ACCELERATION_1] = speed_and_slope(
            base + slope * duration, slope, variation, phase + frequency * duration, frequency
        )
    lead = settings[layout.LEAD]
    piece[AHEAD_1] = numbers[layout.AHEAD] + lead * (duration - rise)
    piece[MET_1] = piece[HEIGHT_1] - settings[layout.FEED] - piece[AHEAD_1]
    piece[RATE_1], piece[BEND_1] = piece[SLOPE_1], piece[CURVATURE_1]
    if not steady or base != 1.0:
        piece[RATE_1], piece[BEND_1] = by_time(
            piece[SLOPE_1], piece[CURVATURE_1], lead, piece[SPEED_1], piece[ACCELERATION_1]
        )
    return node, at_node, ramp_ends
