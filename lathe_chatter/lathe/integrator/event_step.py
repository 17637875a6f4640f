"""One whole step with whatever happens inside it: the general case of the inner loop.

The step is cut where the tool meets a corner in the surface of the turn before, where the
bearing engages or releases, where the tool leaves or enters the cut, and where a speed ramp
ends. Each piece between is solved exactly (propagation.py) and leaves a node of the surface.
"""

from __future__ import annotations

import math

from lathe_chatter.arrays import Array, Integers
from lathe_chatter.compiled import compiled
from lathe_chatter.lathe.integrator import propagation, surface
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.lathe.integrator.events import NEVER, first_crossing, may_turn_back
from lathe_chatter.lathe.integrator.plan import (
    ANGLE_1,
    ANGLE_LOW_1,
    BEND_0,
    BEND_1,
    CURVATURE_1,
    DURATION,
    FED_1,
    FED_LOW_1,
    HEIGHT_1,
    MET_0,
    MET_1,
    RATE_0,
    RATE_1,
    SLOPE_1,
    SPEED_1,
    SPEED_SLOPE_1,
    Scratch,
    plan_piece,
)
from lathe_chatter.lathe.integrator.propagation import (
    ENGAGED,
    IN_CUT,
    TERMS,
    relative_acceleration,
    whole_step,
)
from lathe_chatter.lathe.integrator.spindle import speed_and_slope
from lathe_chatter.lathe.integrator.surface_kinks import finish_corner, lower

_MOST_FLIPS = 32
"""Events in one step before it is finished without looking for more: a grazing contact that
rounding cannot decide is no reason to stand still."""


@compiled(inline=True, borrows=True)
def _solve_series(
    numbers: Array, regime: int, mechanics: Array, force: float, scratch: Scratch
) -> None:
    """The power series of the planned piece."""
    piece = scratch.piece
    duration = piece[DURATION]
    square = duration * duration
    propagation.quintic(
        piece[MET_0], piece[RATE_0] * duration, piece[BEND_0] * square,
        piece[MET_1], piece[RATE_1] * duration, piece[BEND_1] * square, scratch.hold,
    )  # fmt: skip
    propagation.solve_piece(
        numbers, duration, regime, mechanics, force, scratch.hold, scratch.tool, scratch.workpiece
    )


@compiled(inline=True, borrows=True)
def _solve(
    numbers: Array, regime: int, mechanics: Array, matrices: Array, force: float, step: float,
    scratch: Scratch,
) -> None:  # fmt: skip
    """The state at the end of the planned piece: by matrix if it is a whole step."""
    piece, end = scratch.piece, scratch.end
    if piece[DURATION] == step:
        end[0], end[1], end[2], end[3] = whole_step(
            matrices[regime], numbers[layout.TOOL_X], numbers[layout.TOOL_V],
            numbers[layout.WORKPIECE_X], numbers[layout.WORKPIECE_V],
            piece[MET_0], piece[RATE_0], piece[BEND_0],
            piece[MET_1], piece[RATE_1], piece[BEND_1],
        )  # fmt: skip
        if force != 0.0:
            for k in range(4):
                end[k] += matrices[regime, propagation.FORCE_ROW, k] * force
    else:
        _solve_series(numbers, regime, mechanics, force, scratch)
        propagation.state_at(scratch.tool, scratch.workpiece, 1.0, piece[DURATION], end)


@compiled(inline=True, borrows=True)
def _find_event(
    numbers: Array, regime: int, mechanics: Array, settings: Array, force: float, scratch: Scratch
) -> tuple[float, int]:
    """The first event in the solved piece and its place in [0, 1], or `NEVER`."""
    piece, end, margin = scratch.piece, scratch.end, scratch.margin
    duration, clearance = piece[DURATION], mechanics[propagation.CLEARANCE]
    watch_bearing = watch_chip = False
    engaged, cutting = regime & ENGAGED != 0, regime & IN_CUT != 0
    bearing_side, chip_side = 1.0 if engaged else -1.0, 1.0 if cutting else -1.0
    if settings[layout.HAS_CLEARANCE] != 0.0:
        watch_bearing = may_turn_back(
            bearing_side * (numbers[layout.WORKPIECE_X] - clearance),
            bearing_side * numbers[layout.WORKPIECE_V],
            bearing_side * (end[2] - clearance), bearing_side * end[3], duration,
        )  # fmt: skip
    if settings[layout.MAY_LEAVE_CUT] != 0.0:
        relative = numbers[layout.TOOL_X] - numbers[layout.WORKPIECE_X]
        approach = numbers[layout.TOOL_V] - numbers[layout.WORKPIECE_V]
        watch_chip = may_turn_back(
            chip_side * (relative - piece[MET_0]), chip_side * (approach - piece[RATE_0]),
            chip_side * (end[0] - end[2] - piece[MET_1]),
            chip_side * (end[1] - end[3] - piece[RATE_1]), duration,
        )  # fmt: skip
    if not (watch_bearing or watch_chip):
        return NEVER, layout.NO_EVENT
    _solve_series(numbers, regime, mechanics, force, scratch)
    place, event = NEVER, layout.NO_EVENT
    if watch_bearing:
        for k in range(TERMS):
            margin[k] = scratch.workpiece[k]
        margin[0] -= clearance
        place = first_crossing(margin, TERMS, bearing_side)
        event = layout.BEARING_RELEASES if engaged else layout.BEARING_ENGAGES
    if watch_chip:
        for k in range(TERMS):
            margin[k] = scratch.tool[k] - scratch.workpiece[k]
        for k in range(6):
            margin[k] -= scratch.hold[k]
        chip_place = first_crossing(margin, TERMS, chip_side)
        if chip_place < place:
            place = chip_place
            event = layout.TOOL_LEAVES if cutting else layout.TOOL_ENTERS
    return (place, event) if place <= 1.0 else (NEVER, layout.NO_EVENT)


@compiled(inline=True, borrows=True)
def _leave_surface(
    counts: Integers, nodes: Array, settings: Array, matrices: Array, force: float, step: float,
    scratch: Scratch,
) -> None:  # fmt: skip
    """Add the node at the end of a piece: cut by the tool, or the old surface where it is out."""
    piece, end, regime = scratch.piece, scratch.end, counts[layout.REGIME]
    height, slope, curvature = piece[HEIGHT_1], piece[SLOPE_1], piece[CURVATURE_1]
    speed, pitch = piece[SPEED_1], piece[SPEED_1] * step
    if regime & IN_CUT != 0:
        bend = relative_acceleration(
            matrices[regime], end[0], end[1], end[2], end[3], piece[MET_1], force
        )
        height = piece[FED_1] + end[0] - end[2]
        slope = (settings[layout.FEED_SPEED] + end[1] - end[3]) * (1.0 / speed)
        curvature = (bend - slope * piece[SPEED_SLOPE_1]) * (1.0 / (speed * speed))
    else:
        pitch = min(pitch, nodes[counts[layout.POINTER] + 1, surface.PITCH])
    counts[layout.HEAD] += 1
    surface.write_node(nodes, counts[layout.HEAD], piece[ANGLE_1], height, slope, curvature, pitch)


@compiled(inline=True, borrows=True)
def _move_on(
    numbers: Array, counts: Integers, nodes: Array, settings: Array, slope: float, node: int,
    at_node: bool, ramp_ends: bool, scratch: Scratch,
) -> None:  # fmt: skip
    """Make the end of the piece the present."""
    piece = scratch.piece
    numbers[layout.MET] = piece[HEIGHT_1]
    numbers[layout.MET_SLOPE], numbers[layout.MET_CURVATURE] = (
        piece[SLOPE_1],
        piece[CURVATURE_1],
    )
    if at_node and nodes[node, surface.ORDER] <= surface.LAST_ORDER:
        numbers[layout.MET_SLOPE] = nodes[node, surface.SLOPE_AFTER]
        numbers[layout.MET_CURVATURE] = nodes[node, surface.CURVATURE_AFTER]
        # A corner comes back two orders smoother, through a force; or as it was, uncut.
        order = int(nodes[node, surface.ORDER])
        if counts[layout.REGIME] & IN_CUT == 0:
            counts[layout.SURFACE_CORNER] = order
        elif order + 2 <= surface.LAST_ORDER:
            counts[layout.CORNER] = order + 2
    for k in range(4):
        numbers[k] = scratch.end[k]
    numbers[layout.ANGLE], numbers[layout.ANGLE_LOW] = (
        piece[ANGLE_1],
        piece[ANGLE_LOW_1],
    )
    numbers[layout.FED], numbers[layout.FED_LOW] = piece[FED_1], piece[FED_LOW_1]
    numbers[layout.SPEED] += slope * piece[DURATION]
    if ramp_ends:
        numbers[layout.SPEED] = settings[layout.TARGET_SPEED]
        counts[layout.CORNER] = lower(counts[layout.CORNER], 2)
    if settings[layout.VARIATION] > 0.0:
        phase = numbers[layout.PHASE] + settings[layout.VARIATION_FREQUENCY] * piece[DURATION]
        numbers[layout.PHASE] = phase - math.floor(phase)
    counts[layout.POINTER] = node
    counts[layout.PIECES] += 1
    if numbers[layout.ANGLE] >= 1.0:
        surface.next_turn(nodes, node, counts[layout.HEAD], numbers[layout.FED])
        counts[layout.HEAD] -= node
        counts[layout.POINTER] = 0
        counts[layout.TURNS] += 1
        numbers[layout.ANGLE] -= 1.0
        numbers[layout.MET] -= numbers[layout.FED]
        numbers[layout.FED] = 0.0


@compiled(borrows=True)
def take_step(
    numbers: Array, counts: Integers, nodes: Array, settings: Array, mechanics: Array,
    matrices: Array, force: float, events: Array, found: int, scratch: Scratch,
) -> tuple[int, int]:  # fmt: skip
    """Take the step that is next, or finish one that was begun; arrays as in `stepper.advance`.

    Args:
        force: On the tool, held over the step, N.
        found: Events written so far.

    Returns:
        Events written so far, and FINISHED; or, with the rest of the step noted, SURFACE_FULL
        or EVENTS_FULL.
    """
    piece = scratch.piece
    step = 1.0 / (settings[layout.SAMPLE_RATE] * counts[layout.STEPS])
    merge = surface.MERGE * step
    if numbers[layout.LEFT] == 0.0:
        numbers[layout.LEFT], counts[layout.FLIPS] = step, 0
    while numbers[layout.LEFT] > 0.0:
        if counts[layout.HEAD] + 2 >= nodes.shape[0]:
            return found, layout.SURFACE_FULL
        if found == events.shape[0]:
            return found, layout.EVENTS_FULL
        slope = 0.0
        if numbers[layout.SPEED] != settings[layout.TARGET_SPEED]:
            slope = math.copysign(
                settings[layout.ACCELERATION],
                settings[layout.TARGET_SPEED] - numbers[layout.SPEED],
            )
        speed, acceleration = numbers[layout.SPEED], 0.0
        if slope != 0.0 or settings[layout.VARIATION] != 0.0:
            speed, acceleration = speed_and_slope(
                numbers[layout.SPEED], slope, settings[layout.VARIATION],
                numbers[layout.PHASE], settings[layout.VARIATION_FREQUENCY],
            )  # fmt: skip
        if counts[layout.CORNER] > 0 or counts[layout.SURFACE_CORNER] > 0:
            finish_corner(numbers, counts, nodes, settings, matrices, force, speed, acceleration)
        piece[MET_0] = numbers[layout.MET] - numbers[layout.FED]
        piece[RATE_0] = numbers[layout.MET_SLOPE] * speed - settings[layout.FEED_SPEED]
        piece[BEND_0] = (
            numbers[layout.MET_CURVATURE] * (speed * speed)
            + numbers[layout.MET_SLOPE] * acceleration
        )
        regime, left = counts[layout.REGIME], numbers[layout.LEFT]
        node, at_node, ramp_ends = plan_piece(
            numbers, counts, nodes, settings, slope, left, merge, piece
        )
        _solve(numbers, regime, mechanics, matrices, force, step, scratch)
        event = layout.NO_EVENT
        if counts[layout.FLIPS] < _MOST_FLIPS:
            place, event = _find_event(numbers, regime, mechanics, settings, force, scratch)
        if event != layout.NO_EVENT:
            until = place * piece[DURATION]
            if merge < until < piece[DURATION] - merge:
                # Inside: the piece ends here, on the series in which the event was found.
                propagation.state_at(
                    scratch.tool, scratch.workpiece, place, piece[DURATION], scratch.end
                )
                node, at_node, ramp_ends = plan_piece(
                    numbers, counts, nodes, settings, slope, until, merge, piece
                )
            elif until <= merge:
                piece[DURATION] = 0.0
            events[found, 0] = counts[layout.SAMPLES]
            events[found, 1] = (counts[layout.STEP] + 1) * step - left + piece[DURATION]
            events[found, 2] = event
            found += 1
            counts[layout.FLIPS] += 1
        if piece[DURATION] > 0.0:
            _leave_surface(counts, nodes, settings, matrices, force, step, scratch)
            _move_on(numbers, counts, nodes, settings, slope, node, at_node, ramp_ends, scratch)
            left -= piece[DURATION]
            numbers[layout.LEFT] = left if left > 0.5 * merge else 0.0
        if event >= layout.TOOL_LEAVES:
            # Out of the cut the surface is another: it has a corner, whatever the motion has.
            counts[layout.REGIME] ^= IN_CUT
            counts[layout.SURFACE_CORNER] = 1
        elif event != layout.NO_EVENT:
            counts[layout.REGIME] ^= ENGAGED
            counts[layout.CORNER] = lower(counts[layout.CORNER], 3)
    return found, layout.FINISHED
