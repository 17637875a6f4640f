"""The compiled inner loop: exact propagation between located events.

Time advances in whole steps of the sample grid. A step is one piece unless something happens
inside it: the tool meets a corner in the surface of the turn before, the bearing engages or
releases, the tool leaves or enters the cut, or a speed ramp ends. Then the step is cut there,
and each piece is solved exactly (propagation.py).

Everything that a lathe remembers is in `numbers`, `counts` and the nodes of the surface; the
loop itself has no memory, so any partition of a run into calls gives the same bits.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from lathe_chatter import noise, propagation, surface
from lathe_chatter.events import NEVER, first_crossing
from lathe_chatter.model import Array
from lathe_chatter.propagation import ENGAGED, IN_CUT, TERMS
from lathe_chatter.spindle import speed_and_slope, time_to_turn, turned

# What a lathe remembers as numbers.
(
    TOOL_X, TOOL_V, WORKPIECE_X, WORKPIECE_V,
    ANGLE, ANGLE_LOW,  # rev in the current turn, and what rounding took from it
    ADVANCE, ADVANCE_LOW,  # feed since the current turn began, m, and the same
    SPEED,  # rev/s, without the variation
    PHASE,  # of the speed variation, cycles in [0, 1)
    MET, MET_SLOPE, MET_CURVATURE,  # the surface at the tool, by angle
) = range(13)  # fmt: skip
NUMBERS_SIZE = 13

# What it remembers as integers.
(
    SAMPLES,  # taken since the start
    TURNS,  # whole turns since the start
    REGIME,  # IN_CUT + ENGAGED
    POINTER,  # the node at or before the place that the tool meets
    HEAD,  # the newest node
    BREAK,  # lowest derivative of the surface that jumps at the head, 0 for none
    STEPS,  # taken, whole and cut
) = range(7)
COUNTS_SIZE = 7

# What the cut and the machine say.
(
    SAMPLE_RATE,
    STEPS_PER_SAMPLE,
    TARGET_SPEED,  # rev/s
    ACCELERATION,  # rev/s2
    VARIATION, VARIATION_FREQUENCY,
    FEED_SPEED,  # m/s; 0 where the force has no mean
    CUTTING_STIFFNESS,  # C w, N/m
    NOMINAL_FEED_SPEED,  # m/s, for the chip thickness that is reported
    MAY_LEAVE_CUT, HAS_CLEARANCE,  # 1 or 0
    FORCE_NOISE, SENSOR_NOISE, RUNOUT,
    LIMIT,  # m, of a displacement that still means something
) = range(15)  # fmt: skip
SETTINGS_SIZE = 15

RUNNING, GUARD = 0, 1
BEARING_ENGAGES, BEARING_RELEASES, TOOL_LEAVES, TOOL_ENTERS = range(4)
_NO_EVENT = -1
_FLIPS = 4
"""Events at one instant before the loop moves on: grazing contact is no reason to stand still."""


@njit(cache=True)
def _fast_two_sum(high: float, low: float, increment: float) -> tuple[float, float]:
    """Compensated addition: a turn of 10^5 steps sums as exactly as one step."""
    increment += low
    total = high + increment
    return total, increment - (total - high)


@njit(cache=True)
def _accelerations(
    state: Array, regime: int, mechanics: Array, force: float, met: float
) -> tuple[float, float]:
    """Second derivatives of both displacements, m/s2; `met` is the surface at the tool, m."""
    chip = state[TOOL_X] - state[WORKPIECE_X] - met
    tool = force * mechanics[propagation.TOOL_COMPLIANCE]
    tool -= mechanics[propagation.TOOL_STIFFNESS] * state[TOOL_X]
    tool -= mechanics[propagation.TOOL_DAMPING] * state[TOOL_V]
    workpiece = -mechanics[propagation.WORKPIECE_STIFFNESS] * state[WORKPIECE_X]
    workpiece -= mechanics[propagation.WORKPIECE_DAMPING] * state[WORKPIECE_V]
    if regime & IN_CUT != 0:
        tool -= mechanics[propagation.TOOL_CUTTING] * chip
        workpiece += mechanics[propagation.WORKPIECE_CUTTING] * chip
    if regime & ENGAGED != 0:
        workpiece -= mechanics[propagation.BEARING_STIFFNESS] * (
            state[WORKPIECE_X] - mechanics[propagation.CLEARANCE]
        )
    return tool, workpiece


@njit(cache=True)
def _whole_step(state: Array, surface_ends: Array, matrix: Array, force: float, end: Array) -> None:
    """The state (4,) after a whole step by the matrix (4, INPUTS) of its regime."""
    for k in range(4):
        row = matrix[k]
        end[k] = (
            (row[0] * state[0] + row[1] * state[1] + row[2] * state[2] + row[3] * state[3])
            + (
                row[4] * surface_ends[0] + row[5] * surface_ends[1] + row[6] * surface_ends[2]
                + row[7] * surface_ends[3] + row[8] * surface_ends[4] + row[9] * surface_ends[5]
            )
            + (row[10] * force + row[11])
        )  # fmt: skip


@njit(cache=True)
def _turns_back(margin: float, slope: float, slope_end: float, duration: float) -> bool:
    """Whether a margin, positive at both ends of a piece, may dip below zero inside it."""
    return slope < 0.0 < slope_end and margin + slope * duration < 0.0


@njit(cache=True, nogil=True)
def advance(  # noqa: C901, PLR0912, PLR0913, PLR0915, PLR0917 -- one loop, kept in one place
    numbers: Array,
    counts: Array,
    nodes: Array,
    settings: Array,
    mechanics: Array,
    matrices: Array,
    seed: int,
    out: Array,
    events: Array,
) -> tuple[int, int, int, Array, Array]:
    """Cut on for `out.shape[0]` samples.

    Args:
        numbers: The remembered numbers (NUMBERS_SIZE,), changed in place.
        counts: The remembered integers (COUNTS_SIZE,), changed in place.
        nodes: The surface (capacity, NODE_SIZE), changed in place.
        settings: The cut (SETTINGS_SIZE,).
        mechanics: The constants of machine and cut (MECHANICS_SIZE,).
        matrices: The response to a whole step, from `propagation.step_matrices`.
        seed: Of the noise.
        out: Written: the samples (n, 8).
        events: Written: samples before the event, s since that sample, kind (m, 3).

    Returns:
        Samples written, events written, RUNNING or GUARD, and the surface and the events (which
        are new arrays if they had to grow).
    """
    steps = int(settings[STEPS_PER_SAMPLE])
    step = 1.0 / (settings[SAMPLE_RATE] * steps)
    merge = surface.MERGE * step
    target_speed, variation = settings[TARGET_SPEED], settings[VARIATION]
    frequency, feed_speed = settings[VARIATION_FREQUENCY], settings[FEED_SPEED]
    has_clearance, may_leave = settings[HAS_CLEARANCE] != 0.0, settings[MAY_LEAVE_CUT] != 0.0
    clearance = mechanics[propagation.CLEARANCE]

    state, end, ends = numbers[:4], np.empty(4), np.empty(6)
    tool, workpiece, hold = np.empty(TERMS), np.empty(TERMS), np.empty(6)
    margin = np.empty(TERMS)
    speed, angle, angle_low = numbers[SPEED], numbers[ANGLE], numbers[ANGLE_LOW]
    fed, fed_low, phase = numbers[ADVANCE], numbers[ADVANCE_LOW], numbers[PHASE]
    met, met_slope, met_curvature = numbers[MET], numbers[MET_SLOPE], numbers[MET_CURVATURE]
    regime, pointer, head = counts[REGIME], counts[POINTER], counts[HEAD]
    break_order, taken = counts[BREAK], counts[SAMPLES]

    found, status, row = 0, RUNNING, 0
    while row < out.shape[0]:
        force = 0.0
        if settings[FORCE_NOISE] > 0.0:
            # Held for a sample: the mean of white noise of this density over that time.
            force = settings[FORCE_NOISE] * math.sqrt(settings[SAMPLE_RATE])
            force *= noise.standard_normal(seed, noise.FORCE_STREAM, taken)
            break_order = 2 if break_order == 0 else min(break_order, 2)
        for index in range(steps):
            left, flips = step, 0
            while left > 0.0:
                # How the spindle turns from here on.
                slope = 0.0
                if speed != target_speed:
                    slope = math.copysign(settings[ACCELERATION], target_speed - speed)
                steady = slope == 0.0 and variation == 0.0
                omega, bend = speed, 0.0
                if not steady:
                    omega, bend = speed_and_slope(speed, slope, variation, phase, frequency)
                if break_order > 0:
                    # A corner: what follows it differs from what led to it.
                    if regime & IN_CUT != 0:
                        on_tool, on_workpiece = _accelerations(
                            state, regime, mechanics, force, met - fed
                        )
                        after = (feed_speed + state[TOOL_V] - state[WORKPIECE_V]) / omega
                        nodes[head, surface.SLOPE_AFTER] = after
                        nodes[head, surface.CURVATURE_AFTER] = (
                            on_tool - on_workpiece - after * bend
                        ) / (omega * omega)
                    else:
                        nodes[head, surface.SLOPE_AFTER] = met_slope
                        nodes[head, surface.CURVATURE_AFTER] = met_curvature
                    nodes[head, surface.ORDER] = min(nodes[head, surface.ORDER], break_order)
                    break_order = 0

                limit, event, place = left, _NO_EVENT, NEVER
                while True:
                    # The end of the piece: the step's, unless something lies before it.
                    duration, ramp_ends = limit, False
                    if slope != 0.0:
                        to_target = (target_speed - speed) / slope
                        ramp_ends = to_target <= limit + merge
                        if to_target < limit - merge:
                            duration = to_target
                    rise = omega * duration
                    if not steady:
                        rise = turned(duration, speed, slope, variation, phase, frequency)
                    if rise > 1.5 * nodes[pointer, surface.PITCH]:
                        # The spindle is faster now: keep to the detail of the surface met.
                        shrink = 1.25 * nodes[pointer, surface.PITCH] / rise
                        duration, rise, ramp_ends = shrink * duration, shrink * rise, False
                        if not steady:
                            rise = turned(duration, speed, slope, variation, phase, frequency)
                    new_angle, new_angle_low = _fast_two_sum(angle, angle_low, rise)
                    place_met = new_angle - 1.0
                    near = merge * speed
                    node, corner = pointer, False
                    while nodes[node + 1, surface.ANGLE] < place_met - near:
                        node += 1
                        if nodes[node, surface.ORDER] <= surface.LAST_ORDER:
                            corner = True
                            break
                    if corner:
                        rise = nodes[node, surface.ANGLE] + 1.0 - angle - angle_low
                        duration, ramp_ends = rise / omega, False
                        if not steady:
                            duration = time_to_turn(
                                rise, speed, slope, variation, phase, frequency
                            )
                        new_angle, new_angle_low = _fast_two_sum(angle, angle_low, rise)
                    elif nodes[node + 1, surface.ANGLE] <= place_met + near:
                        node += 1
                        corner = True
                    # The surface that the tool meets there.
                    if corner:
                        next_met = nodes[node, surface.HEIGHT]
                        next_slope = nodes[node, surface.SLOPE_BEFORE]
                        next_curvature = nodes[node, surface.CURVATURE_BEFORE]
                    else:
                        next_met, next_slope, next_curvature = surface.surface_at(
                            nodes, node, place_met
                        )
                    new_omega, new_bend = omega, 0.0
                    if not steady:
                        new_omega, new_bend = speed_and_slope(
                            speed + slope * duration, slope, variation,
                            phase + frequency * duration, frequency,
                        )  # fmt: skip
                    new_fed, new_fed_low = _fast_two_sum(fed, fed_low, feed_speed * duration)
                    ends[0] = met - fed
                    ends[1] = met_slope * omega - feed_speed
                    ends[2] = met_curvature * omega * omega + met_slope * bend
                    ends[3] = next_met - new_fed
                    ends[4] = next_slope * new_omega - feed_speed
                    ends[5] = next_curvature * new_omega * new_omega + next_slope * new_bend
                    # The state there.
                    series_known = duration != step
                    if series_known:
                        propagation.quintic(
                            ends[0], ends[1] * duration, ends[2] * duration * duration,
                            ends[3], ends[4] * duration, ends[5] * duration * duration, hold,
                        )  # fmt: skip
                        propagation.solve_piece(
                            state, duration, regime, mechanics, force, hold, tool, workpiece
                        )
                        propagation.end_state(tool, workpiece, duration, end)
                    else:
                        _whole_step(state, ends, matrices[regime], force, end)
                    if event != _NO_EVENT:
                        break
                    # Does contact or cutting change on the way?
                    watch_bearing = watch_chip = False
                    if has_clearance:
                        side = 1.0 if regime & ENGAGED != 0 else -1.0
                        watch_bearing = side * (end[WORKPIECE_X] - clearance) < 0.0
                        watch_bearing = watch_bearing or _turns_back(
                            side * (state[WORKPIECE_X] - clearance),
                            side * state[WORKPIECE_V], side * end[WORKPIECE_V], duration,
                        )  # fmt: skip
                    if may_leave:
                        hand = 1.0 if regime & IN_CUT != 0 else -1.0
                        watch_chip = hand * (end[TOOL_X] - end[WORKPIECE_X] - ends[3]) < 0.0
                        watch_chip = watch_chip or _turns_back(
                            hand * (state[TOOL_X] - state[WORKPIECE_X] - ends[0]),
                            hand * (state[TOOL_V] - state[WORKPIECE_V] - ends[1]),
                            hand * (end[TOOL_V] - end[WORKPIECE_V] - ends[4]), duration,
                        )  # fmt: skip
                    if flips > _FLIPS or not (watch_bearing or watch_chip):
                        break
                    if not series_known:
                        propagation.quintic(
                            ends[0], ends[1] * duration, ends[2] * duration * duration,
                            ends[3], ends[4] * duration, ends[5] * duration * duration, hold,
                        )  # fmt: skip
                        propagation.solve_piece(
                            state, duration, regime, mechanics, force, hold, tool, workpiece
                        )
                    place = NEVER
                    if watch_bearing:
                        margin[:] = workpiece
                        margin[0] -= clearance
                        place = first_crossing(margin, TERMS, side)
                        event = BEARING_RELEASES if side > 0.0 else BEARING_ENGAGES
                    if watch_chip:
                        margin[:] = tool - workpiece
                        margin[:6] -= hold
                        chip_place = first_crossing(margin, TERMS, hand)
                        if chip_place < place:
                            place = chip_place
                            event = TOOL_LEAVES if hand > 0.0 else TOOL_ENTERS
                    if place > 1.0:
                        event = _NO_EVENT
                        break
                    limit = place * duration
                    if limit <= merge:
                        break
                    if duration - limit <= merge:
                        place = 1.0
                        break

                if event != _NO_EVENT:
                    if found == events.shape[0]:
                        longer = np.empty((2 * found + 16, 3))
                        longer[:found] = events
                        events = longer
                    at_start = place <= 1.0 and limit <= merge
                    events[found, 0] = taken
                    events[found, 1] = (index + 1) * step - left + (0.0 if at_start else duration)
                    events[found, 2] = event
                    found += 1
                    if at_start:
                        regime ^= ENGAGED if event <= BEARING_RELEASES else IN_CUT
                        break_order = 3 if event <= BEARING_RELEASES else 1
                        flips += 1
                        continue

                # Take the piece.
                on_tool, on_workpiece = _accelerations(end, regime, mechanics, force, ends[3])
                head += 1
                if head == nodes.shape[0]:
                    nodes = surface.grown(nodes)
                if regime & IN_CUT != 0:
                    height = new_fed + end[TOOL_X] - end[WORKPIECE_X]
                    before = (feed_speed + end[TOOL_V] - end[WORKPIECE_V]) / new_omega
                    curvature = (on_tool - on_workpiece - before * new_bend) / (
                        new_omega * new_omega
                    )
                else:
                    height, before, curvature = next_met, next_slope, next_curvature
                nodes[head, surface.ANGLE] = new_angle
                nodes[head, surface.HEIGHT] = height
                nodes[head, surface.SLOPE_BEFORE] = before
                nodes[head, surface.CURVATURE_BEFORE] = curvature
                nodes[head, surface.SLOPE_AFTER] = before
                nodes[head, surface.CURVATURE_AFTER] = curvature
                nodes[head, surface.ORDER] = surface.SMOOTH
                nodes[head, surface.PITCH] = min(
                    new_omega * step, nodes[pointer, surface.PITCH]
                ) if regime & IN_CUT == 0 else new_omega * step  # fmt: skip
                met, met_slope, met_curvature = next_met, next_slope, next_curvature
                if corner:
                    order = nodes[node, surface.ORDER]
                    if order <= surface.LAST_ORDER:
                        met_slope = nodes[node, surface.SLOPE_AFTER]
                        met_curvature = nodes[node, surface.CURVATURE_AFTER]
                        order += 2.0 if regime & IN_CUT != 0 else 0.0
                        if order <= surface.LAST_ORDER:
                            break_order = int(order)
                if ramp_ends:
                    break_order = 2 if break_order == 0 else min(break_order, 2)
                if event != _NO_EVENT:
                    kind = 3 if event <= BEARING_RELEASES else 1
                    break_order = kind if break_order == 0 else min(break_order, kind)
                    regime ^= ENGAGED if event <= BEARING_RELEASES else IN_CUT
                state[:] = end
                angle, angle_low, fed, fed_low = new_angle, new_angle_low, new_fed, new_fed_low
                speed = target_speed if ramp_ends else speed + slope * duration
                if variation > 0.0:
                    phase = (phase + frequency * duration) % 1.0
                pointer = node
                if angle >= 1.0:
                    surface.next_turn(nodes, pointer, head, fed)
                    head -= pointer
                    pointer = 0
                    angle -= 1.0
                    met -= fed
                    fed = 0.0
                    counts[TURNS] += 1
                left -= duration
                if left <= 0.5 * merge:
                    left = 0.0
                counts[STEPS] += 1
        if not (abs(state[TOOL_X]) <= settings[LIMIT] and abs(state[WORKPIECE_X]) <= settings[LIMIT]):
            status = GUARD
            break
        taken += 1
        chip = state[TOOL_X] - state[WORKPIECE_X] + fed - met
        out[row, 0] = taken / settings[SAMPLE_RATE]
        out[row, 1] = counts[TURNS] + angle
        out[row, 2] = state[TOOL_X]
        out[row, 3] = state[TOOL_V]
        out[row, 4] = state[WORKPIECE_X]
        out[row, 5] = state[WORKPIECE_V]
        out[row, 7] = settings[CUTTING_STIFFNESS] * chip if regime & IN_CUT != 0 else 0.0
        if may_leave:
            out[row, 6] = max(chip, 0.0)
        else:
            out[row, 6] = chip + settings[NOMINAL_FEED_SPEED] / speed
        if settings[RUNOUT] > 0.0:
            out[row, 4] += settings[RUNOUT] * math.cos(2.0 * math.pi * angle)
            out[row, 5] -= (
                settings[RUNOUT] * 2.0 * math.pi * speed * math.sin(2.0 * math.pi * angle)
            )
        if settings[SENSOR_NOISE] > 0.0:
            out[row, 2] += settings[SENSOR_NOISE] * noise.standard_normal(
                seed, noise.TOOL_SENSOR_STREAM, taken
            )
            out[row, 4] += settings[SENSOR_NOISE] * noise.standard_normal(
                seed, noise.WORKPIECE_SENSOR_STREAM, taken
            )
        row += 1

    numbers[SPEED], numbers[ANGLE], numbers[ANGLE_LOW] = speed, angle, angle_low
    numbers[ADVANCE], numbers[ADVANCE_LOW], numbers[PHASE] = fed, fed_low, phase
    numbers[MET], numbers[MET_SLOPE], numbers[MET_CURVATURE] = met, met_slope, met_curvature
    counts[REGIME], counts[POINTER], counts[HEAD] = regime, pointer, head
    counts[BREAK], counts[SAMPLES] = break_order, taken
    return row, found, status, nodes, events
