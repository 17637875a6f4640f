"""The compiled inner loop: exact propagation between located events.

Time advances in whole steps of the sample grid. Plain ones, nearly all, are taken by the fast
loop of plain_steps.py; the others are cut at whatever happens inside them (event_step.py).

The loop has no memory of its own: everything that a lathe remembers is in the arrays of
state_layout.py, so any partition of a run into calls gives the same bits.
"""

from __future__ import annotations

import math

import numpy as np

from lathe_chatter.array_types import Array, Integers
from lathe_chatter.compiled import compiled
from lathe_chatter.lathe.integrator import random_numbers, surface
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.lathe.integrator import step_block_layout as at
from lathe_chatter.lathe.integrator.event_in_piece import Machine, Scratch
from lathe_chatter.lathe.integrator.event_step import take_step
from lathe_chatter.lathe.integrator.output_samples import (
    COLUMNS,
    add_runout,
    add_sensor_noise,
    write_accelerations,
    write_sample,
)
from lathe_chatter.lathe.integrator.plain_steps import take_plain_steps
from lathe_chatter.lathe.integrator.propagation import TERMS
from lathe_chatter.lathe.integrator.simd_vectors import LANES
from lathe_chatter.lathe.integrator.spindle import speed_and_slope
from lathe_chatter.lathe.integrator.unbalance import angle_at, unbalance_force

_NONE = np.zeros(1, dtype=np.int64)


def room_for(modes: int) -> Array:
    """Room for a call of `advance`; it must be left as it is between calls."""
    width = (2 * modes + _LINE - 1) // _LINE * _LINE
    return surface.aligned(_SMALL + 2 * width + width * (TERMS + LANES) + 3 * (width + TERMS))


_BLOCK = 16 + 16 + 8 + 24 + 2 * TERMS
_SMALL = _BLOCK + at.ROWS * LANES
"""Numbers that are needed whatever the number of modes."""
_LINE = 8
"""Numbers in a line of the processor's cache."""


@compiled(borrows=True, inner=True)
def _move_origin(numbers: Array, counts: Integers, nodes: Array, settings: Array) -> None:
    """Count places from a later origin, before they become large or where they left the grid."""
    place, shift = numbers[layout.PLACE], 0.0
    steady = settings[layout.VARIATION] == 0.0
    steady = steady and numbers[layout.SPEED] == settings[layout.TARGET_SPEED]
    if steady and place != math.floor(place):
        shift = place
    if place >= settings[layout.SPAN] and shift == 0.0:
        shift = settings[layout.SPAN]
    if shift == 0.0:
        return
    pointer, head = counts[layout.POINTER], counts[layout.HEAD]
    surface.forget(nodes, pointer, head, shift)
    counts[layout.POINTER], counts[layout.HEAD] = 0, head - pointer
    numbers[layout.PLACE] = place - shift
    turned = shift / settings[layout.TURN] + numbers[layout.ORIGIN_LOW]
    total = numbers[layout.ORIGIN] + turned
    numbers[layout.ORIGIN_LOW] = turned - (total - numbers[layout.ORIGIN])
    numbers[layout.ORIGIN] = total


@compiled(inline=True, borrows=True, inner=True)
def _take_any_step(
    numbers: Array, z: Array, counts: Integers, nodes: Array, settings: Array, machine: Machine,
    out: Array, row: int, events: Array, found: int, scratch: Scratch,
) -> tuple[int, int, int]:  # fmt: skip
    """Take a step whatever happens in it, and write sample `row` if it ends one.

    Returns:
        Samples written (0 or 1), events written so far, and a status as `advance` has it.
    """
    on_tool, between = settings[layout.FORCE_NOISE], settings[layout.CUTTING_FORCE_NOISE]
    seed = int(settings[layout.SEED])
    if on_tool != 0.0:
        key = random_numbers.stream_key(seed, random_numbers.FORCE_STREAM)
        on_tool *= random_numbers.normal(key, counts[layout.SAMPLES])
    if between != 0.0:
        key = random_numbers.stream_key(seed, random_numbers.CUTTING_FORCE_STREAM)
        between *= random_numbers.normal(key, counts[layout.SAMPLES])
    found, status = take_step(
        numbers, z, counts, nodes, settings, machine, on_tool, between, events, found, scratch
    )  # fmt: skip
    if status != layout.FINISHED:
        return 0, found, status
    counts[layout.STEP] += 1
    if counts[layout.STEP] < counts[layout.STEPS]:
        return 0, found, layout.FINISHED
    counts[layout.STEP] = 0
    seen, limit = scratch.seen[0], settings[layout.LIMIT]
    if not (abs(seen[layout.TOOL_X]) <= limit and abs(seen[layout.WORKPIECE_X]) <= limit):
        return 0, found, layout.GUARD
    counts[layout.SAMPLES] += 1
    met = numbers[layout.HEIGHT] - settings[layout.FEED] - numbers[layout.AHEAD]
    chip, force, regime = numbers[layout.RELATIVE] - met, 0.0, counts[layout.REGIME]
    base, slope = numbers[layout.SPEED] / settings[layout.TARGET_SPEED], 0.0
    if base != 1.0:
        slope = math.copysign(settings[layout.ACCELERATION], 1.0 - base)
    speed, acceleration = base, 0.0
    if slope != 0.0 or settings[layout.VARIATION] != 0.0:
        speed, acceleration = speed_and_slope(
            base, slope, settings[layout.VARIATION], numbers[layout.PHASE],
            settings[layout.VARIATION_FREQUENCY],
        )  # fmt: skip
    more = 0.0
    if regime & layout.IN_CUT != 0:
        damping, rate = settings[layout.PROCESS_DAMPING], numbers[layout.RELATIVE_RATE]
        more = damping * (1.0 / speed - 1.0) * rate
        force = settings[layout.CUTTING_STIFFNESS] * chip + damping * rate + more + between
    write_sample(
        out, row, counts[layout.SAMPLES] / settings[layout.SAMPLE_RATE],
        angle_at(numbers, settings, numbers[layout.PLACE]), seen,
        1.0 / settings[layout.STEP_LENGTH],
        max(chip, 0.0) if settings[layout.MAY_LEAVE_CUT] != 0.0 else chip, force,
    )  # fmt: skip
    if settings[layout.RUNOUT] != 0.0 or settings[layout.TOOL_RUNOUT] != 0.0:
        add_runout(out, row, settings, settings[layout.TARGET_SPEED] * speed)
    if out.shape[1] > COLUMNS:
        turning = 0.0
        if settings[layout.UNBALANCE] != 0.0:
            turning, _, _ = unbalance_force(settings, out[row, 1], speed, acceleration, 0.0)
        write_accelerations(
            out, row, z, machine.rules[regime], machine.direct[regime], met, on_tool,
            between + more, turning,
        )  # fmt: skip
    return 1, found, layout.FINISHED


@compiled(borrows=True, inner=True)
def _cut_on(
    numbers: Array, z: Array, counts: Integers, nodes: Array, settings: Array, machine: Machine,
    out: Array, events: Array, scratch: Scratch,
) -> tuple[int, int, int]:  # fmt: skip
    """The loop of `advance`, which only cuts its arrays into parts."""
    # No literals: each would have the loops compiled once more.
    row, found, status = int(_NONE[0]), int(_NONE[0]), int(_NONE[0])
    while status == layout.FINISHED:
        if numbers[layout.LEFT] == 0.0:
            _move_origin(numbers, counts, nodes, settings)
        regime = counts[layout.REGIME]
        row = take_plain_steps(
            numbers, z, counts, nodes, settings, machine.rules[regime],
            machine.outputs[regime], machine.direct[regime],
            machine.matrices[regime, 1], out, row, scratch.block, scratch.moved, scratch.other,
        )  # fmt: skip
        if row == out.shape[0]:
            break
        # Which loop takes a step must not depend on the room there is, or bits would.
        if counts[layout.HEAD] + layout.SPARE >= nodes.shape[1]:
            status = layout.SURFACE_FULL
            break
        if numbers[layout.LEFT] == 0.0 and numbers[layout.PLACE] >= settings[layout.SPAN]:
            continue
        wrote, found, status = _take_any_step(
            numbers, z, counts, nodes, settings, machine, out, row, events, found, scratch
        )
        row += wrote
    return row, found, status


@compiled(nogil=True)
def advance(
    numbers: Array,
    counts: Integers,
    nodes: Array,
    flat: Array,
    out: Array,
    events: Array,
    room: Array,
) -> tuple[int, int, int]:
    """Cut on for `out.shape[0]` samples.

    Args:
        numbers: The remembered numbers (layout.NUMBERS_SIZE,), after them the coordinates (2n,)
            and the motion that they were made from (2n,), changed in place.
        counts: The remembered integers (layout.COUNTS_SIZE,), changed in place.
        nodes: The surface (surface.NODE_SIZE, capacity), changed in place.
        flat: Settings and coefficients, from `coefficients.constants_of`.
        out: Written: the samples (n, 8), or (n, 10) with accelerations.
        events: Written: samples before the event, s since that sample, kind (m, 3).
        room: From `room_for`.

    Returns:
        Samples written, events written, and FINISHED, GUARD, or what must be made larger
        before the rest is asked for: SURFACE_FULL or EVENTS_FULL.
    """
    n2, regimes = (numbers.shape[0] - layout.NUMBERS_SIZE) // 2, layout.REGIMES
    z = numbers[layout.NUMBERS_SIZE : layout.NUMBERS_SIZE + n2]
    settings = flat[: layout.SETTINGS_SIZE]
    first = layout.SETTINGS_SIZE
    last = first + regimes * layout.ROWS * n2
    rules = flat[first:last].reshape((regimes, layout.ROWS, n2))
    first, last = last, last + regimes * (n2 + 1) * layout.OUTPUTS
    outputs = flat[first:last].reshape((regimes, n2 + 1, layout.OUTPUTS))
    first, last = last, last + regimes * layout.DIRECT
    direct = flat[first:last].reshape((regimes, layout.DIRECT))
    first, last = last, last + regimes * n2 * layout.SERIES * layout.SERIES_SIZE
    answers = flat[first:last].reshape((regimes, n2 * layout.SERIES, layout.SERIES_SIZE))
    first, last = last, last + regimes * regimes * (n2 + 1) * n2
    moves = flat[first:last].reshape((regimes, regimes, n2 + 1, n2))
    matrices = flat[last:].reshape((regimes, 2, n2, n2))
    machine = Machine(rules, outputs, direct, answers, moves, matrices)
    width = (n2 + _LINE - 1) // _LINE * _LINE
    series = _SMALL + 2 * width
    moved = series + n2 * TERMS
    work = moved + n2 * LANES
    scratch = Scratch(
        room[:16], room[_SMALL : _SMALL + n2], room[_SMALL + width : _SMALL + width + n2],
        room[32:40].reshape((1, 8)), room[series:moved].reshape((n2, TERMS)),
        room[work : work + 3 * (n2 + TERMS)].reshape((3, n2 + TERMS)),
        room[64:_BLOCK].reshape((2, TERMS)), room[16:32], room[40:64].reshape((1, 24)),
        room[_BLOCK:_SMALL].reshape((at.ROWS, LANES)), room[moved:work].reshape((n2, LANES)),
    )  # fmt: skip
    if out.shape[0] > 0:
        counts[layout.MADE] = 0
    row, found, status = _cut_on(
        numbers, z, counts, nodes, settings, machine, out, events, scratch
    )
    if settings[layout.SENSOR_NOISE] > 0.0 or settings[layout.ACCELERATION_NOISE] > 0.0:
        add_sensor_noise(out, row, counts, settings)
    return row, found, status
