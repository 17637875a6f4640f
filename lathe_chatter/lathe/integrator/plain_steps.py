"""Whole steps in which nothing happens, as fast as they can be taken.

Nearly every step of a run is one: no corner in the surface that the tool meets, no change of
contact or cutting. This loop takes such steps, with noise, unbalance and a varied speed, and stops
before the first that is not; event_step.py then takes that one.

At a steady speed the surface of the turn before was left on a grid of whole steps. Where a turn
has a whole number of them the tool meets its nodes, else a constant part of the way between two.
"""

from __future__ import annotations

import math

from lathe_chatter.arrays import Array, Integers
from lathe_chatter.compiled import compiled
from lathe_chatter.lathe.integrator import noise, surface
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.lathe.integrator.events import may_turn_back
from lathe_chatter.lathe.integrator.piece import DETAIL, by_time
from lathe_chatter.lathe.integrator.propagation import (
    Shape,
    add_held_forces,
    add_unbalance,
    read_outputs,
    whole_step,
)
from lathe_chatter.lathe.integrator.registers import loaded, moved_to
from lathe_chatter.lathe.integrator.samples import (
    COLUMNS,
    add_runout,
    write_accelerations,
    write_sample,
)
from lathe_chatter.lathe.integrator.spindle import speed_and_slope, speed_curvature
from lathe_chatter.lathe.integrator.state_layout import (
    BEARING_V,
    BEARING_X,
    BEND,
    TOOL_V,
    TOOL_X,
    WORKPIECE_V,
    WORKPIECE_X,
)
from lathe_chatter.lathe.integrator.surface_kinks import bend_of, by_place, finish_corner
from lathe_chatter.lathe.integrator.unbalance import angle_at, unbalance_force


@compiled(borrows=True, apart=True)
def take_plain_steps(
    numbers: Array, z: Array, counts: Integers, nodes: Array, settings: Array, rules: Array,
    outputs: Array, direct: Array, step_matrix: Array, out: Array, row: int,
    seen: Array, room: Array, shape: Shape,
) -> int:  # fmt: skip
    """Take plain steps, beginning with sample `row`.

    Args:
        numbers: As in `stepper.advance`.
        z: The coordinates (2n,).
        counts: As in `stepper.advance`.
        nodes: The same.
        settings: The same.
        rules: The coefficients of the regime (ROWS, 2n).
        outputs: What its coordinates mean (2n + 1, OUTPUTS).
        direct: What acts directly (DIRECT,).
        step_matrix: The response to a whole step where its coordinates are coupled (2n, 2n).
        out: As in `stepper.advance`.
        row: The sample that is next.
        seen: Room (OUTPUTS,).
        room: Room for coordinates (2, 2n).
        shape: One entry a mode.

    Returns:
        The sample that is next.
    """
    n2 = 2 * len(shape)
    target = settings[layout.TARGET_SPEED]
    variation, damping = settings[layout.VARIATION], settings[layout.PROCESS_DAMPING]
    varied = variation != 0.0
    if (
        numbers[layout.SPEED] != target
        or (varied and damping != 0.0)
        or numbers[layout.LEFT] != 0.0
        or row == out.shape[0]
    ):
        return row
    lead, feed, turn = settings[layout.LEAD], settings[layout.FEED], settings[layout.TURN]
    per_step, rate = 1.0 / settings[layout.STEP_LENGTH], settings[layout.SAMPLE_RATE]
    limit, clearance = settings[layout.LIMIT], settings[layout.CLEARANCE]
    stiffness, leaves = settings[layout.CUTTING_STIFFNESS], settings[layout.MAY_LEAVE_CUT] != 0.0
    sides = settings[layout.SIDES]
    runout = settings[layout.RUNOUT] != 0.0 or settings[layout.TOOL_RUNOUT] != 0.0
    unbalanced = settings[layout.UNBALANCE] != 0.0
    tool_noise, cut_noise = settings[layout.FORCE_NOISE], settings[layout.CUTTING_FORCE_NOISE]
    noisy = tool_noise != 0.0 or cut_noise != 0.0
    seed = int(settings[layout.SEED])
    tool_key = noise.stream_key(seed, noise.FORCE_STREAM)
    cut_key = noise.stream_key(seed, noise.CUTTING_FORCE_STREAM)
    accelerations = out.shape[1] > COLUMNS
    coupled = direct[layout.COUPLED] != 0.0
    regime, steps = counts[layout.REGIME], counts[layout.STEPS]
    in_cut, touch = regime & layout.IN_CUT != 0, regime >> 1
    origin, origin_low, turns = numbers[layout.ORIGIN], numbers[layout.ORIGIN_LOW], 1.0 / turn

    place, phase = numbers[layout.PLACE], numbers[layout.PHASE]
    frequency = settings[layout.VARIATION_FREQUENCY]
    speed, acceleration = 1.0, 0.0
    swing = math.tan(math.pi * frequency) / (math.pi * frequency) if varied else 1.0
    if varied:
        if frequency >= 0.25:
            return row
        speed, acceleration = speed_and_slope(1.0, 0.0, variation, phase, frequency)
    whole_turn = math.ceil(turn)
    part = whole_turn - turn
    whole = part == 0.0
    at_0, at_1, at_2 = layout.WEIGHTS, layout.WEIGHTS + 5, layout.WEIGHTS + 10
    (w0, w1, w2, w3, w4, w5, w6, w7, w8, w9, w10, w11, w12, w13, w14) = (
        settings[at_0], settings[at_0 + 1], settings[at_0 + 2], settings[at_0 + 3],
        settings[at_0 + 4], settings[at_1], settings[at_1 + 1], settings[at_1 + 2],
        settings[at_1 + 3], settings[at_1 + 4], settings[at_2], settings[at_2 + 1],
        settings[at_2 + 2], settings[at_2 + 3], settings[at_2 + 4],
    )  # fmt: skip
    ahead = numbers[layout.AHEAD]
    height, slope, curvature = (
        numbers[layout.HEIGHT],
        numbers[layout.SLOPE],
        numbers[layout.CURVATURE],
    )
    u0 = height - feed - ahead
    d0, e0 = slope, curvature
    if varied:
        d0, e0 = by_time(slope, curvature, lead, speed, acceleration)
    r0, s0 = numbers[layout.RELATIVE], numbers[layout.RELATIVE_RATE]
    b0, v0 = numbers[layout.AT_BEARING], numbers[layout.AT_BEARING_RATE]
    pointer, head = counts[layout.POINTER], counts[layout.HEAD]
    samples, index, span = counts[layout.SAMPLES], counts[layout.STEP], settings[layout.SPAN]
    on_tool = between = f0 = g0 = h0 = f1 = g1 = h1 = 0.0
    if unbalanced:
        f0, g0, h0 = unbalance_force(
            settings, angle_at(numbers, settings, place), speed, acceleration,
            speed_curvature(1.0, 0.0, variation, phase, frequency) if varied else 0.0,
        )  # fmt: skip
    if noisy:
        on_tool = tool_noise * noise.normal(tool_key, samples)
        between = cut_noise * noise.normal(cut_key, samples)
    bend = bend_of(z, outputs, direct, u0, 0.0, 0.0, f0)
    if counts[layout.CORNER] != 0 or counts[layout.SURFACE_CORNER] != 0:
        forced = direct[layout.TOOL_FORCE] * on_tool + direct[layout.CUTTING_FORCE] * between
        finish_corner(numbers, counts, nodes, settings, bend + forced, speed, acceleration)

    now, end = loaded(z, room[0], shape), loaded(z, room[1], shape)
    while row < out.shape[0] and head + 2 < nodes.shape[0] and place < span:
        if noisy and index == 0:
            on_tool = tool_noise * noise.normal(tool_key, samples)
            between = cut_noise * noise.normal(cut_key, samples)
            if in_cut:
                forced = (
                    direct[layout.TOOL_FORCE] * on_tool + direct[layout.CUTTING_FORCE] * between
                )
                nodes[head, surface.CURVATURE_AFTER] = by_place(
                    s0, bend + forced, lead, speed, acceleration
                )[1]
        speed1, acceleration1, rise, ahead1, phase1 = 1.0, 0.0, 1.0, ahead, phase
        if varied:
            phase1 = phase + frequency
            phase1 -= math.floor(phase1)
            speed1, acceleration1 = speed_and_slope(1.0, 0.0, variation, phase1, frequency)
            # The integral of a sine by its ends: 2 sin(middle) cos(z) = sin(start) + sin(end).
            rise = 1.0 + (0.5 * (speed + speed1) - 1.0) * swing
            ahead1 = ahead + lead * (1.0 - rise)
        place1 = place + rise
        at = place1 - turn
        node = pointer + 1
        base = place1 - whole_turn
        if not varied and nodes[node, surface.PLACE] == base:
            if nodes[node, surface.ORDER] <= surface.LAST_ORDER:
                break
            if whole:
                height1, slope1, curvature1 = (
                    nodes[node, surface.HEIGHT],
                    nodes[node, surface.SLOPE_BEFORE],
                    nodes[node, surface.CURVATURE_BEFORE],
                )
                after = nodes[node, surface.CURVATURE_AFTER]
            elif nodes[node + 1, surface.PLACE] == base + 1.0:
                rising = nodes[node + 1, surface.HEIGHT] - nodes[node, surface.HEIGHT]
                da, db = nodes[node, surface.SLOPE_AFTER], nodes[node + 1, surface.SLOPE_BEFORE]
                ea = nodes[node, surface.CURVATURE_AFTER]
                eb = nodes[node + 1, surface.CURVATURE_BEFORE]
                height1 = (
                    nodes[node, surface.HEIGHT]
                    + ((w0 * rising + w1 * da) + (w2 * db + w3 * ea)) + w4 * eb
                )  # fmt: skip
                slope1 = ((w5 * rising + w6 * da) + (w7 * db + w8 * ea)) + w9 * eb
                curvature1 = ((w10 * rising + w11 * da) + (w12 * db + w13 * ea)) + w14 * eb
                after = curvature1
            elif nodes[node + 1, surface.PLACE] > at + surface.MERGE:
                height1, slope1, curvature1 = surface.surface_at(nodes, node, at)
                after = curvature1
            else:
                break
        else:
            if rise > DETAIL * nodes[node, surface.PITCH]:
                break
            node = pointer
            while (
                nodes[node + 1, surface.PLACE] < at - surface.MERGE
                and nodes[node + 1, surface.ORDER] > surface.LAST_ORDER
            ):
                node += 1
            following = nodes[node + 1, surface.PLACE]
            if following < at - surface.MERGE:
                break
            if following <= at + surface.MERGE:
                node += 1
                if nodes[node, surface.ORDER] <= surface.LAST_ORDER:
                    break
                height1, slope1, curvature1 = (
                    nodes[node, surface.HEIGHT],
                    nodes[node, surface.SLOPE_BEFORE],
                    nodes[node, surface.CURVATURE_BEFORE],
                )
                after = nodes[node, surface.CURVATURE_AFTER]
            else:
                height1, slope1, curvature1 = surface.surface_at(nodes, node, at)
                after = curvature1
        u1, d1, e1 = height1 - feed - ahead1, slope1, curvature1
        if varied:
            d1, e1 = by_time(slope1, curvature1, lead, speed1, acceleration1)
        end = whole_step(
            now, rules, step_matrix, coupled, in_cut, u0, d0, e0, u1, d1, e1, end, shape
        )
        if noisy:
            end = add_held_forces(rules, on_tool, between, end, shape)
        if unbalanced:
            f1, g1, h1 = unbalance_force(
                settings, angle_at(numbers, settings, place1), speed1, acceleration1,
                speed_curvature(1.0, 0.0, variation, phase1, frequency) if varied else 0.0,
            )  # fmt: skip
            end = add_unbalance(rules, f0, g0, h0, f1, g1, h1, end, shape)
        read_outputs(outputs, end, seen, shape)
        r1, s1 = seen[TOOL_X] - seen[WORKPIECE_X], seen[TOOL_V] - seen[WORKPIECE_V]
        b1, v1 = seen[BEARING_X], seen[BEARING_V]
        chip = r1 - u1
        happens = False
        if sides > 0.0:
            if touch == layout.FREE:
                happens |= may_turn_back(clearance - b0, -v0, clearance - b1, -v1, 1.0)
                if sides == 2.0:
                    happens |= may_turn_back(clearance + b0, v0, clearance + b1, v1, 1.0)
            elif touch == layout.ABOVE:
                happens |= may_turn_back(b0 - clearance, v0, b1 - clearance, v1, 1.0)
            else:
                happens |= may_turn_back(-b0 - clearance, -v0, -b1 - clearance, -v1, 1.0)
        if leaves:
            if in_cut:
                happens |= may_turn_back(r0 - u0, s0 - d0, chip, s1 - d1, 1.0)
            else:
                happens |= may_turn_back(u0 - r0, d0 - s0, -chip, d1 - s1, 1.0)
        if happens or not (abs(seen[TOOL_X]) <= limit and abs(seen[WORKPIECE_X]) <= limit):
            break

        head += 1
        bend = seen[BEND] + direct[layout.SURFACE] * u1
        if unbalanced:
            bend += direct[layout.UNBALANCE_FORCE] * f1
        if in_cut:
            forced = bend
            if noisy:
                forced += (
                    direct[layout.TOOL_FORCE] * on_tool + direct[layout.CUTTING_FORCE] * between
                )
            left_slope, left_bend = s1, forced
            if varied:
                left_slope, left_bend = by_place(s1, forced, lead, speed1, acceleration1)
            surface.write_node(nodes, head, place1, r1 + ahead1, left_slope, left_bend, rise)
        else:
            finest = min(rise, nodes[pointer + 1, surface.PITCH])
            surface.write_node(nodes, head, place1, height1 - feed, slope1, curvature1, finest)
            nodes[head, surface.CURVATURE_AFTER] = after
        now = moved_to(now, end, shape)
        height, slope, curvature = height1, slope1, after
        u0, d0, e0 = u1, d1, e1
        if varied:
            d0, e0 = by_time(slope, after, lead, speed1, acceleration1)
        else:
            e0 = after
        f0, g0, h0 = f1, g1, h1
        r0, s0, b0, v0 = r1, s1, b1, v1
        place, ahead, pointer = place1, ahead1, node
        speed, acceleration, phase = speed1, acceleration1, phase1
        index += 1
        if index == steps:
            index = 0
            samples += 1
            force = 0.0
            if in_cut:
                force = stiffness * chip + damping * s1 + between
            write_sample(
                out, row, samples / rate, origin + (origin_low + place * turns), seen, per_step,
                max(chip, 0.0) if leaves else chip, force,
            )  # fmt: skip
            if runout:
                add_runout(out, row, settings, target * speed)
            if accelerations:
                for i in range(n2):
                    z[i] = now[i]
                write_accelerations(out, row, z, rules, direct, u1, on_tool, between, f1)
            row += 1

    for i in range(n2):
        z[i] = now[i]
    numbers[layout.PLACE], numbers[layout.PHASE], numbers[layout.AHEAD] = place, phase, ahead
    numbers[layout.HEIGHT], numbers[layout.SLOPE] = height, slope
    numbers[layout.CURVATURE] = curvature
    counts[layout.POINTER], counts[layout.HEAD] = pointer, head
    counts[layout.SAMPLES], counts[layout.STEP] = samples, index
    numbers[layout.RELATIVE], numbers[layout.RELATIVE_RATE] = r0, s0
    numbers[layout.AT_BEARING], numbers[layout.AT_BEARING_RATE] = b0, v0
    return row
