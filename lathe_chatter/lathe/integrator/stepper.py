"""The compiled inner loop: exact propagation between located events.

Time advances in whole steps of the sample grid. Quiet ones, nearly all, are taken by the fast
loop of quiet.py; the others are cut at whatever happens inside them (pieces.py).

The loop has no memory of its own: everything that a lathe remembers is in the arrays of
layout.py, so any partition of a run into calls gives the same bits.
"""

from __future__ import annotations

import math

import numpy as np

from lathe_chatter.arrays import Array, Integers
from lathe_chatter.compiled import compiled
from lathe_chatter.lathe.integrator import noise
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.lathe.integrator.event_step import take_step
from lathe_chatter.lathe.integrator.plain_steps import take_quiet_steps
from lathe_chatter.lathe.integrator.plan import PIECE_SIZE, Scratch
from lathe_chatter.lathe.integrator.propagation import TERMS
from lathe_chatter.lathe.integrator.samples import add_measurement, write_present
from lathe_chatter.lathe.integrator.spindle import speed_and_slope


@compiled()
def new_scratch() -> Scratch:
    """Room for the pieces of a step."""
    return Scratch(
        np.empty(PIECE_SIZE), np.empty(4), np.empty(TERMS), np.empty(TERMS), np.empty(6),
        np.empty(TERMS),
    )  # fmt: skip


@compiled(inline=True, borrows=True)
def is_measured(settings: Array) -> bool:
    """Whether sensors see something beside the motion."""
    return bool(settings[layout.RUNOUT] > 0.0 or settings[layout.SENSOR_NOISE] > 0.0)


@compiled(borrows=True)
def take_any_step(
    numbers: Array, counts: Integers, nodes: Array, settings: Array, mechanics: Array,
    matrices: Array, seed: int, out: Array, row: int, events: Array, found: int,
    scratch: Scratch,
) -> tuple[int, int, int]:  # fmt: skip
    """Take a step whatever happens in it, and write sample `row` if it ends one.

    Arrays as in `advance`.

    Returns:
        Samples written (0 or 1), events written so far, and a status as `advance` has it.
    """
    force = 0.0
    if settings[layout.FORCE_NOISE] > 0.0:
        # Held for a sample: the mean of white noise of this density over that time.
        force = settings[layout.FORCE_NOISE] * math.sqrt(settings[layout.SAMPLE_RATE])
        force *= noise.standard_normal(seed, noise.FORCE_STREAM, counts[layout.SAMPLES])
        if counts[layout.STEP] == 0 and numbers[layout.LEFT] == 0.0:
            counts[layout.CORNER] = min(counts[layout.CORNER] or 2, 2)
    found, status = take_step(
        numbers, counts, nodes, settings, mechanics, matrices, force, events, found, scratch
    )
    if status != layout.FINISHED:
        return 0, found, status
    counts[layout.STEP] += 1
    if counts[layout.STEP] < counts[layout.STEPS]:
        return 0, found, layout.FINISHED
    counts[layout.STEP] = 0
    xt, xw = numbers[layout.TOOL_X], numbers[layout.WORKPIECE_X]
    if not (abs(xt) <= settings[layout.LIMIT] and abs(xw) <= settings[layout.LIMIT]):
        return 0, found, layout.GUARD
    write_present(numbers, counts, settings, out, row)
    if is_measured(settings):
        speed, _ = speed_and_slope(
            numbers[layout.SPEED], 0.0, settings[layout.VARIATION],
            numbers[layout.PHASE], settings[layout.VARIATION_FREQUENCY],
        )  # fmt: skip
        add_measurement(out, row, settings, speed, seed)
    return 1, found, layout.FINISHED


@compiled(nogil=True)
def advance(
    numbers: Array,
    counts: Integers,
    nodes: Array,
    settings: Array,
    mechanics: Array,
    matrices: Array,
    seed: int,
    out: Array,
    events: Array,
) -> tuple[int, int, int]:
    """Cut on for `out.shape[0]` samples.

    Args:
        numbers: The remembered numbers (layout.NUMBERS_SIZE,), changed in place.
        counts: The remembered integers (layout.COUNTS_SIZE,), changed in place.
        nodes: The surface (capacity, surface.NODE_SIZE), changed in place.
        settings: The cut (layout.SETTINGS_SIZE,).
        mechanics: The constants of machine and cut (propagation.MECHANICS_SIZE,).
        matrices: The response to a whole step, from `propagation.step_matrices`.
        seed: Of the noise.
        out: Written: the samples (n, 8).
        events: Written: samples before the event, s since that sample, kind (m, 3).

    Returns:
        Samples written, events written, and FINISHED, GUARD, or what must be made larger
        before the rest is asked for: SURFACE_FULL or EVENTS_FULL.
    """
    scratch = new_scratch()
    row = found = 0
    while True:
        first = row
        row = take_quiet_steps(numbers, counts, nodes, settings, mechanics, matrices, out, row)
        if is_measured(settings):
            for done in range(first, row):
                add_measurement(out, done, settings, numbers[layout.SPEED], seed)
        if row == out.shape[0]:
            return row, found, layout.FINISHED
        # Which loop takes a step must not depend on the room there is, or bits would.
        if counts[layout.HEAD] + 2 >= nodes.shape[0]:
            return row, found, layout.SURFACE_FULL
        wrote, found, status = take_any_step(
            numbers, counts, nodes, settings, mechanics, matrices, seed, out, row, events, found,
            scratch,
        )  # fmt: skip
        row += wrote
        if status != layout.FINISHED:
            return row, found, status
