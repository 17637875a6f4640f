"""The compiled inner loop: exact propagation between located events.

Time advances in whole steps of the sample grid. A step is one piece unless something happens
inside it: the tool meets a corner in the surface of the turn before, the bearing engages or
releases, the tool leaves or enters the cut, or a speed ramp ends. Then the step is cut there,
and each piece is solved exactly (propagation.py).

The loop has no memory of its own: everything that a lathe remembers is in the arrays of
layout.py, so any partition of a run into calls gives the same bits.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from lathe_chatter import layout, noise, propagation, surface
from lathe_chatter.events import NEVER, first_crossing, may_turn_back
from lathe_chatter.model import Array, Integers
from lathe_chatter.propagation import ENGAGED, IN_CUT, TERMS
from lathe_chatter.spindle import speed_and_slope, time_to_turn, turned

_FLIPS = 32
"""Events in one step before it is finished without looking for more: a grazing contact that
rounding cannot decide is no reason to stand still."""
_DETAIL = 1.5
"""A piece may meet this many steps' worth of surface, as finely as that was cut."""


@njit(cache=True, error_model='numpy', inline='always')
def _add(high: float, low: float, increment: float) -> tuple[float, float]:
    """Compensated addition: a turn of 10^5 steps sums as exactly as one step."""
    increment += low
    total = high + increment
    return total, increment - (total - high)


@njit(cache=True, error_model='numpy', inline='always')
def _lower(order: int, other: int) -> int:
    """The lower of two orders of a corner, where 0 stands for none."""
    return other if order == 0 else min(order, other)


@njit(cache=True, error_model='numpy', inline='always')
def _accelerations(
    state: Array, regime: int, mechanics: Array, force: float, met: float
) -> tuple[float, float]:
    """Second derivatives of both displacements, m/s2; `met` is the surface at the tool, m."""
    chip = state[layout.TOOL_X] - state[layout.WORKPIECE_X] - met
    tool = force * mechanics[propagation.TOOL_COMPLIANCE]
    tool -= mechanics[propagation.TOOL_STIFFNESS] * state[layout.TOOL_X]
    tool -= mechanics[propagation.TOOL_DAMPING] * state[layout.TOOL_V]
    workpiece = -mechanics[propagation.WORKPIECE_STIFFNESS] * state[layout.WORKPIECE_X]
    workpiece -= mechanics[propagation.WORKPIECE_DAMPING] * state[layout.WORKPIECE_V]
    if regime & IN_CUT != 0:
        tool -= mechanics[propagation.TOOL_CUTTING] * chip
        workpiece += mechanics[propagation.WORKPIECE_CUTTING] * chip
    if regime & ENGAGED != 0:
        workpiece -= mechanics[propagation.BEARING_STIFFNESS] * (
            state[layout.WORKPIECE_X] - mechanics[propagation.CLEARANCE]
        )
    return tool, workpiece


@njit(cache=True, error_model='numpy')
def _solve_series(  # noqa: PLR0913, PLR0917 -- plain arrays
    state: Array, duration: float, regime: int, mechanics: Array, force: float,
    ends: Array, hold: Array, tool: Array, workpiece: Array,
) -> None:  # fmt: skip
    """The power series of a piece whose surface has these values and derivatives at its ends."""
    square = duration * duration
    propagation.quintic(
        ends[0], ends[1] * duration, ends[2] * square,
        ends[3], ends[4] * duration, ends[5] * square, hold,
    )  # fmt: skip
    propagation.solve_piece(state, duration, regime, mechanics, force, hold, tool, workpiece)


@njit(cache=True, error_model='numpy')
def _find_event(  # noqa: PLR0913, PLR0917 -- plain arrays and flags
    tool: Array, workpiece: Array, hold: Array, margin: Array, regime: int, clearance: float,
    watch_bearing: bool, watch_chip: bool,  # noqa: FBT001 -- the same
) -> tuple[float, int]:  # fmt: skip
    """The first event of a solved piece and its place in [0, 1], or `NEVER`."""
    place, event = NEVER, layout.NO_EVENT
    if watch_bearing:
        engaged = regime & ENGAGED != 0
        margin[:] = workpiece
        margin[0] -= clearance
        place = first_crossing(margin, TERMS, 1.0 if engaged else -1.0)
        event = layout.BEARING_RELEASES if engaged else layout.BEARING_ENGAGES
    if watch_chip:
        cutting = regime & IN_CUT != 0
        for k in range(TERMS):
            margin[k] = tool[k] - workpiece[k]
        for k in range(6):
            margin[k] -= hold[k]
        chip_place = first_crossing(margin, TERMS, 1.0 if cutting else -1.0)
        if chip_place < place:
            place = chip_place
            event = layout.TOOL_LEAVES if cutting else layout.TOOL_ENTERS
    return (place, event) if place <= 1.0 else (NEVER, layout.NO_EVENT)


@njit(cache=True, error_model='numpy')
def _measure(  # noqa: PLR0913, PLR0917 -- plain numbers
    sample: Array, settings: Array, angle: float, speed: float, seed: int, taken: int
) -> None:
    """Add to a sample what sensors see beside the motion: runout and their own noise."""
    turn = 2.0 * math.pi * angle
    sample[4] += settings[layout.RUNOUT] * math.cos(turn)
    sample[5] -= settings[layout.RUNOUT] * 2.0 * math.pi * speed * math.sin(turn)
    if settings[layout.SENSOR_NOISE] > 0.0:
        sample[2] += settings[layout.SENSOR_NOISE] * noise.standard_normal(
            seed, noise.TOOL_SENSOR_STREAM, taken
        )
        sample[4] += settings[layout.SENSOR_NOISE] * noise.standard_normal(
            seed, noise.WORKPIECE_SENSOR_STREAM, taken
        )


@njit(cache=True, error_model='numpy', nogil=True)
def advance(  # noqa: C901, PLR0912, PLR0913, PLR0915, PLR0917 -- the hot loop in one place
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
    rate, steps = settings[layout.SAMPLE_RATE], counts[layout.STEPS]
    step = 1.0 / (rate * steps)
    merge = surface.MERGE * step
    target_speed, variation = settings[layout.TARGET_SPEED], settings[layout.VARIATION]
    frequency, feed_speed = settings[layout.VARIATION_FREQUENCY], settings[layout.FEED_SPEED]
    has_clearance = settings[layout.HAS_CLEARANCE] != 0.0
    may_leave = settings[layout.MAY_LEAVE_CUT] != 0.0
    cutting_stiffness, clearance = (
        settings[layout.CUTTING_STIFFNESS],
        mechanics[propagation.CLEARANCE],
    )
    limit_x = settings[layout.LIMIT]

    state, end, ends = numbers[:4], np.empty(4), np.empty(6)
    tool, workpiece, hold = np.empty(TERMS), np.empty(TERMS), np.empty(6)
    margin = np.empty(TERMS)
    speed, phase = numbers[layout.SPEED], numbers[layout.PHASE]
    angle, angle_low = numbers[layout.ANGLE], numbers[layout.ANGLE_LOW]
    fed, fed_low = numbers[layout.FED], numbers[layout.FED_LOW]
    met, met_slope = numbers[layout.MET], numbers[layout.MET_SLOPE]
    met_curvature = numbers[layout.MET_CURVATURE]
    regime, pointer, head = counts[layout.REGIME], counts[layout.POINTER], counts[layout.HEAD]
    corner_order, taken = counts[layout.CORNER], counts[layout.SAMPLES]
    turns, pieces = counts[layout.TURNS], counts[layout.PIECES]

    found, status, row = 0, layout.FINISHED, 0
    while row < out.shape[0]:
        # A sample takes at most the corners of a turn and the events of its steps.
        if nodes.shape[0] - head < (_FLIPS + 1) * steps + (head - pointer) + 2:
            status = layout.SURFACE_FULL
            break
        if events.shape[0] - found < _FLIPS * steps:
            status = layout.EVENTS_FULL
            break
        force = 0.0
        if settings[layout.FORCE_NOISE] > 0.0:
            # Held for a sample: the mean of white noise of this density over that time.
            force = settings[layout.FORCE_NOISE] * math.sqrt(rate)
            force *= noise.standard_normal(seed, noise.FORCE_STREAM, taken)
            corner_order = _lower(corner_order, 2)
        for index in range(steps):
            left, flips = step, 0
            while left > 0.0:
                # How the spindle turns from here on.
                slope = 0.0
                if speed != target_speed:
                    slope = math.copysign(settings[layout.ACCELERATION], target_speed - speed)
                steady = slope == 0.0 and variation == 0.0
                omega, bend = speed, 0.0
                if not steady:
                    omega, bend = speed_and_slope(speed, slope, variation, phase, frequency)
                if corner_order > 0:
                    # What follows a corner differs from what led to it.
                    after, curvature = met_slope, met_curvature
                    if regime & IN_CUT != 0:
                        on_tool, on_workpiece = _accelerations(
                            state, regime, mechanics, force, met - fed
                        )
                        after = feed_speed + state[layout.TOOL_V] - state[layout.WORKPIECE_V]
                        after /= omega
                        curvature = (on_tool - on_workpiece - after * bend) / (omega * omega)
                    nodes[head, surface.SLOPE_AFTER] = after
                    nodes[head, surface.CURVATURE_AFTER] = curvature
                    nodes[head, surface.ORDER] = min(nodes[head, surface.ORDER], corner_order)
                    corner_order = 0

                limit, event, place = left, layout.NO_EVENT, NEVER
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
                    if rise > _DETAIL * nodes[pointer, surface.PITCH]:
                        duration *= _DETAIL / 1.2 * nodes[pointer, surface.PITCH] / rise
                        ramp_ends = False
                        rise = omega * duration
                        if not steady:
                            rise = turned(duration, speed, slope, variation, phase, frequency)
                    new_angle, new_angle_low = _add(angle, angle_low, rise)
                    near = merge * speed
                    node, at_corner = pointer, False
                    while nodes[node + 1, surface.ANGLE] < new_angle - 1.0 - near:
                        node += 1
                        if nodes[node, surface.ORDER] <= surface.LAST_ORDER:
                            at_corner = True
                            break
                    if at_corner:
                        rise = nodes[node, surface.ANGLE] + 1.0 - angle - angle_low
                        duration, ramp_ends = rise / omega, False
                        if not steady:
                            duration = time_to_turn(
                                rise, speed, slope, variation, phase, frequency
                            )
                        new_angle, new_angle_low = _add(angle, angle_low, rise)
                    elif nodes[node + 1, surface.ANGLE] <= new_angle - 1.0 + near:
                        node, at_corner = node + 1, True

                    # The surface that the tool meets there, and the state.
                    if at_corner:
                        next_met = nodes[node, surface.HEIGHT]
                        next_slope = nodes[node, surface.SLOPE_BEFORE]
                        next_curvature = nodes[node, surface.CURVATURE_BEFORE]
                    else:
                        next_met, next_slope, next_curvature = surface.surface_at(
                            nodes, node, new_angle - 1.0
                        )
                    new_omega, new_bend = omega, 0.0
                    if not steady:
                        new_omega, new_bend = speed_and_slope(
                            speed + slope * duration, slope, variation,
                            phase + frequency * duration, frequency,
                        )  # fmt: skip
                    new_fed, new_fed_low = _add(fed, fed_low, feed_speed * duration)
                    ends[0] = met - fed
                    ends[1] = met_slope * omega - feed_speed
                    ends[2] = met_curvature * omega * omega + met_slope * bend
                    ends[3] = next_met - new_fed
                    ends[4] = next_slope * new_omega - feed_speed
                    ends[5] = next_curvature * new_omega * new_omega + next_slope * new_bend
                    whole = duration == step
                    if whole:
                        propagation.whole_step(state, ends, matrices, regime, force, end)
                    else:
                        _solve_series(
                            state, duration, regime, mechanics, force, ends, hold, tool, workpiece
                        )
                        propagation.end_state(tool, workpiece, duration, end)
                    if event != layout.NO_EVENT or flips >= _FLIPS:
                        break

                    # Does contact or cutting change on the way?
                    watch_bearing = watch_chip = False
                    if has_clearance:
                        side = 1.0 if regime & ENGAGED != 0 else -1.0
                        watch_bearing = may_turn_back(
                            side * (state[layout.WORKPIECE_X] - clearance),
                            side * state[layout.WORKPIECE_V],
                            side * (end[layout.WORKPIECE_X] - clearance),
                            side * end[layout.WORKPIECE_V],
                            duration,
                        )
                    if may_leave:
                        side = 1.0 if regime & IN_CUT != 0 else -1.0
                        watch_chip = may_turn_back(
                            side * (state[layout.TOOL_X] - state[layout.WORKPIECE_X] - ends[0]),
                            side * (state[layout.TOOL_V] - state[layout.WORKPIECE_V] - ends[1]),
                            side * (end[layout.TOOL_X] - end[layout.WORKPIECE_X] - ends[3]),
                            side * (end[layout.TOOL_V] - end[layout.WORKPIECE_V] - ends[4]),
                            duration,
                        )
                    if not (watch_bearing or watch_chip):
                        break
                    if whole:
                        _solve_series(
                            state, duration, regime, mechanics, force, ends, hold, tool, workpiece
                        )
                    place, event = _find_event(
                        tool, workpiece, hold, margin, regime, clearance,
                        watch_bearing, watch_chip,
                    )  # fmt: skip
                    if event == layout.NO_EVENT:
                        break
                    limit = place * duration
                    if limit <= merge or duration - limit <= merge:
                        break  # at one end of the piece, which stands as it is

                event_order = 0
                if event != layout.NO_EVENT:
                    now = place * duration <= merge and limit <= merge
                    events[found, 0] = taken
                    events[found, 1] = (index + 1) * step - left + (0.0 if now else duration)
                    events[found, 2] = event
                    found += 1
                    flips += 1
                    event_order = 3 if event <= layout.BEARING_RELEASES else 1
                    if now:
                        regime ^= ENGAGED if event <= layout.BEARING_RELEASES else IN_CUT
                        corner_order = event_order
                        continue

                # Take the piece: leave the surface, go on to its end.
                in_cut = regime & IN_CUT != 0
                height, before, curvature = next_met, next_slope, next_curvature
                pitch = new_omega * step
                if in_cut:
                    on_tool, on_workpiece = _accelerations(end, regime, mechanics, force, ends[3])
                    height = new_fed + end[layout.TOOL_X] - end[layout.WORKPIECE_X]
                    before = feed_speed + end[layout.TOOL_V] - end[layout.WORKPIECE_V]
                    before /= new_omega
                    curvature = on_tool - on_workpiece - before * new_bend
                    curvature /= new_omega * new_omega
                else:
                    pitch = min(pitch, nodes[pointer, surface.PITCH])
                head += 1
                surface.node_at(nodes, head, new_angle, height, before, curvature)
                nodes[head, surface.PITCH] = pitch
                met, met_slope, met_curvature = next_met, next_slope, next_curvature
                if at_corner and nodes[node, surface.ORDER] <= surface.LAST_ORDER:
                    met_slope = nodes[node, surface.SLOPE_AFTER]
                    met_curvature = nodes[node, surface.CURVATURE_AFTER]
                    # A corner comes back two orders smoother, through a force; or as it was.
                    order = int(nodes[node, surface.ORDER]) + (2 if in_cut else 0)
                    corner_order = order if order <= surface.LAST_ORDER else 0
                if ramp_ends:
                    corner_order = _lower(corner_order, 2)
                if event_order > 0:
                    corner_order = _lower(corner_order, event_order)
                    regime ^= ENGAGED if event_order == 3 else IN_CUT
                for k in range(4):
                    state[k] = end[k]
                angle, angle_low, fed, fed_low = new_angle, new_angle_low, new_fed, new_fed_low
                speed = target_speed if ramp_ends else speed + slope * duration
                if variation > 0.0:
                    phase += frequency * duration
                    phase -= math.floor(phase)
                pointer = node
                if angle >= 1.0:
                    surface.next_turn(nodes, pointer, head, fed)
                    head, pointer = head - pointer, 0
                    angle, met, fed = angle - 1.0, met - fed, 0.0
                    turns += 1
                pieces += 1
                left -= duration
                if left <= 0.5 * merge:
                    left = 0.0

        if not (abs(state[0]) <= limit_x and abs(state[2]) <= limit_x):
            status = layout.GUARD
            break
        taken += 1
        chip = state[layout.TOOL_X] - state[layout.WORKPIECE_X] + fed - met
        out[row, 0] = taken / rate
        out[row, 1] = turns + angle
        for k in range(4):
            out[row, 2 + k] = state[k]
        out[row, 6] = chip + settings[layout.NOMINAL_FEED_SPEED] / speed
        out[row, 7] = cutting_stiffness * chip if regime & IN_CUT != 0 else 0.0
        if may_leave:
            out[row, 6] = max(chip, 0.0)
        if settings[layout.RUNOUT] > 0.0 or settings[layout.SENSOR_NOISE] > 0.0:
            _measure(out[row], settings, angle, speed, seed, taken)
        row += 1

    numbers[layout.SPEED], numbers[layout.PHASE] = speed, phase
    numbers[layout.ANGLE], numbers[layout.ANGLE_LOW] = angle, angle_low
    numbers[layout.FED], numbers[layout.FED_LOW] = fed, fed_low
    numbers[layout.MET], numbers[layout.MET_SLOPE] = met, met_slope
    numbers[layout.MET_CURVATURE] = met_curvature
    counts[layout.REGIME], counts[layout.POINTER], counts[layout.HEAD] = regime, pointer, head
    counts[layout.CORNER], counts[layout.SAMPLES] = corner_order, taken
    counts[layout.TURNS], counts[layout.PIECES] = turns, pieces
    return row, found, status
