"""A group of lathes abreast, and how one of them gets into its lane and out of it."""

from __future__ import annotations

import math
from typing import NamedTuple

from lathe_chatter.arrays import Array, Integers
from lathe_chatter.compiled import compiled
from lathe_chatter.lathe.integrator import lanes, surface
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.lathe.integrator.lanes import LANES
from lathe_chatter.lathe.integrator.propagation import CLEARANCE, ENGAGED, IN_CUT
from lathe_chatter.lathe.integrator.stepper import is_measured

ABREAST, ALONE, ENDED = 0, 1, 2
"""How a lane goes on; an empty one has ended."""

# Counters of a group.
(
    SLOT,  # of the ring, that the next step meets
    SAMPLES,  # taken by lanes that are abreast
    STEPS,  # taken likewise, in all
    UNTIL,  # the row to which the present block goes
    ODD,  # 1 where the present state is in `other`
) = range(5)
COUNTERS = 5


class Group(NamedTuple):
    """The memory of LANES lathes, of those abreast and of those alone.

    Attributes:
        one: The state of the lanes (lanes.STATE_FIGURES * LANES,); this and
        other: (the same) change places with every step.
        figures: What a step does not change (lanes.FIGURES * LANES,).
        ring: The surface of the lanes (steps a turn, lanes.NODE_FIGURES * LANES).
        counters: (COUNTERS,).
        modes: ABREAST, ALONE or ENDED (LANES,).
        places: Of the lathes among all of the sweep (LANES,).
        rows: The next row of a lathe that is alone (LANES,).
        last: The last sample of a lathe that is not abreast (LANES, 8).
        numbers: (LANES, layout.NUMBERS_SIZE), like all that follows of each lathe as
            `stepper.advance` has it for one.
        counts: (LANES, layout.COUNTS_SIZE); the same number of steps a sample in all.
        nodes: (LANES, capacity, surface.NODE_SIZE), with room for two turns at least.
        settings: (LANES, layout.SETTINGS_SIZE).
        mechanics: (LANES, propagation.MECHANICS_SIZE).
        matrices: (LANES, propagation.REGIMES, ROWS, 4).
        seeds: (LANES,).
    """

    one: Array
    other: Array
    figures: Array
    ring: Array
    counters: Integers
    modes: Integers
    places: Integers
    rows: Integers
    last: Array
    numbers: Array
    counts: Integers
    nodes: Array
    settings: Array
    mechanics: Array
    matrices: Array
    seeds: Integers


@compiled(borrows=True)
def is_regular(
    numbers: Array, counts: Integers, nodes: Array, settings: Array, per_turn: int
) -> bool:
    """Whether a lathe can go abreast: steady, in the cut, and its last turn was all whole steps.

    Args:
        numbers: Like `counts`, `nodes` and `settings` as `stepper.advance` has them.
        counts: See there.
        nodes: See there.
        settings: See there.
        per_turn: Steps a turn of the group.
    """
    speed = numbers[layout.SPEED]
    unsteady = speed != settings[layout.TARGET_SPEED] or settings[layout.VARIATION] != 0.0
    noisy = settings[layout.FORCE_NOISE] != 0.0 or is_measured(settings)
    cornered = counts[layout.CORNER] != 0 or counts[layout.SURFACE_CORNER] != 0
    first, last = counts[layout.POINTER], counts[layout.HEAD]
    cutting = counts[layout.REGIME] & IN_CUT != 0
    if unsteady or noisy or cornered or not cutting or last - first != per_turn:
        return False
    rise = speed * (1.0 / (settings[layout.SAMPLE_RATE] * counts[layout.STEPS]))
    near = 0.5 * surface.MERGE * rise
    if abs(per_turn * rise - 1.0) > near:
        return False
    for node in range(first, last + 1):
        place = numbers[layout.ANGLE] + (node - last) * rise
        if (
            abs(nodes[node, surface.ANGLE] - place) > near
            or nodes[node, surface.PITCH] != rise
            or nodes[node, surface.ORDER] <= surface.LAST_ORDER
        ):
            return False
    return True


@compiled(borrows=True)
def load(g: Group, lane: int) -> None:
    """Put a regular lathe into its lane."""
    numbers, counts, nodes = g.numbers[lane], g.counts[lane], g.nodes[lane]
    settings, c = g.settings[lane], g.figures
    state = g.one if g.counters[ODD] == 0 else g.other
    speed, regime = numbers[layout.SPEED], counts[layout.REGIME]
    step = 1.0 / (settings[layout.SAMPLE_RATE] * counts[layout.STEPS])
    feed_speed, first = settings[layout.FEED_SPEED], counts[layout.POINTER]
    for k in range(4):
        state[(lanes.XT + k) * LANES + lane] = numbers[layout.TOOL_X + k]
    state[lanes.ANGLE * LANES + lane] = numbers[layout.ANGLE]
    state[lanes.ANGLE_LOW * LANES + lane] = numbers[layout.ANGLE_LOW]
    state[lanes.FED * LANES + lane] = numbers[layout.FED]
    state[lanes.FED_LOW * LANES + lane] = numbers[layout.FED_LOW]
    state[lanes.MET_ANGLE * LANES + lane] = nodes[first, surface.ANGLE]
    state[lanes.MET * LANES + lane] = numbers[layout.MET]
    state[lanes.MET_SLOPE * LANES + lane] = numbers[layout.MET_SLOPE]
    state[lanes.MET_CURVATURE * LANES + lane] = numbers[layout.MET_CURVATURE]
    state[lanes.U * LANES + lane] = numbers[layout.MET] - numbers[layout.FED]
    state[lanes.DU * LANES + lane] = numbers[layout.MET_SLOPE] * speed - feed_speed
    state[lanes.DDU * LANES + lane] = numbers[layout.MET_CURVATURE] * (speed * speed)
    c[lanes.TURNS * LANES + lane] = counts[layout.TURNS]
    c[lanes.RATE * LANES + lane] = settings[layout.SAMPLE_RATE]
    c[lanes.STEP * LANES + lane] = step
    c[lanes.RISE * LANES + lane] = speed * step
    c[lanes.SPEED * LANES + lane] = speed
    c[lanes.PER_SPEED * LANES + lane] = 1.0 / speed
    c[lanes.SQUARE * LANES + lane] = speed * speed
    c[lanes.PER_SQUARE * LANES + lane] = 1.0 / (speed * speed)
    c[lanes.FEED * LANES + lane] = feed_speed * step
    c[lanes.FEED_SPEED * LANES + lane] = feed_speed
    total = settings[layout.MAY_LEAVE_CUT] != 0.0
    nominal = settings[layout.NOMINAL_FEED_SPEED] / speed
    c[lanes.NOMINAL * LANES + lane] = 0.0 if total else nominal
    c[lanes.LEAST * LANES + lane] = 0.0 if total else -math.inf
    c[lanes.LIMIT * LANES + lane] = settings[layout.LIMIT]
    c[lanes.STIFFNESS * LANES + lane] = settings[layout.CUTTING_STIFFNESS]
    c[lanes.MAY_LEAVE * LANES + lane] = settings[layout.MAY_LEAVE_CUT]
    c[lanes.HAS_CLEARANCE * LANES + lane] = settings[layout.HAS_CLEARANCE]
    c[lanes.GAMMA * LANES + lane] = g.mechanics[lane, CLEARANCE]
    c[lanes.BEARING_SIDE * LANES + lane] = 1.0 if regime & ENGAGED != 0 else -1.0
    for column in range(lanes.COLUMNS):
        c[(lanes.SAMPLE + column) * LANES + lane] = g.last[lane, column]
    matrix = g.matrices[lane, regime]
    for component in range(4):
        for row in range(11):
            c[(lanes.MATRIX + 11 * component + row) * LANES + lane] = matrix[row, component]
    for k in range(7):
        c[(lanes.BEND + k) * LANES + lane] = matrix[12, k] if k < 4 else matrix[13, k - 4]
    per_turn, slot = g.ring.shape[0], g.counters[SLOT]
    for k in range(per_turn):
        node, place = first + 1 + k, slot + k if slot + k < per_turn else slot + k - per_turn
        g.ring[place, lanes.NODE_ANGLE * LANES + lane] = nodes[node, surface.ANGLE]
        g.ring[place, lanes.NODE_HEIGHT * LANES + lane] = nodes[node, surface.HEIGHT]
        g.ring[place, lanes.NODE_SLOPE * LANES + lane] = nodes[node, surface.SLOPE_BEFORE]
        g.ring[place, lanes.NODE_CURVATURE * LANES + lane] = nodes[node, surface.CURVATURE_BEFORE]
    counts[layout.PIECES] -= g.counters[STEPS]
    g.counters[SAMPLES] = counts[layout.SAMPLES]
    g.modes[lane] = ABREAST


@compiled(borrows=True)
def store(g: Group, lane: int, index: int) -> None:
    """Put a lane back into its lathe's memory, alone from step `index` of its sample on."""
    numbers, counts, nodes = g.numbers[lane], g.counts[lane], g.nodes[lane]
    state, c = g.one if g.counters[ODD] == 0 else g.other, g.figures
    for k in range(4):
        numbers[layout.TOOL_X + k] = state[(lanes.XT + k) * LANES + lane]
    numbers[layout.ANGLE] = state[lanes.ANGLE * LANES + lane]
    numbers[layout.ANGLE_LOW] = state[lanes.ANGLE_LOW * LANES + lane]
    numbers[layout.FED] = state[lanes.FED * LANES + lane]
    numbers[layout.FED_LOW] = state[lanes.FED_LOW * LANES + lane]
    numbers[layout.MET] = state[lanes.MET * LANES + lane]
    numbers[layout.MET_SLOPE] = state[lanes.MET_SLOPE * LANES + lane]
    numbers[layout.MET_CURVATURE] = state[lanes.MET_CURVATURE * LANES + lane]
    for column in range(lanes.COLUMNS):
        g.last[lane, column] = c[(lanes.SAMPLE + column) * LANES + lane]
    pitch, per_turn, slot = c[lanes.RISE * LANES + lane], g.ring.shape[0], g.counters[SLOT]
    surface.write_node(
        nodes, 0, state[lanes.MET_ANGLE * LANES + lane], numbers[layout.MET],
        numbers[layout.MET_SLOPE], numbers[layout.MET_CURVATURE], pitch,
    )  # fmt: skip
    for k in range(per_turn):
        place = slot + k if slot + k < per_turn else slot + k - per_turn
        surface.write_node(
            nodes, 1 + k, g.ring[place, lanes.NODE_ANGLE * LANES + lane],
            g.ring[place, lanes.NODE_HEIGHT * LANES + lane],
            g.ring[place, lanes.NODE_SLOPE * LANES + lane],
            g.ring[place, lanes.NODE_CURVATURE * LANES + lane], pitch,
        )  # fmt: skip
    counts[layout.POINTER], counts[layout.HEAD] = 0, per_turn
    counts[layout.SAMPLES], counts[layout.STEP] = g.counters[SAMPLES], index
    counts[layout.TURNS] = int(c[lanes.TURNS * LANES + lane])
    counts[layout.PIECES] += g.counters[STEPS]
    g.modes[lane] = ALONE
    # What is left of the lane computes zeros.
    for figure in range(lanes.STATE_FIGURES):
        g.one[figure * LANES + lane] = g.other[figure * LANES + lane] = 0.0
    for figure in range(lanes.FIGURES):
        c[figure * LANES + lane] = 0.0
    c[lanes.LIMIT * LANES + lane] = c[lanes.RATE * LANES + lane] = 1.0
    for place in range(per_turn):
        for figure in range(lanes.NODE_FIGURES):
            g.ring[place, figure * LANES + lane] = 0.0
