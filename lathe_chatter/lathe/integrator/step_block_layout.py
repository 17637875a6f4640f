"""The rows of a block of steps: what is worked out step by step, one lane a step."""

from __future__ import annotations

# Of the end of each step.
(
    HEIGHT, SLOPE, CURVATURE, AFTER,  # the surface met, by place, with the curvature after it
    PLACE, AHEAD, PHASE,  # as in state_layout.py
    SPEED, ACCELERATION, RISE,  # over the target speed, its change, steps turned
    NODE,  # at or before the place met
    LEFT, EXACT, CORNER,  # the node before that place, 1 if the next is there, one in between
    ON_TOOL, BETWEEN,  # the random forces during the step, N
    TURNING, TURNING_RATE, TURNING_BEND,  # the force of an unbalance, by time
    MOMENT,  # five of a corner that is met inside the step, see surface_moments.py
) = range(20)  # fmt: skip
SAMPLE = MOMENT + 5
"""The eight columns of a sample."""
ROWS = SAMPLE + 8
