"""Where the integrator's inner loop keeps what: names for places in plain arrays.

Compiled code wants arrays of numbers, people want names. The lathe's whole memory is
`numbers`, `counts` and the nodes of the surface (surface.py); `settings` and the coefficients of
the regimes (coefficients.py) follow from the machine and the cut.

Time is counted in steps, so velocities are m per step. The spindle's angle is counted in steps
too: in those that a step at the target speed turns. While the speed is steady the two are one.
"""

from __future__ import annotations

# numbers: what a lathe remembers. The 2 n coordinates of its modes follow them, and then the
# 2 n numbers of the motion that these were made from at a start or a change.
(
    PLACE,  # of the spindle since its origin, in steps at the target speed
    ORIGIN, ORIGIN_LOW,  # that origin, rev since the start, and what rounding took from it
    AHEAD,  # by how much the feed is ahead of a steady one, m
    SPEED,  # rev/s, without its variation
    PHASE,  # of the speed variation, cycles in [0, 1)
    HEIGHT, SLOPE, CURVATURE,  # the surface at the tool, by place: m, m/step, m/step2
    RELATIVE, RELATIVE_RATE,  # r and r', m and m/step
    AT_BEARING, AT_BEARING_RATE,  # displacement and velocity there
    LEFT,  # of a step that was begun; 0 between steps
) = range(14)  # fmt: skip
NUMBERS_SIZE = 16
"""With room, so that what follows begins a line of the processor's cache."""

# counts: what it remembers as integers.
(
    SAMPLES,  # taken since the start
    REGIME,  # IN_CUT + 2 * touch, see below
    POINTER,  # the node at or before the place that the tool meets
    HEAD,  # the newest node
    CORNER,  # lowest derivative of the motion that jumps at the head, 0 for none
    SURFACE_CORNER,  # the same of the surface left there where it is not the motion's
    STEPS,  # per sample
    STEP,  # of the sample under way that is next
    FLIPS,  # events in the step under way
    MADE,  # 1 where the coordinates are still those made from the motion, see `numbers`
) = range(10)
COUNTS_SIZE = 10

# settings: what machine and cut ask for.
(
    SAMPLE_RATE,  # Hz
    STEP_LENGTH,  # s
    TARGET_SPEED,  # rev/s
    ACCELERATION,  # of the speed over the target speed, per step; 0 where the speed steps
    VARIATION, VARIATION_FREQUENCY,  # fraction, cycles/step
    TURN,  # steps a turn takes at the target speed
    SPAN,  # steps after which the origin of the place moves on, a power of two
    FEED,  # m/rev at the target speed; 0 where the force is taken about its mean
    LEAD,  # m/step that the feed gains on the spindle where that stands still; 0 if geared to it
    CUTTING_STIFFNESS,  # C w, N/m
    PROCESS_DAMPING,  # C_pd w / V at the target speed, N per m/step
    MAY_LEAVE_CUT,  # 1 or 0
    SIDES,  # of the bearing that are watched: 0, 1 or 2
    CLEARANCE,  # m
    FORCE_NOISE, CUTTING_FORCE_NOISE,  # rms of a force held for a sample, N
    SENSOR_NOISE, ACCELERATION_NOISE,  # m, m/s2
    RUNOUT, TOOL_RUNOUT,  # m
    UNBALANCE,  # kg m, over the step squared: times (rad/step)^2 it is a force
    LIMIT,  # m, of a displacement that still means something
    SEED,  # of the noise
    WEIGHTS,  # 15: of two nodes a step apart at the place met between them, see `between_nodes`
) = range(25)  # fmt: skip
SETTINGS_SIZE = 40

# A regime is IN_CUT, or 0, plus twice where the workpiece touches its bearing.
OUT_OF_CUT, IN_CUT = 0, 1
FREE, ABOVE, BELOW = 0, 1, 2
REGIMES = 6

SPARE = 12
"""Nodes for which there must be room before any step: those of a block, and two more."""

# How a call of the loop ended.
FINISHED, GUARD, SURFACE_FULL, EVENTS_FULL = 0, 1, 2, 3

# Kinds of events, and none.
BEARING_ENGAGES, BEARING_RELEASES, TOOL_LEAVES, TOOL_ENTERS, NO_EVENT = 0, 1, 2, 3, -1

# Rows of the coefficients of a regime (rows, 2 n); time in steps, forces in N.
(
    OWN, PARTNER,  # z' = OWN z + PARTNER (partner of z) ...
    BY_SURFACE, BY_TOOL_FORCE, BY_CUTTING_FORCE, BY_UNBALANCE,  # ... + inputs
    STEP_OWN, STEP_PARTNER,  # the same after a whole step
    STEP_SURFACE,  # six rows: U, U', U'' at the start of the step, then at its end
    STEP_UNBALANCE,  # six rows: that force alike
    STEP_TOOL_FORCE, STEP_CUTTING_FORCE,  # a force held for the step
    STEP_MOMENT,  # five rows: moments of what the surface has beside a quintic
    RELATIVE_RATE_ROW,  # r' of the coordinates
    TOOL_ACCELERATION, WORKPIECE_ACCELERATION,  # m/s2
) = 0, 1, 2, 3, 4, 5, 6, 7, 8, 14, 20, 21, 22, 27, 28, 29  # fmt: skip
ROWS = 32
"""With room, so that each regime begins a line of the processor's cache."""

# How a coordinate answers (SERIES, SERIES_SIZE) by its derivatives: those of itself and partner
# are generator^(k + 1), k = 0, 1 ..., those of an input generator^k input.
OF_SURFACE, OF_TOOL_FORCE, OF_CUTTING_FORCE, OF_UNBALANCE, OF_ITSELF, OF_PARTNER = range(6)
SERIES = 6
SERIES_BEGIN, SERIES_SIZE = 8, 24
"""Zeros before them: an input's derivative j begins to act j derivatives later."""

# Columns of the outputs (2 n + 1, 8); the last row is the regime's rest.
(
    TOOL_X, TOOL_V, WORKPIECE_X, WORKPIECE_V,  # m, m/step
    BEND,  # r'' but for what acts directly, m/step2
    BEARING_X, BEARING_V,
) = range(7)  # fmt: skip
OUTPUTS = 8

# What acts on accelerations directly: (3, 4) of r'' in m/step2, tool and workpiece in m/s2.
SURFACE, TOOL_FORCE, CUTTING_FORCE, UNBALANCE_FORCE = range(4)
DIRECT = 16
"""Twelve of these in a regime, then whether its coordinates are coupled (1) or in pairs (0), and
its largest |lambda|, per step."""
COUPLED, RATE = 12, 13
