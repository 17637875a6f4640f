"""Whole steps in which nothing happens, as fast as they can be taken.

Nearly every step of a run is one: steady speed, no corner in the surface that the tool meets,
no change of contact or cutting. This loop takes such steps with everything in registers and
stops before the first that is not, which pieces.py then takes.
"""

from __future__ import annotations

from lathe_chatter.arrays import Array, Integers
from lathe_chatter.compiled import compiled
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.lathe.integrator import surface
from lathe_chatter.lathe.integrator.events import may_turn_back
from lathe_chatter.lathe.integrator.plan import DETAIL, add
from lathe_chatter.lathe.integrator.propagation import (
    CLEARANCE,
    ENGAGED,
    IN_CUT,
    relative_acceleration,
    whole_step,
)
from lathe_chatter.lathe.integrator.samples import write_sample
from lathe_chatter.lathe.integrator.surface_kinks import finish_corner


@compiled(borrows=True)
def take_quiet_steps(
    numbers: Array,
    counts: Integers,
    nodes: Array,
    settings: Array,
    mechanics: Array,
    matrices: Array,
    out: Array,
    row: int,
) -> int:
    """Take quiet steps, beginning with sample `row`; arrays as in `stepper.advance`.

    Returns:
        The sample that is next.
    """
    speed, feed_speed = numbers[layout.SPEED], settings[layout.FEED_SPEED]
    unsteady = speed != settings[layout.TARGET_SPEED] or settings[layout.VARIATION] != 0.0
    begun = numbers[layout.LEFT] != 0.0
    if unsteady or begun or settings[layout.FORCE_NOISE] != 0.0 or row == out.shape[0]:
        return row
    if counts[layout.CORNER] != 0 or counts[layout.SURFACE_CORNER] != 0:
        finish_corner(numbers, counts, nodes, settings, matrices, 0.0, speed, 0.0)
    steps, index = counts[layout.STEPS], counts[layout.STEP]
    rate = settings[layout.SAMPLE_RATE]
    step = 1.0 / (rate * steps)
    rise, near = speed * step, surface.MERGE * step * speed
    per_speed, square = 1.0 / speed, speed * speed
    nominal = settings[layout.NOMINAL_FEED_SPEED] / speed
    per_square, feed = 1.0 / square, feed_speed * step
    limit = settings[layout.LIMIT]
    may_leave = settings[layout.MAY_LEAVE_CUT] != 0.0
    has_clearance = settings[layout.HAS_CLEARANCE] != 0.0
    clearance = mechanics[CLEARANCE]
    regime = counts[layout.REGIME]
    matrix = matrices[regime]
    in_cut = regime & IN_CUT != 0
    stiffness = settings[layout.CUTTING_STIFFNESS] if in_cut else 0.0
    bearing_side = 1.0 if regime & ENGAGED != 0 else -1.0
    chip_side = 1.0 if in_cut else -1.0

    xt, vt = numbers[layout.TOOL_X], numbers[layout.TOOL_V]
    xw, vw = numbers[layout.WORKPIECE_X], numbers[layout.WORKPIECE_V]
    angle, angle_low = numbers[layout.ANGLE], numbers[layout.ANGLE_LOW]
    fed, fed_low = numbers[layout.FED], numbers[layout.FED_LOW]
    met, met_slope = numbers[layout.MET], numbers[layout.MET_SLOPE]
    met_curvature = numbers[layout.MET_CURVATURE]
    pointer, head = counts[layout.POINTER], counts[layout.HEAD]
    samples, turns, pieces = (
        counts[layout.SAMPLES],
        counts[layout.TURNS],
        counts[layout.PIECES],
    )
    u0, du0, ddu0 = met - fed, met_slope * speed - feed_speed, met_curvature * square

    while row < out.shape[0] and head + 2 < nodes.shape[0]:
        new_angle, new_angle_low = add(angle, angle_low, rise)
        if new_angle >= 1.0 or rise > DETAIL * nodes[pointer + 1, surface.PITCH]:
            break
        place = new_angle - 1.0
        node = pointer
        if nodes[node + 1, surface.ANGLE] < place - near:
            node += 1
            if nodes[node, surface.ORDER] <= surface.LAST_ORDER:
                break
        following = nodes[node + 1, surface.ANGLE]
        if following > place + near:
            next_met, next_slope, next_curvature = surface.surface_at(nodes, node, place)
        else:
            node += 1
            if nodes[node, surface.ORDER] <= surface.LAST_ORDER or following < place - near:
                break
            next_met = nodes[node, surface.HEIGHT]
            next_slope = nodes[node, surface.SLOPE_BEFORE]
            next_curvature = nodes[node, surface.CURVATURE_BEFORE]
        new_fed, new_fed_low = add(fed, fed_low, feed)
        u1 = next_met - new_fed
        du1, ddu1 = next_slope * speed - feed_speed, next_curvature * square
        xt1, vt1, xw1, vw1 = whole_step(matrix, xt, vt, xw, vw, u0, du0, ddu0, u1, du1, ddu1)
        chip = xt1 - xw1 - u1
        if has_clearance and may_turn_back(
            bearing_side * (xw - clearance), bearing_side * vw,
            bearing_side * (xw1 - clearance), bearing_side * vw1, step,
        ):  # fmt: skip
            break
        if may_leave and may_turn_back(
            chip_side * (xt - xw - u0), chip_side * (vt - vw - du0),
            chip_side * chip, chip_side * (vt1 - vw1 - du1), step,
        ):  # fmt: skip
            break
        if not (abs(xt1) <= limit and abs(xw1) <= limit):
            break

        head += 1
        if in_cut:
            bend = relative_acceleration(matrix, xt1, vt1, xw1, vw1, u1, 0.0)
            surface.write_node(
                nodes, head, new_angle, new_fed + xt1 - xw1,
                (feed_speed + vt1 - vw1) * per_speed, bend * per_square, rise,
            )  # fmt: skip
        else:
            surface.write_node(
                nodes, head, new_angle, next_met, next_slope, next_curvature,
                min(rise, nodes[pointer + 1, surface.PITCH]),
            )  # fmt: skip
        xt, vt, xw, vw = xt1, vt1, xw1, vw1
        u0, du0, ddu0 = u1, du1, ddu1
        angle, angle_low, fed, fed_low = new_angle, new_angle_low, new_fed, new_fed_low
        met, met_slope, met_curvature = next_met, next_slope, next_curvature
        pointer = node
        pieces += 1
        index += 1
        if index == steps:
            index = 0
            samples += 1
            write_sample(
                out, row, samples / rate, turns + angle, xt, vt, xw, vw,
                max(chip, 0.0) if may_leave else chip + nominal, stiffness * chip,
            )  # fmt: skip
            row += 1

    numbers[layout.TOOL_X], numbers[layout.TOOL_V] = xt, vt
    numbers[layout.WORKPIECE_X], numbers[layout.WORKPIECE_V] = xw, vw
    numbers[layout.ANGLE], numbers[layout.ANGLE_LOW] = angle, angle_low
    numbers[layout.FED], numbers[layout.FED_LOW] = fed, fed_low
    numbers[layout.MET], numbers[layout.MET_SLOPE] = met, met_slope
    numbers[layout.MET_CURVATURE] = met_curvature
    counts[layout.POINTER], counts[layout.HEAD] = pointer, head
    counts[layout.SAMPLES], counts[layout.PIECES] = samples, pieces
    counts[layout.STEP] = index
    return row
