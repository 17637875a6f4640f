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
from lathe_chatter.lathe.integrator.simd_vectors import counted, first_of, fma, lanes_at
from lathe_chatter.lathe.integrator.spindle import sine_and_cosine, speed_and_slope


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
    speed: float, most: int, block: Array,
) -> int:  # fmt: skip
    """Follow the surface step by step, at any speed that is not ramped.

    Args:
        nodes: The surface.
        settings: What machine and cut ask for.
        pointer: The node at or before the place met now.
        place: Of the spindle.
        ahead: By how much the feed is ahead, m.
        phase: Of the variation of speed.
        speed: Over the target speed.
        most: Steps.
        block: Written: the rows of the surface and the spindle.

    Returns:
        The steps that can be taken: fewer where something is met that ends plain steps, or where
        the next ones can be read at once.
    """
    variation, frequency = settings[layout.VARIATION], settings[layout.VARIATION_FREQUENCY]
    varied, lead, turn = variation != 0.0, settings[layout.LEAD], settings[layout.TURN]
    merge, span, whole_turn = surface.MERGE, settings[layout.SPAN], math.ceil(turn)
    swing = 1.0
    if varied:
        sine, cosine = sine_and_cosine(0.5 * frequency)
        swing = sine / cosine / (math.pi * frequency)
    acceleration, rise = 0.0, 1.0
    k = 0
    while k < most and place < span:
        if varied:
            phase += frequency
            phase -= math.floor(phase)
            last = speed
            speed, acceleration = speed_and_slope(1.0, 0.0, variation, phase, frequency)
            # The integral of a sine by its ends: 2 sin(middle) cos(z) = sin(start) + sin(end).
            rise = 1.0 + (0.5 * (last + speed) - 1.0) * swing
            ahead += lead * (1.0 - rise)
        place += rise
        met, node = place - turn, pointer + 1
        base = place - whole_turn
        exact = False
        if not varied and nodes[surface.PLACE, node] == base:
            on_grid = turn == whole_turn or nodes[surface.PLACE, node + 1] == base + 1.0
            corner = nodes[surface.ORDER, node] <= surface.LAST_ORDER
            if corner or on_grid or nodes[surface.PLACE, node + 1] <= met + merge:
                break
        else:
            if rise > DETAIL * nodes[surface.PITCH, node]:
                break
            node = pointer
            while (
                nodes[surface.PLACE, node + 1] < met - merge
                and nodes[surface.ORDER, node + 1] > surface.LAST_ORDER
            ):
                node += 1
            following = nodes[surface.PLACE, node + 1]
            exact = following <= met + merge
            corner = nodes[surface.ORDER, node + 1] <= surface.LAST_ORDER
            if following < met - merge or (exact and corner):
                break
            node += int(exact)
        if exact:
            height, slope = nodes[surface.HEIGHT, node], nodes[surface.SLOPE_BEFORE, node]
            curvature = nodes[surface.CURVATURE_BEFORE, node]
            block[at.AFTER, k] = nodes[surface.CURVATURE_AFTER, node]
        else:
            height, slope, curvature = surface.surface_at(nodes, node, met)
            block[at.AFTER, k] = curvature
        block[at.HEIGHT, k], block[at.SLOPE, k], block[at.CURVATURE, k] = height, slope, curvature
        block[at.PLACE, k], block[at.AHEAD, k], block[at.PHASE, k] = place, ahead, phase
        block[at.SPEED, k], block[at.ACCELERATION, k] = speed, acceleration
        block[at.RISE, k], block[at.NODE, k] = rise, node
        pointer = node
        k += 1
    return k
