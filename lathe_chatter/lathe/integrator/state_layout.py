"""Where the integrator's inner loop keeps what: names for places in plain arrays.

Compiled code wants arrays of numbers, people want names. The lathe's whole memory is
`numbers`, `counts` and the nodes of the surface (surface.py); `settings` and the mechanical
constants (propagation.py) follow from the machine and the cut.
"""

from __future__ import annotations

# numbers: what a lathe remembers.
(
    TOOL_X, TOOL_V, WORKPIECE_X, WORKPIECE_V,  # m, m/s
    ANGLE, ANGLE_LOW,  # rev in the current turn, and what rounding took from the sum
    FED, FED_LOW,  # feed since the current turn began, m, and the same
    SPEED,  # rev/s, without its variation
    PHASE,  # of the speed variation, cycles in [0, 1)
    MET, MET_SLOPE, MET_CURVATURE,  # the surface at the tool, by angle: m, m/rev, m/rev2
    LEFT,  # of a step that was begun, s; 0 between steps
) = range(14)  # fmt: skip
NUMBERS_SIZE = 14

# counts: what it remembers as integers.
(
    SAMPLES,  # taken since the start
    TURNS,  # whole turns since the start
    REGIME,  # propagation.IN_CUT + propagation.ENGAGED, where they hold
    POINTER,  # the node at or before the place that the tool meets
    HEAD,  # the newest node
    CORNER,  # lowest derivative of the motion that jumps at the head, 0 for none
    SURFACE_CORNER,  # the same of the surface left there where it is not the motion's
    PIECES,  # whole and cut steps since the start
    STEPS,  # per sample
    STEP,  # of the sample under way that is next
    FLIPS,  # events in the step under way
) = range(11)
COUNTS_SIZE = 11

# settings: what machine and cut ask for.
(
    SAMPLE_RATE,  # Hz
    TARGET_SPEED,  # rev/s
    ACCELERATION,  # rev/s2, 0 where the speed steps
    VARIATION, VARIATION_FREQUENCY,  # fraction, Hz
    FEED_SPEED,  # m/s; 0 where the force is taken about its mean
    NOMINAL_FEED_SPEED,  # m/s, for the chip thickness that is reported
    CUTTING_STIFFNESS,  # C w, N/m
    MAY_LEAVE_CUT, HAS_CLEARANCE,  # 1 or 0
    FORCE_NOISE, SENSOR_NOISE, RUNOUT,  # N/sqrt(Hz), m, m
    LIMIT,  # m, of a displacement that still means something
) = range(14)  # fmt: skip
SETTINGS_SIZE = 14

# How a call of the loop ended.
FINISHED, GUARD, SURFACE_FULL, EVENTS_FULL = 0, 1, 2, 3

# Kinds of events, and none.
BEARING_ENGAGES, BEARING_RELEASES, TOOL_LEAVES, TOOL_ENTERS, NO_EVENT = 0, 1, 2, 3, -1
