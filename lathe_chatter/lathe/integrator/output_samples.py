"""What a call hands out: a sample of the motion, with what sensors see beside it."""

from __future__ import annotations

import math

from lathe_chatter.array_types import Array, Integers
from lathe_chatter.compiled import compiled
from lathe_chatter.lathe.integrator import random_numbers
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.lathe.integrator.spindle import sine_and_cosine

COLUMNS = 8
"""Without accelerations, of which there are two more."""


@compiled(inline=True, borrows=True, inner=True)
def write_sample(
    out: Array, row: int, time: float, angle: float, present: Array, per_step: float, chip: float,
    force: float,
) -> None:  # fmt: skip
    """Write a sample, columns as in `samples.SAMPLE_COLUMNS`."""
    out[row, 0], out[row, 1] = time, angle
    out[row, 2], out[row, 3] = present[layout.TOOL_X], present[layout.TOOL_V] * per_step
    out[row, 4], out[row, 5] = present[layout.WORKPIECE_X], present[layout.WORKPIECE_V] * per_step
    out[row, 6], out[row, 7] = chip, force


@compiled(borrows=True, inner=True)
def add_runout(out: Array, row: int, settings: Array, speed: float) -> None:
    """Add to a sample what the sensors see of bodies that are not round; speed in rev/s."""
    sine, cosine = sine_and_cosine(out[row, 1])
    swing = 2.0 * math.pi * speed * sine
    out[row, 2] += settings[layout.TOOL_RUNOUT] * cosine
    out[row, 3] -= settings[layout.TOOL_RUNOUT] * swing
    out[row, 4] += settings[layout.RUNOUT] * cosine
    out[row, 5] -= settings[layout.RUNOUT] * swing


@compiled(borrows=True, inner=True)
def write_accelerations(
    out: Array, row: int, z: Array, rules: Array, direct: Array, met: float, on_tool: float,
    between: float, turning: float,
) -> None:  # fmt: skip
    """Write both accelerations, m/s2, under the forces that act on the way to this sample."""
    for k in range(2):
        total = direct[4 * k + 4] * met + direct[4 * k + 5] * on_tool
        total += direct[4 * k + 6] * between + direct[4 * k + 7] * turning
        for i in range(z.shape[0]):
            total += rules[layout.TOOL_ACCELERATION + k, i] * z[i]
        out[row, COLUMNS + k] = total


@compiled(borrows=True, inner=True)
def add_sensor_noise(out: Array, rows: int, counts: Integers, settings: Array) -> None:
    """Add to the samples of a call the noise of their sensors."""
    first, seed = counts[layout.SAMPLES] - rows + 1, int(settings[layout.SEED])
    size = settings[layout.SENSOR_NOISE]
    if size > 0.0:
        tool = random_numbers.stream_key(seed, random_numbers.TOOL_SENSOR_STREAM)
        workpiece = random_numbers.stream_key(seed, random_numbers.WORKPIECE_SENSOR_STREAM)
        for row in range(rows):
            out[row, 2] += size * random_numbers.normal(tool, first + row)
            out[row, 4] += size * random_numbers.normal(workpiece, first + row)
    size = settings[layout.ACCELERATION_NOISE]
    if size > 0.0 and out.shape[1] > COLUMNS:
        tool = random_numbers.stream_key(seed, random_numbers.TOOL_ACCELEROMETER_STREAM)
        workpiece = random_numbers.stream_key(seed, random_numbers.WORKPIECE_ACCELEROMETER_STREAM)
        for row in range(rows):
            out[row, COLUMNS] += size * random_numbers.normal(tool, first + row)
            out[row, COLUMNS + 1] += size * random_numbers.normal(workpiece, first + row)
