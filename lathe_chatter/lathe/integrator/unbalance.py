"""The force of an unbalance: U Omega^2 cos(angle) on the workpiece, and its derivatives."""

from __future__ import annotations

import math

from lathe_chatter.array_types import Array
from lathe_chatter.compiled import compiled
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.lathe.integrator.spindle import sine_and_cosine


@compiled(inline=True, borrows=True, inner=True)
def angle_at(numbers: Array, settings: Array, place: float) -> float:
    """The spindle's angle at a place, rev since the start."""
    turned: float = numbers[layout.ORIGIN_LOW] + place * (1.0 / settings[layout.TURN])
    return numbers[layout.ORIGIN] + turned  # type: ignore[no-any-return]  # a float


@compiled(borrows=True, inner=True)
def unbalance_force(
    settings: Array, angle: float, ratio: float, ratio_slope: float, ratio_curvature: float
) -> tuple[float, float, float]:
    """The force, N, and its first two derivatives by time in steps.

    Args:
        settings: What machine and cut ask for.
        angle: Of the spindle, rev.
        ratio: Its speed over the target speed.
        ratio_slope: The derivative of that per step.
        ratio_curvature: The second derivative.
    """
    per_step = 2.0 * math.pi / settings[layout.TURN]
    sine, cosine = sine_and_cosine(angle)
    w, dw, ddw = ratio * per_step, ratio_slope * per_step, ratio_curvature * per_step
    square = w * w
    size = settings[layout.UNBALANCE]
    return (
        size * (square * cosine),
        size * (2.0 * w * dw * cosine - square * w * sine),
        size * ((2.0 * (dw * dw + w * ddw) - square * square) * cosine - 5.0 * square * dw * sine),
    )
