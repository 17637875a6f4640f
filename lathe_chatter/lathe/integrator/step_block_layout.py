"""The rows of a block of steps: what is worked out step by step, one lane a step."""

from __future__ import annotations

# Of the end of each step.
(
    HEIGHT, SLOPE, CURVATURE, AFTER,  # the surface met, by place, with the curvature after it
    PLACE, AHEAD, PHASE,  # as in state_layout.py
    SPEED, ACCELERATION, RISE,  # over the target speed, its change, steps turned
    NODE,  # at or before the place met
    ON_TOOL, BETWEEN,  # the random forces during the step, N
    TURNING, TURNING_RATE, TURNING_BEND,  # the force of an unbalance, by time
    SAMPLE,  # the eight columns of a sample
) = range(17)  # fmt: skip
ROWS = SAMPLE + 8
