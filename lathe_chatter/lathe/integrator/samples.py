"""What a call hands out: a sample of the motion, with what sensors see beside it."""

from __future__ import annotations

import math

from lathe_chatter.arrays import Array, Integers
from lathe_chatter.compiled import compiled
from lathe_chatter.lathe.integrator import noise
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.lathe.integrator.propagation import IN_CUT


@compiled(inline=True, borrows=True)
def write_sample(
    out: Array, row: int, time: float, angle: float, xt: float, vt: float, xw: float, vw: float,
    chip: float, force: float,
) -> None:  # fmt: skip
    """Write a sample, columns as in `model.SAMPLE_COLUMNS`."""
    out[row, 0], out[row, 1] = time, angle
    out[row, 2], out[row, 3], out[row, 4], out[row, 5] = xt, vt, xw, vw
    out[row, 6], out[row, 7] = chip, force


@compiled(borrows=True)
def add_measurement(out: Array, row: int, settings: Array, speed: float, seed: int) -> None:
    """Add to a sample what sensors see beside the motion: runout and their own noise."""
    turn = 2.0 * math.pi * (out[row, 1] % 1.0)
    out[row, 4] += settings[layout.RUNOUT] * math.cos(turn)
    out[row, 5] -= settings[layout.RUNOUT] * 2.0 * math.pi * speed * math.sin(turn)
    if settings[layout.SENSOR_NOISE] > 0.0:
        sample = round(out[row, 0] * settings[layout.SAMPLE_RATE])
        out[row, 2] += settings[layout.SENSOR_NOISE] * noise.standard_normal(
            seed, noise.TOOL_SENSOR_STREAM, sample
        )
        out[row, 4] += settings[layout.SENSOR_NOISE] * noise.standard_normal(
            seed, noise.WORKPIECE_SENSOR_STREAM, sample
        )


@compiled(borrows=True)
def write_present(numbers: Array, counts: Integers, settings: Array, out: Array, row: int) -> None:
    """Count and write the sample of the present state."""
    counts[layout.SAMPLES] += 1
    xt, xw = numbers[layout.TOOL_X], numbers[layout.WORKPIECE_X]
    chip = xt - xw - (numbers[layout.MET] - numbers[layout.FED])
    in_cut = counts[layout.REGIME] & IN_CUT != 0
    thickness = chip + settings[layout.NOMINAL_FEED_SPEED] / numbers[layout.SPEED]
    if settings[layout.MAY_LEAVE_CUT] != 0.0:
        thickness = max(chip, 0.0)
    write_sample(
        out, row, counts[layout.SAMPLES] / settings[layout.SAMPLE_RATE],
        counts[layout.TURNS] + numbers[layout.ANGLE],
        xt, numbers[layout.TOOL_V], xw, numbers[layout.WORKPIECE_V],
        thickness, settings[layout.CUTTING_STIFFNESS] * chip if in_cut else 0.0,
    )  # fmt: skip
