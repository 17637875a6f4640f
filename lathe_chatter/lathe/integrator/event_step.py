"""One whole step with whatever happens inside it: the general case of the inner loop.

The step is cut where the tool meets a corner in the surface of the turn before, where the
bearing engages or releases, where the tool leaves or enters the cut, and where a speed ramp
ends. Each piece between is solved exactly (propagation.py) and leaves a node of the surface.
"""

from __future__ import annotations

import math

from lathe_chatter.array_types import Array, Integers
from lathe_chatter.compiled import compiled
from lathe_chatter.lathe.integrator import piece_plan as at
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.lathe.integrator import surface
from lathe_chatter.lathe.integrator.event_in_piece import (
    NOTHING,
    Machine,
    Scratch,
    first_event,
    kind_of,
    solve_series,
)
from lathe_chatter.lathe.integrator.first_crossing import NEVER
from lathe_chatter.lathe.integrator.piece_plan import by_time, plan_piece
from lathe_chatter.lathe.integrator.propagation import coordinates_at, read_outputs
from lathe_chatter.lathe.integrator.simd_vectors import fma
from lathe_chatter.lathe.integrator.spindle import speed_and_slope, speed_curvature
from lathe_chatter.lathe.integrator.state_layout import (
    BEARING_V,
    BEARING_X,
    TOOL_V,
    TOOL_X,
    WORKPIECE_V,
    WORKPIECE_X,
)
from lathe_chatter.lathe.integrator.surface_corners import bend_of, by_place, finish_corner, lower
from lathe_chatter.lathe.integrator.unbalance import angle_at, unbalance_force

_MOST_FLIPS = 32
"""Events in one step before it is finished without looking for more: a grazing contact that
rounding cannot decide is no reason to stand still."""


@compiled(inline=True, borrows=True, inner=True)
def _leave_surface(
    counts: Integers, nodes: Array, settings: Array, bend: float, scratch: Scratch
) -> None:
    """Add the node at the end of a piece: cut by the tool, or the old surface where it is out."""
    piece, seen = scratch.piece, scratch.seen
    height = piece[at.HEIGHT_1] - settings[layout.FEED]
    slope, curvature = piece[at.SLOPE_1], piece[at.CURVATURE_1]
    pitch = piece[at.SPEED_1]
    if counts[layout.REGIME] & layout.IN_CUT != 0:
        height = seen[0, TOOL_X] - seen[0, WORKPIECE_X] + piece[at.AHEAD_1]
        slope, curvature = seen[0, TOOL_V] - seen[0, WORKPIECE_V], bend
        if pitch != 1.0 or piece[at.ACCELERATION_1] != 0.0:
            slope, curvature = by_place(
                slope, bend, settings[layout.LEAD], pitch, piece[at.ACCELERATION_1]
            )
    else:
        pitch = min(pitch, nodes[surface.PITCH, counts[layout.POINTER] + 1])
    counts[layout.HEAD] += 1
    surface.write_node(
        nodes, counts[layout.HEAD], piece[at.PLACE_1], height, slope, curvature, pitch
    )


@compiled(inline=True, borrows=True, inner=True)
def _move_on(
    numbers: Array, counts: Integers, nodes: Array, settings: Array, slope: float, node: int,
    at_node: bool, ramp_ends: bool, scratch: Scratch,
) -> None:  # fmt: skip
    """Make the end of the piece the present, but for the coordinates."""
    piece, seen = scratch.piece, scratch.seen
    numbers[layout.HEIGHT] = piece[at.HEIGHT_1]
    numbers[layout.SLOPE], numbers[layout.CURVATURE] = piece[at.SLOPE_1], piece[at.CURVATURE_1]
    if at_node:
        numbers[layout.CURVATURE] = nodes[surface.CURVATURE_AFTER, node]
    if at_node and nodes[surface.ORDER, node] <= surface.LAST_ORDER:
        numbers[layout.SLOPE] = nodes[surface.SLOPE_AFTER, node]
        # A corner comes back two orders smoother, through a force; or as it was, uncut.
        order = int(nodes[surface.ORDER, node])
        if counts[layout.REGIME] & layout.IN_CUT == 0:
            counts[layout.SURFACE_CORNER] = order
        elif order + 2 <= surface.LAST_ORDER:
            counts[layout.CORNER] = order + 2
    numbers[layout.RELATIVE] = seen[0, TOOL_X] - seen[0, WORKPIECE_X]
    numbers[layout.RELATIVE_RATE] = seen[0, TOOL_V] - seen[0, WORKPIECE_V]
    numbers[layout.AT_BEARING] = seen[0, BEARING_X]
    numbers[layout.AT_BEARING_RATE] = seen[0, BEARING_V]
    numbers[layout.PLACE], numbers[layout.AHEAD] = piece[at.PLACE_1], piece[at.AHEAD_1]
    numbers[layout.SPEED] += slope * piece[at.DURATION] * settings[layout.TARGET_SPEED]
    if ramp_ends:
        numbers[layout.SPEED] = settings[layout.TARGET_SPEED]
        counts[layout.CORNER] = lower(counts[layout.CORNER], 2)
    if settings[layout.VARIATION] > 0.0:
        phase = numbers[layout.PHASE]
        phase += settings[layout.VARIATION_FREQUENCY] * piece[at.DURATION]
        numbers[layout.PHASE] = phase - math.floor(phase)
    counts[layout.POINTER] = node


@compiled(inline=True, borrows=True, inner=True)
def take_step(
    numbers: Array, z: Array, counts: Integers, nodes: Array, settings: Array, machine: Machine,
    on_tool: float, between: float, events: Array, found: int, scratch: Scratch,
) -> tuple[int, int]:  # fmt: skip
    """Take a whole step, or go on with one that was interrupted, whatever happens in it.

    Args:
        numbers: The remembered numbers.
        z: The coordinates (2n,).
        counts: The remembered integers.
        nodes: The surface.
        settings: What machine and cut ask for.
        machine: The coefficients of all regimes.
        on_tool: The random force on the tool in this sample, N.
        between: That between tool and workpiece, while they touch, N.
        events: Written: samples before the event, s since that sample, kind.
        found: Events written so far.
        scratch: Room; `scratch.seen` is left with what the end of the step means.

    Returns:
        Events written so far, and FINISHED; or, with the rest of the step noted, SURFACE_FULL
        or EVENTS_FULL.
    """
    n2 = z.shape[0]
    piece, end, seen, forces = scratch.piece, scratch.end, scratch.seen, scratch.forces
    merge, lead, target = surface.MERGE, settings[layout.LEAD], settings[layout.TARGET_SPEED]
    variation, frequency = settings[layout.VARIATION], settings[layout.VARIATION_FREQUENCY]
    unbalanced, damping = settings[layout.UNBALANCE] != 0.0, settings[layout.PROCESS_DAMPING]
    noisy = on_tool != 0.0 or between != 0.0
    if numbers[layout.LEFT] == 0.0:
        numbers[layout.LEFT], counts[layout.FLIPS] = 1.0, 0
    while numbers[layout.LEFT] > 0.0:
        if counts[layout.HEAD] + 2 >= nodes.shape[1]:
            return found, layout.SURFACE_FULL
        if found == events.shape[0]:
            return found, layout.EVENTS_FULL
        base, slope = 1.0, 0.0
        if numbers[layout.SPEED] != target:
            base = numbers[layout.SPEED] / target
            slope = math.copysign(settings[layout.ACCELERATION], 1.0 - base)
        unsteady = slope != 0.0 or variation != 0.0
        speed, acceleration = base, 0.0
        if unsteady:
            speed, acceleration = speed_and_slope(
                base, slope, variation, numbers[layout.PHASE], frequency
            )
        regime, left = counts[layout.REGIME], numbers[layout.LEFT]
        direct = machine.direct[regime]
        in_cut = regime & layout.IN_CUT != 0
        varies = unsteady and damping != 0.0 and in_cut
        piece[at.MET_0] = numbers[layout.HEIGHT] - settings[layout.FEED] - numbers[layout.AHEAD]
        piece[at.RATE_0], piece[at.BEND_0] = numbers[layout.SLOPE], numbers[layout.CURVATURE]
        if speed != 1.0 or acceleration != 0.0:
            piece[at.RATE_0], piece[at.BEND_0] = by_time(
                numbers[layout.SLOPE], numbers[layout.CURVATURE], lead, speed, acceleration
            )
        f0 = g0 = h0 = f1 = g1 = h1 = 0.0
        if unbalanced:
            f0, g0, h0 = unbalance_force(
                settings, angle_at(numbers, settings, numbers[layout.PLACE]), speed,
                acceleration,
                speed_curvature(base, slope, variation, numbers[layout.PHASE], frequency),
            )  # fmt: skip
        begins = noisy and counts[layout.STEP] == 0 and left == 1.0  # other random forces
        if begins or counts[layout.CORNER] > 0 or counts[layout.SURFACE_CORNER] > 0:
            more = damping * (1.0 / speed - 1.0) * numbers[layout.RELATIVE_RATE] if varies else 0.0
            bend = bend_of(
                z, machine.outputs[regime], direct, piece[at.MET_0], on_tool, between + more, f0
            )
            finish_corner(numbers, counts, nodes, settings, bend, speed, acceleration)
        node, at_node, ramp_ends = plan_piece(
            numbers, counts, nodes, settings, base, slope, left, piece
        )
        place, event, extra, duration = NEVER, NOTHING, 0.0, piece[at.DURATION]
        if unbalanced:
            f1, g1, h1 = unbalance_force(
                settings, angle_at(numbers, settings, piece[at.PLACE_1]), piece[at.SPEED_1],
                piece[at.ACCELERATION_1],
                speed_curvature(
                    base + slope * duration, slope, variation,
                    numbers[layout.PHASE] + frequency * duration, frequency,
                ),
            )  # fmt: skip
        if varies:
            middle, _ = speed_and_slope(
                base + 0.5 * slope * duration, slope, variation,
                numbers[layout.PHASE] + 0.5 * frequency * duration, frequency,
            )  # fmt: skip
            first, half = damping * (1.0 / speed - 1.0), damping * (1.0 / middle - 1.0)
            extra = damping * (1.0 / piece[at.SPEED_1] - 1.0)
            forces[3], forces[4], forces[5] = (
                first,
                4.0 * half - 3.0 * first - extra,
                2.0 * first - 4.0 * half + 2.0 * extra,
            )
        forces[0], forces[1] = on_tool, between
        forces[2] = 2.0 if varies else 1.0 if unbalanced else 0.0
        outputs = machine.outputs[regime]
        wide = solve_series(z, regime, machine, scratch, f0, g0, h0, f1, g1, h1)
        read_outputs(outputs, end, seen)
        if counts[layout.FLIPS] < _MOST_FLIPS:
            place, event = first_event(numbers, regime, outputs, settings, scratch, wide)
        kind, after = layout.NO_EVENT, regime
        if event != NOTHING:
            until = place * piece[at.DURATION]
            if merge < until < piece[at.DURATION] - merge:
                # Inside: the piece ends here, on the series in which the event was found.
                coordinates_at(z, scratch.series, wide, place, end)
                read_outputs(outputs, end, seen)
                node, at_node, ramp_ends = plan_piece(
                    numbers, counts, nodes, settings, base, slope, until, piece
                )
                if varies:
                    extra = damping * (1.0 / piece[at.SPEED_1] - 1.0)
                if unbalanced:
                    f1, _, _ = unbalance_force(
                        settings, angle_at(numbers, settings, piece[at.PLACE_1]),
                        piece[at.SPEED_1], 0.0, 0.0,
                    )  # fmt: skip
            elif until <= merge:
                piece[at.DURATION] = 0.0
            kind, after = kind_of(event, regime)
            events[found, 0] = counts[layout.SAMPLES]
            events[found, 1] = settings[layout.STEP_LENGTH] * (
                counts[layout.STEP] + 1.0 - left + piece[at.DURATION]
            )
            events[found, 2] = kind
            found += 1
            counts[layout.FLIPS] += 1
        if piece[at.DURATION] > 0.0:
            more = extra * (seen[0, TOOL_V] - seen[0, WORKPIECE_V])
            bend = bend_of(end, outputs, direct, piece[at.MET_1], on_tool, between + more, f1)
            _leave_surface(counts, nodes, settings, bend, scratch)
            _move_on(numbers, counts, nodes, settings, slope, node, at_node, ramp_ends, scratch)
            left -= piece[at.DURATION]
            numbers[layout.LEFT] = left if left > 0.5 * merge else 0.0
            for i in range(n2):
                z[i] = end[i]
        elif kind == layout.NO_EVENT:  # a second corner of the surface at the place met
            _move_on(numbers, counts, nodes, settings, slope, node, at_node, ramp_ends, scratch)
        if kind == layout.NO_EVENT:
            continue
        moves = machine.moves[regime, after]
        for i in range(n2):
            end[i] = moves[n2, i]
            for j in range(n2):
                end[i] = fma(moves[i, j], z[j], end[i])
        for i in range(n2):
            z[i] = end[i]
        counts[layout.REGIME] = after
        if kind >= layout.TOOL_LEAVES:
            # Out of the cut the surface is another: it has a corner, whatever the motion has.
            counts[layout.SURFACE_CORNER] = 1
        else:
            counts[layout.CORNER] = lower(counts[layout.CORNER], 3)
    return found, layout.FINISHED
