"""Whole steps in which nothing happens, eight at a time.

Nearly every step of a run is one: no corner in the surface that the tool meets, no change of
contact or cutting. This loop takes such steps in blocks (simd_vectors.py), with noise, unbalance
and a varied speed, and stops before the first that is not; event_step.py then takes that one.

A turn has many more steps than a block, so the surface that a block meets is there before it
begins; surface_of_block.py reads it.
"""

from __future__ import annotations

from typing import Any

from lathe_chatter.array_types import Array, Integers
from lathe_chatter.compiled import compiled
from lathe_chatter.lathe.integrator import random_numbers, surface
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.lathe.integrator import step_block_layout as at
from lathe_chatter.lathe.integrator.first_crossing import may_turn_back
from lathe_chatter.lathe.integrator.output_samples import COLUMNS, add_runout, write_accelerations
from lathe_chatter.lathe.integrator.piece_plan import by_time
from lathe_chatter.lathe.integrator.propagation import turn_coupled
from lathe_chatter.lathe.integrator.simd_vectors import (
    LANES,
    after,
    before,
    counted,
    first_of,
    fma,
    lane,
    lanes_at,
    larger,
    put,
    put_samples,
    smaller,
    spread,
    turned_on,
)
from lathe_chatter.lathe.integrator.spindle import speed_and_slope, speed_curvature
from lathe_chatter.lathe.integrator.surface_corners import bend_of, by_place, finish_corner
from lathe_chatter.lathe.integrator.surface_moments import MOMENTS
from lathe_chatter.lathe.integrator.surface_of_block import look_up, nodes_on_grid, surface_on_grid
from lathe_chatter.lathe.integrator.unbalance import angle_at, unbalance_force

_SLOW = 0.01
"""Cycles a step up to which a varied speed meets a corner at its even part of a step."""


@compiled(inline=True, borrows=True, apart=True, inner=True)
def take_plain_steps(
    numbers: Array, z: Array, counts: Integers, nodes: Array, settings: Array, rules: Array,
    outputs: Array, direct: Array, step_matrix: Array, out: Array, row: int, block: Array,
    moved: Array, began: Array,
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
        block: Room (step_block_layout.ROWS, LANES).
        moved: Room for the coordinates of a block (2n, LANES).
        began: Room for those at its start (2n,).

    Returns:
        The sample that is next.
    """
    n = z.shape[0] // 2
    target = settings[layout.TARGET_SPEED]
    variation, damping = settings[layout.VARIATION], settings[layout.PROCESS_DAMPING]
    varied = variation != 0.0
    frequency = settings[layout.VARIATION_FREQUENCY]
    if (
        numbers[layout.SPEED] != target
        or (varied and (damping != 0.0 or frequency >= 0.25))
        or numbers[layout.LEFT] != 0.0
        or row == out.shape[0]
    ):
        return row
    lead, feed, turn = settings[layout.LEAD], settings[layout.FEED], settings[layout.TURN]
    per_step, rate = 1.0 / settings[layout.STEP_LENGTH], settings[layout.SAMPLE_RATE]
    limit, clearance = settings[layout.LIMIT], settings[layout.CLEARANCE]
    stiffness, leaves = settings[layout.CUTTING_STIFFNESS], settings[layout.MAY_LEAVE_CUT] != 0.0
    sides, span = settings[layout.SIDES], settings[layout.SPAN]
    runout = settings[layout.RUNOUT] != 0.0 or settings[layout.TOOL_RUNOUT] != 0.0
    unbalanced = settings[layout.UNBALANCE] != 0.0
    tool_noise, cut_noise = settings[layout.FORCE_NOISE], settings[layout.CUTTING_FORCE_NOISE]
    noisy = tool_noise != 0.0 or cut_noise != 0.0
    regime, steps = counts[layout.REGIME], counts[layout.STEPS]
    in_cut, touch = regime & layout.IN_CUT != 0, regime >> 1
    seed = int(settings[layout.SEED])
    tool_key = random_numbers.stream_key(seed, random_numbers.FORCE_STREAM)
    cut_key = random_numbers.stream_key(seed, random_numbers.CUTTING_FORCE_STREAM)
    crosses = in_cut and frequency <= _SLOW
    accelerations = out.shape[1] > COLUMNS
    coupled = direct[layout.COUPLED] != 0.0
    origin, origin_low, turns = numbers[layout.ORIGIN], numbers[layout.ORIGIN_LOW], 1.0 / turn

    place, ahead = numbers[layout.PLACE], numbers[layout.AHEAD]
    phase, speed, acceleration = numbers[layout.PHASE], 1.0, 0.0
    if varied:
        speed, acceleration = speed_and_slope(1.0, 0.0, variation, phase, frequency)
    pointer, head = counts[layout.POINTER], counts[layout.HEAD]
    samples, index = counts[layout.SAMPLES], counts[layout.STEP]
    height, slope, curvature = (
        numbers[layout.HEIGHT],
        numbers[layout.SLOPE],
        numbers[layout.CURVATURE],
    )
    u0, d0, e0 = height - feed - ahead, slope, curvature
    if varied:
        d0, e0 = by_time(slope, curvature, lead, speed, acceleration)
    r0, s0 = numbers[layout.RELATIVE], numbers[layout.RELATIVE_RATE]
    b0, v0 = numbers[layout.AT_BEARING], numbers[layout.AT_BEARING_RATE]
    on_tool = between = f0 = g0 = h0 = 0.0
    if unbalanced:
        f0, g0, h0 = unbalance_force(
            settings, angle_at(numbers, settings, place), speed, acceleration,
            speed_curvature(1.0, 0.0, variation, phase, frequency) if varied else 0.0,
        )  # fmt: skip
    if noisy:
        on_tool = tool_noise * random_numbers.normal(tool_key, samples)
        between = cut_noise * random_numbers.normal(cut_key, samples)
    by_tool, by_cut = direct[layout.TOOL_FORCE], direct[layout.CUTTING_FORCE]
    bend, cornered = 0.0, counts[layout.CORNER] != 0 or counts[layout.SURFACE_CORNER] != 0
    if noisy or cornered:
        bend = bend_of(z, outputs, direct, u0, 0.0, 0.0, f0)
    if cornered:
        bend_now = bend + (by_tool * on_tool + by_cut * between)
        finish_corner(numbers, counts, nodes, settings, bend_now, speed, acceleration)

    while row < out.shape[0] and head + layout.SPARE < nodes.shape[1] and place < span:
        taken = min(LANES, (out.shape[0] - row) * steps - index)
        speeds, changes, rises, crossed = spread(1.0), spread(0.0), spread(1.0), False
        on_grid = 0 if varied else nodes_on_grid(nodes, pointer + 1, place + 1.0, turn)
        if on_grid > 0:
            taken = min(taken, on_grid, int(span - place))
            heights, slopes, curvatures, afters = surface_on_grid(nodes, pointer + 1, settings)
            places, leads = counted(place + 1.0), spread(ahead)
        else:
            taken, crossed = look_up(
                nodes, settings, pointer, place, ahead, phase, speed, height, slope, curvature,
                crosses, taken, block,
            )  # fmt: skip
            if taken == 0:
                break
            heights, slopes = lanes_at(block, at.HEIGHT, 0), lanes_at(block, at.SLOPE, 0)
            curvatures, afters = lanes_at(block, at.CURVATURE, 0), lanes_at(block, at.AFTER, 0)
            places, leads = lanes_at(block, at.PLACE, 0), lanes_at(block, at.AHEAD, 0)
        # The surface met by time at the end of each step, and what the next begins with.
        u1, d1, e1, e2 = heights - feed - leads, slopes, curvatures, afters
        if varied:
            speeds, changes = lanes_at(block, at.SPEED, 0), lanes_at(block, at.ACCELERATION, 0)
            rises = lanes_at(block, at.RISE, 0)
            d1, e1 = by_time(slopes, curvatures, lead, speeds, changes)
            _, e2 = by_time(slopes, afters, lead, speeds, changes)
        us, ds, es = after(u0, u1), after(d0, d1), after(e0, e2)

        forces, betweens = spread(0.0), spread(0.0)
        if noisy:
            sample, step = samples, index
            for k in range(taken):
                if step == 0:
                    on_tool = tool_noise * random_numbers.normal(tool_key, sample)
                    between = cut_noise * random_numbers.normal(cut_key, sample)
                block[at.ON_TOOL, k], block[at.BETWEEN, k] = on_tool, between
                step += 1
                if step == steps:
                    sample, step = sample + 1, 0
            for k in range(taken, LANES):  # what follows is not known yet
                block[at.ON_TOOL, k], block[at.BETWEEN, k] = on_tool, between
            forces, betweens = lanes_at(block, at.ON_TOOL, 0), lanes_at(block, at.BETWEEN, 0)
            if index == 0 and in_cut:
                forced = by_tool * lane(forces, 0) + by_cut * lane(betweens, 0)
                nodes[surface.CURVATURE_AFTER, head] = by_place(
                    s0, bend + forced, lead, speed, acceleration
                )[1]
        f1 = g1 = h1 = fs = gs = hs = spread(0.0)
        if unbalanced:
            for k in range(taken):
                angle = origin + (origin_low + lane(places, k) * turns)
                swing = 0.0
                if varied:
                    swing = speed_curvature(1.0, 0.0, variation, block[at.PHASE, k], frequency)
                block[at.TURNING, k], block[at.TURNING_RATE, k], block[at.TURNING_BEND, k] = (
                    unbalance_force(settings, angle, lane(speeds, k), lane(changes, k), swing)
                )
            f1, g1 = lanes_at(block, at.TURNING, 0), lanes_at(block, at.TURNING_RATE, 0)
            h1 = lanes_at(block, at.TURNING_BEND, 0)
            fs, gs, hs = after(f0, f1), after(g0, g1), after(h0, h1)

        for i in range(2 * n):
            push = spread(0.0)
            if in_cut:
                push = _answer(rules, layout.STEP_SURFACE, i, us, ds, es, u1, d1, e1)
            if crossed:
                for m in range(MOMENTS):
                    of_corner = lanes_at(block, at.MOMENT + m, 0)
                    push = fma(rules[layout.STEP_MOMENT + m, i], of_corner, push)
            if noisy:
                push = fma(rules[layout.STEP_TOOL_FORCE, i], forces, push)
                push = fma(rules[layout.STEP_CUTTING_FORCE, i], betweens, push)
            if unbalanced:
                push = push + _answer(rules, layout.STEP_UNBALANCE, i, fs, gs, hs, f1, g1, h1)
            put(moved, i, 0, push)
        for i in range(2 * n):
            began[i] = z[i]
        if coupled:
            turn_coupled(step_matrix, z, moved)
        else:
            for i in range(n):
                x, y = turned_on(
                    rules[layout.STEP_OWN, i], rules[layout.STEP_PARTNER, i],
                    rules[layout.STEP_PARTNER, n + i], rules[layout.STEP_OWN, n + i],
                    lanes_at(moved, i, 0), lanes_at(moved, n + i, 0), z[i], z[n + i],
                )  # fmt: skip
                put(moved, i, 0, x)
                put(moved, n + i, 0, y)
                z[i], z[n + i] = lane(x, LANES - 1), lane(y, LANES - 1)
        tool, tool_rate = _rest(outputs, layout.TOOL_X), _rest(outputs, layout.TOOL_V)
        work, work_rate = _rest(outputs, layout.WORKPIECE_X), _rest(outputs, layout.WORKPIECE_V)
        b1, v1 = _rest(outputs, layout.BEARING_X), _rest(outputs, layout.BEARING_V)
        bends = fma(direct[layout.SURFACE], u1, direct[layout.UNBALANCE_FORCE] * f1)
        for i in range(2 * n):
            x = lanes_at(moved, i, 0)
            tool = fma(outputs[i, layout.TOOL_X], x, tool)
            tool_rate = fma(outputs[i, layout.TOOL_V], x, tool_rate)
            work = fma(outputs[i, layout.WORKPIECE_X], x, work)
            work_rate = fma(outputs[i, layout.WORKPIECE_V], x, work_rate)
            b1 = fma(outputs[i, layout.BEARING_X], x, b1)
            v1 = fma(outputs[i, layout.BEARING_V], x, v1)
            bends = fma(outputs[i, layout.BEND], x, bends)

        r1, s1 = tool - work, tool_rate - work_rate
        chips, chip_rates = r1 - u1, s1 - d1
        chips_before, chip_rates_before = after(r0 - u0, chips), after(s0 - d0, chip_rates)
        bs, vs = after(b0, b1), after(v0, v1)
        happens = (smaller(tool, work) < -limit) | (larger(tool, work) > limit)
        if sides > 0.0:
            if touch == layout.FREE:
                happens = happens | may_turn_back(clearance - bs, -vs, clearance - b1, -v1, 1.0)
                if sides == 2.0:
                    happens = happens | may_turn_back(clearance + bs, vs, clearance + b1, v1, 1.0)
            elif touch == layout.ABOVE:
                happens = happens | may_turn_back(bs - clearance, vs, b1 - clearance, v1, 1.0)
            else:
                happens = happens | may_turn_back(-bs - clearance, -vs, -b1 - clearance, -v1, 1.0)
        if leaves:
            if in_cut:
                happens = happens | may_turn_back(
                    chips_before, chip_rates_before, chips, chip_rates, 1.0
                )
            else:
                happens = happens | may_turn_back(
                    -chips_before, -chip_rates_before, -chips, -chip_rates, 1.0
                )
        taken, wanted = min(taken, first_of(happens)), taken
        if taken == 0:
            for i in range(2 * n):
                z[i] = began[i]
            break

        # The surface that is left. What lies beyond the steps taken is written anew later.
        if in_cut:
            left_rates, left_bends, next_bends = s1, bends, bends
            if noisy:
                forced = by_tool * forces + by_cut * betweens
                left_bends, next_bends = bends + forced, bends + before(forced)
            if varied:
                left_rates, left_bends = by_place(s1, left_bends, lead, speeds, changes)
                _, next_bends = by_place(s1, next_bends, lead, speeds, changes)
            put(nodes, surface.HEIGHT, head + 1, r1 + leads)
            put(nodes, surface.PITCH, head + 1, rises)
        else:
            left_rates, left_bends, next_bends = slopes, curvatures, afters
            put(nodes, surface.HEIGHT, head + 1, heights - feed)
            for k in range(taken):
                nodes[surface.PITCH, head + 1 + k] = min(
                    lane(rises, k), nodes[surface.PITCH, pointer + 1]
                )
        put(nodes, surface.PLACE, head + 1, places)
        put(nodes, surface.SLOPE_BEFORE, head + 1, left_rates)
        put(nodes, surface.SLOPE_AFTER, head + 1, left_rates)
        put(nodes, surface.CURVATURE_BEFORE, head + 1, left_bends)
        put(nodes, surface.CURVATURE_AFTER, head + 1, next_bends)
        put(nodes, surface.ORDER, head + 1, surface.SMOOTH)

        times = counted(samples + 1.0) / rate
        angles = (places * turns + origin_low) + origin
        force = spread(0.0)
        if in_cut:
            force = fma(stiffness, chips, fma(damping, s1, betweens))
        shown = larger(chips, 0.0) if leaves else chips
        sample_of = (
            times, angles, tool, tool_rate * per_step, work, work_rate * per_step, shown, force,
        )  # fmt: skip
        first = row
        if steps == 1 and row + LANES <= out.shape[0]:
            put_samples(out, row, sample_of)
            row = row + LANES if taken == LANES else row + taken
        else:
            put_samples(block, at.SAMPLE, sample_of)
            for k in range(steps - 1 - index, taken, steps):
                for column in range(COLUMNS):
                    out[row, column] = block[at.SAMPLE + k, column]
                out[row, 0] = (samples + (row - first) + 1) / rate
                row += 1
        if runout or accelerations:
            k = steps - 1 - index
            for written in range(first, row):
                if runout:
                    add_runout(out, written, settings, target * lane(speeds, k))
                if accelerations:
                    for i in range(2 * n):
                        began[i] = moved[i, k]
                    write_accelerations(
                        out, written, began, rules, direct, lane(u1, k), lane(forces, k),
                        lane(betweens, k), lane(f1, k),
                    )  # fmt: skip
                k += steps
        ends = (heights, slopes, afters, places, leads, u1, d1, e2, r1, s1, b1, v1, bends)
        # As a rule all steps are taken: then the next block need not wait for that answer.
        if taken == LANES:
            k = LANES - 1
            height, slope, curvature, place, ahead, u0, d0, e0, r0, s0, b0, v0, bend = _at(ends, k)
            head, pointer = head + LANES, pointer + LANES
            samples, index = (
                (samples + LANES, 0) if steps == 1 else _counted_on(samples, index, LANES, steps)
            )
        else:
            k = taken - 1
            height, slope, curvature, place, ahead, u0, d0, e0, r0, s0, b0, v0, bend = _at(ends, k)
            head, pointer = head + taken, pointer + taken
            samples, index = _counted_on(samples, index, taken, steps)
            for i in range(2 * n):
                z[i] = moved[i, k]
        if on_grid == 0:
            pointer = int(block[at.NODE, k])
        if varied:
            phase, speed, acceleration = (
                block[at.PHASE, k],
                block[at.SPEED, k],
                block[at.ACCELERATION, k],
            )
        if noisy:
            on_tool, between = lane(forces, k), lane(betweens, k)
        if unbalanced:
            f0, g0, h0 = lane(f1, k), lane(g1, k), lane(h1, k)
        if taken < wanted:
            break

    numbers[layout.PLACE], numbers[layout.PHASE], numbers[layout.AHEAD] = place, phase, ahead
    numbers[layout.HEIGHT], numbers[layout.SLOPE] = height, slope
    numbers[layout.CURVATURE] = curvature
    counts[layout.POINTER], counts[layout.HEAD] = pointer, head
    counts[layout.SAMPLES], counts[layout.STEP] = samples, index
    numbers[layout.RELATIVE], numbers[layout.RELATIVE_RATE] = r0, s0
    numbers[layout.AT_BEARING], numbers[layout.AT_BEARING_RATE] = b0, v0
    return row


@compiled(inline=True, borrows=True, inner=True)
def _at(ends: Any, k: int) -> Any:
    """What is so at the end of step `k` of a block."""
    return (
        lane(ends[0], k), lane(ends[1], k), lane(ends[2], k), lane(ends[3], k), lane(ends[4], k),
        lane(ends[5], k), lane(ends[6], k), lane(ends[7], k), lane(ends[8], k), lane(ends[9], k),
        lane(ends[10], k), lane(ends[11], k), lane(ends[12], k),
    )  # fmt: skip


@compiled(inline=True, borrows=True, inner=True)
def _counted_on(samples: int, step: int, taken: int, steps: int) -> tuple[int, int]:
    """Samples, and steps of the one under way, after more steps."""
    return samples + (step + taken) // steps, (step + taken) % steps


@compiled(inline=True, borrows=True, inner=True)
def _rest(outputs: Array, what: int) -> Any:
    """What the rest of the regime means."""
    return spread(outputs[outputs.shape[0] - 1, what])


@compiled(inline=True, borrows=True, inner=True)
def _answer(
    rules: Array, first: int, i: int, u0: Any, d0: Any, e0: Any, u1: Any, d1: Any, e1: Any
) -> Any:
    """How coordinate `i` answers in a step to a quintic with these ends, by six rules."""
    start = fma(rules[first, i], u0, fma(rules[first + 1, i], d0, rules[first + 2, i] * e0))
    end = fma(rules[first + 3, i], u1, fma(rules[first + 4, i], d1, rules[first + 5, i] * e1))
    return start + end
