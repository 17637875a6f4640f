"""Which surface the tool meets at the ends of a block of plain steps.

At a steady speed the surface of the turn before was left on a grid of whole steps. Where a turn
has a whole number of them the tool meets its nodes, else a constant part of the way between two:
then a block is read at once. A varied speed meets it anywhere: then node by node.
"""

from __future__ import annotations

import math
from typing import Any

from lathe_chatter.array_types import Array
from lathe_chatter.compiled import compiled
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.lathe.integrator import step_block_layout as at
from lathe_chatter.lathe.integrator import surface
from lathe_chatter.lathe.integrator.piece_plan import DETAIL
from lathe_chatter.lathe.integrator.simd_vectors import (
    LANES,
    after,
    chosen,
    counted,
    first_of,
    fma,
    gathered,
    lanes_at,
    put,
    spread,
)
from lathe_chatter.lathe.integrator.spindle import sine_and_cosine
from lathe_chatter.lathe.integrator.surface_moments import MOMENTS, corner_moments

_THIRD = 3.0
"""Order of a corner of which the motion has none: it would be of the fifth."""


@compiled(inline=True, borrows=True, inner=True)
def nodes_on_grid(nodes: Array, first: int, place: float, turn: float) -> int:
    """Of the steps that end at `place` and one, two ... further on, how many meet smooth nodes.

    Args:
        nodes: The surface.
        first: The first node that may be met.
        place: Where the first step ends.
        turn: Steps a turn takes.
    """
    grid = counted(place - math.ceil(turn))
    places, order = lanes_at(nodes, surface.PLACE, first), lanes_at(nodes, surface.ORDER, first)
    off = (places < grid) | (places > grid) | (order <= surface.LAST_ORDER)
    if turn != math.ceil(turn):
        following = lanes_at(nodes, surface.PLACE, first + 1)
        off = off | (following < grid + 1.0) | (following > grid + 1.0)
    return first_of(off)  # type: ignore[no-any-return]  # Numba has no types


@compiled(inline=True, borrows=True, inner=True)
def surface_on_grid(nodes: Array, first: int, settings: Array) -> tuple[Any, Any, Any, Any]:
    """Height, slope, curvature before and after of such steps, by place."""
    height = lanes_at(nodes, surface.HEIGHT, first)
    turn = settings[layout.TURN]
    if turn == math.ceil(turn):
        return (
            height, lanes_at(nodes, surface.SLOPE_BEFORE, first),
            lanes_at(nodes, surface.CURVATURE_BEFORE, first),
            lanes_at(nodes, surface.CURVATURE_AFTER, first),
        )  # fmt: skip
    rising = lanes_at(nodes, surface.HEIGHT, first + 1) - height
    d0 = lanes_at(nodes, surface.SLOPE_AFTER, first)
    d1 = lanes_at(nodes, surface.SLOPE_BEFORE, first + 1)
    e0 = lanes_at(nodes, surface.CURVATURE_AFTER, first)
    e1 = lanes_at(nodes, surface.CURVATURE_BEFORE, first + 1)
    w = layout.WEIGHTS
    height = _weighed(settings, w, rising, d0, d1, e0, e1) + height
    slope = _weighed(settings, w + 5, rising, d0, d1, e0, e1)
    curvature = _weighed(settings, w + 10, rising, d0, d1, e0, e1)
    return height, slope, curvature, curvature


@compiled(inline=True, borrows=True, inner=True)
def _weighed(settings: Array, w: int, rising: Any, d0: Any, d1: Any, e0: Any, e1: Any) -> Any:
    """The sum of what two nodes tell, by five weights."""
    curved = fma(settings[w + 3], e0, settings[w + 4] * e1)
    return fma(settings[w], rising, fma(settings[w + 1], d0, fma(settings[w + 2], d1, curved)))


@compiled(borrows=True, inner=True)
def look_up(
    nodes: Array, settings: Array, pointer: int, place: float, ahead: float, phase: float,
    speed: float, height: float, slope: float, curvature: float, crosses: bool, most: int,
    block: Array,
) -> tuple[int, bool]:  # fmt: skip
    """Follow the surface step by step, at any speed that is not ramped.

    Args:
        nodes: The surface.
        settings: What machine and cut ask for.
        pointer: The node at or before the place met now.
        place: Of the spindle.
        ahead: By how much the feed is ahead, m.
        phase: Of the variation of speed.
        speed: Over the target speed.
        height: Of the surface met now.
        slope: The same by place.
        curvature: The same, after what is met.
        crosses: Whether a step may meet a corner that leaves none in the motion.
        most: Steps.
        block: Written: the rows of the surface and the spindle.

    Returns:
        The steps that can be taken: fewer where something is met that ends plain steps, or where
        the next ones can be read at once; and whether one meets a corner: then the moments are
        written, too.
    """
    variation, frequency = settings[layout.VARIATION], settings[layout.VARIATION_FREQUENCY]
    varied, lead, turn = variation != 0.0, settings[layout.LEAD], settings[layout.TURN]
    merge, span, whole_turn = surface.MERGE, settings[layout.SPAN], math.ceil(turn)
    rises = spread(1.0)
    if varied:
        for k in range(LANES):
            phase += frequency
            phase -= 1.0 if phase >= 1.0 else 0.0
            block[at.PHASE, k] = phase
        sine, cosine = sine_and_cosine(0.5 * frequency)
        swing = sine / cosine / (math.pi * frequency)
        sines, cosines = sine_and_cosine(lanes_at(block, at.PHASE, 0))
        speeds = 1.0 + variation * sines
        # The integral of a sine by its ends: 2 sin(middle) cos(z) = sin(start) + sin(end).
        rises = 1.0 + (0.5 * (after(speed, speeds) + speeds) - 1.0) * swing
        put(block, at.SPEED, 0, speeds)
        put(block, at.ACCELERATION, 0, variation * 2.0 * math.pi * frequency * cosines)
    put(block, at.RISE, 0, rises)
    before, taken, crossed = place - turn, 0, False
    while taken < most and place < span:
        k, rise = taken, block[at.RISE, taken]
        place += rise
        ahead += lead * (1.0 - rise)
        met, node, base = place - turn, pointer + 1, place - whole_turn
        if not varied and nodes[surface.PLACE, node] == base:
            corner = nodes[surface.ORDER, node] <= surface.LAST_ORDER
            if corner or turn == whole_turn or nodes[surface.PLACE, node + 1] == base + 1.0:
                break
        if rise > DETAIL * nodes[surface.PITCH, node]:
            break
        block[at.CORNER, k] = 0.0
        while nodes[surface.PLACE, node] < met - merge:
            if nodes[surface.ORDER, node] <= surface.LAST_ORDER:
                third = nodes[surface.ORDER, node] >= _THIRD
                if not (crosses and third and block[at.CORNER, k] == 0.0):
                    break
                block[at.CORNER, k], crossed = node, True
            node += 1
        following, corner = nodes[surface.PLACE, node], nodes[surface.ORDER, node]
        exact = following <= met + merge
        if following < met - merge or (exact and corner <= surface.LAST_ORDER):
            break
        pointer = node - 1 + int(exact)
        block[at.LEFT, k], block[at.NODE, k] = node - 1, pointer
        block[at.EXACT, k] = 1.0 if exact else 0.0
        block[at.PLACE, k], block[at.AHEAD, k] = place, ahead
        taken += 1
    if taken == 0:
        return 0, False
    for k in range(taken, LANES):
        block[at.LEFT, k] = pointer
    left, there = lanes_at(block, at.LEFT, 0), lanes_at(block, at.PLACE, 0) - turn
    right, exact_ones = left + 1.0, lanes_at(block, at.EXACT, 0) == 1.0
    height1 = gathered(nodes, surface.HEIGHT, right)
    slope1 = gathered(nodes, surface.SLOPE_BEFORE, right)
    curvature1 = gathered(nodes, surface.CURVATURE_BEFORE, right)
    heights, slopes, curvatures = surface.quintic_at(
        gathered(nodes, surface.PLACE, left), gathered(nodes, surface.HEIGHT, left),
        gathered(nodes, surface.SLOPE_AFTER, left), gathered(nodes, surface.CURVATURE_AFTER, left),
        gathered(nodes, surface.PLACE, right), height1, slope1, curvature1, there,
    )  # fmt: skip
    afters = gathered(nodes, surface.CURVATURE_AFTER, right)
    put(block, at.HEIGHT, 0, chosen(exact_ones, height1, heights))
    put(block, at.SLOPE, 0, chosen(exact_ones, slope1, slopes))
    put(block, at.CURVATURE, 0, chosen(exact_ones, curvature1, curvatures))
    put(block, at.AFTER, 0, chosen(exact_ones, afters, curvatures))
    if crossed:
        for m in range(MOMENTS):
            put(block, at.MOMENT + m, 0, 0.0)
        for k in range(taken):
            place = block[at.PLACE, k] - turn
            if block[at.CORNER, k] > 0.0:
                corner_moments(
                    nodes, int(block[at.CORNER, k]), before, height, slope, curvature, place,
                    block, k,
                )  # fmt: skip
            height, slope, curvature = block[at.HEIGHT, k], block[at.SLOPE, k], block[at.AFTER, k]
            before = place
    return taken, crossed
