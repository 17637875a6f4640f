"""What the last revolution left on the workpiece, kept against spindle angle.

The surface is a chain of quintics over spindle angle, counted in steps at the target speed: the
surface that the tool meets at place phi stands at phi - N, N steps a turn. Each node carries the
surface S with its first two derivatives by place on either side, because a knock, a retune, an
event or a force that is held for a sample leaves a corner. S is measured from where a steady feed
would stand, so at a steady speed it is r.

A node also says of which derivative it carries a jump (`ORDER`). One turn later a jump in
derivative q of the surface is a jump in derivative q + 2 of the motion, since it enters through
a force: after a few turns it is smoother than a quintic can tell, and is dropped.
"""

from __future__ import annotations

import math
from functools import cache, lru_cache
from typing import Any

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.compiled import compiled
from lathe_chatter.lathe.integrator.simd_vectors import LANES, lanes_at, put

# Rows: those of many nodes lie side by side, and are read and written together (simd_vectors.py).
(
    PLACE,  # steps at the target speed, from the origin
    HEIGHT,  # S, m
    SLOPE_BEFORE,  # dS/dphi on the side of smaller angle, m/step
    CURVATURE_BEFORE,  # d2S/dphi2 there, m/step2
    SLOPE_AFTER,
    CURVATURE_AFTER,
    ORDER,  # lowest derivative of S that jumps here, or SMOOTH
    PITCH,  # turned in a whole step when the surface was cut: how finely it is described
) = range(8)
NODE_SIZE = 8
_CACHE_LINE = 64

SMOOTH = 99.0
LAST_ORDER = 4.0
"""Jumps in higher derivatives than this are below the quintic's own error."""
MERGE = 1e-9
"""Two instants closer than this part of a step are one."""


def empty_nodes(capacity: int) -> Array:
    """Room for nodes (NODE_SIZE, capacity)."""
    return aligned(NODE_SIZE, capacity)


def aligned(*shape: int) -> Array:
    """Zeros that begin where a line of the processor's cache does."""
    size = math.prod(shape)
    room = np.zeros(size + _CACHE_LINE // 8)
    first = -room.ctypes.data % _CACHE_LINE // room.itemsize
    return room[first : first + size].reshape(shape)


def aligned_copy(values: Array) -> Array:
    """The same numbers (n,), beginning where a line of the processor's cache does."""
    result = aligned(len(values))
    result[:] = values
    return result


def with_room(nodes: Array, capacity: int) -> Array:
    """The same nodes (NODE_SIZE, n) with room for `capacity` of them."""
    result = empty_nodes(capacity)
    result[:, : nodes.shape[1]] = nodes
    return result


def fresh_surface(offset: float, turn: float, capacity: int) -> Array:
    """A smooth surface before the first turn of `turn` steps: S = offset (NODE_SIZE, capacity)."""
    nodes = empty_nodes(capacity)
    nodes[PLACE, :2] = -turn, 0.0
    nodes[HEIGHT, :2] = offset
    nodes[ORDER, :2] = SMOOTH
    nodes[PITCH, :2] = math.inf
    return nodes


@cache
def hermite() -> Array:
    """Coefficients (6,) of the quintics with one of u, u', u'' at either end 1 and the rest 0."""
    result = np.zeros((6, 6))
    for k, (u0, d0, e0, u1, d1, e1) in enumerate(np.eye(6)):
        rise, steep, bend = u1 - u0 - d0 - 0.5 * e0, d1 - d0 - e0, e1 - e0
        result[:, k] = (
            u0, d0, 0.5 * e0, 10.0 * rise - 4.0 * steep + 0.5 * bend,
            -15.0 * rise + 7.0 * steep - bend, 6.0 * rise - 3.0 * steep + 0.5 * bend,
        )  # fmt: skip
    return result


@lru_cache(maxsize=64)
def between_nodes(part: float) -> Array:
    """What two nodes a step apart tell of the surface a part of the way on (3, 5).

    Of its height over the first, its slope and its curvature: the weights of the rise, of the
    slopes at either node and of the curvatures.
    """
    coefficients = hermite()[:, [3, 1, 4, 2, 5]]
    result = np.empty((3, 5))
    for k in range(3):
        total = np.zeros(5)
        for power in range(5, k - 1, -1):
            total = total * part + coefficients[power] * math.perm(power, k)
        result[k] = total
    return result


@compiled(inline=True, borrows=True, inner=True)
def quintic_at(
    place0: Any, height0: Any, slope0: Any, curvature0: Any,
    place1: Any, height1: Any, slope1: Any, curvature1: Any, at: Any,
) -> tuple[Any, Any, Any]:  # fmt: skip
    """S and its first two derivatives at place `at` on the quintic with these values at two.

    Of numbers, or of eight quintics.
    """
    width = place1 - place0
    per_width = 1.0 / width
    place = (at - place0) * per_width
    d0 = slope0 * width
    e0 = curvature0 * width * width
    rise = height1 - height0 - d0 - 0.5 * e0
    steep = slope1 * width - d0 - e0
    bend = curvature1 * width * width - e0
    c3 = 10.0 * rise - 4.0 * steep + 0.5 * bend
    c4 = -15.0 * rise + 7.0 * steep - bend
    c5 = 6.0 * rise - 3.0 * steep + 0.5 * bend
    height = height0 + place * (d0 + place * (0.5 * e0 + place * (c3 + place * (c4 + place * c5))))
    slope = d0 + place * (e0 + place * (3.0 * c3 + place * (4.0 * c4 + place * 5.0 * c5)))
    curvature = e0 + place * (6.0 * c3 + place * (12.0 * c4 + place * 20.0 * c5))
    return height, slope * per_width, curvature * (per_width * per_width)


@compiled(inline=True, borrows=True, inner=True)
def surface_at(nodes: Array, left: int, at: float) -> tuple[float, float, float]:
    """S and its first two derivatives at place `at` between nodes `left` and `left + 1`."""
    right = left + 1
    return quintic_at(
        nodes[PLACE, left], nodes[HEIGHT, left],
        nodes[SLOPE_AFTER, left], nodes[CURVATURE_AFTER, left],
        nodes[PLACE, right], nodes[HEIGHT, right],
        nodes[SLOPE_BEFORE, right], nodes[CURVATURE_BEFORE, right], at,
    )  # fmt: skip


@compiled(inline=True, borrows=True, inner=True)
def write_node(
    nodes: Array, node: int, place: float, height: float, slope: float, curvature: float,
    pitch: float,
) -> None:  # fmt: skip
    """Write a node that is smooth until it turns out to be a corner."""
    nodes[PLACE, node] = place
    nodes[HEIGHT, node] = height
    nodes[SLOPE_BEFORE, node] = nodes[SLOPE_AFTER, node] = slope
    nodes[CURVATURE_BEFORE, node] = nodes[CURVATURE_AFTER, node] = curvature
    nodes[ORDER, node] = SMOOTH
    nodes[PITCH, node] = pitch


@compiled(borrows=True, inner=True)
def forget(nodes: Array, first: int, last: int, shift: float) -> None:
    """Forget what lies before node `first`, and count places from an origin `shift` further on.

    Small numbers have small rounding, so an hour of cutting is as exact as its first second; and
    the memory is that of a few turns.
    """
    size = last + 1 - first
    whole = size - size % LANES
    for entry in range(NODE_SIZE):
        moved = shift if entry == PLACE else 0.0
        for node in range(0, whole, LANES):
            put(nodes, entry, node, lanes_at(nodes, entry, first + node) - moved)
        for node in range(whole, size):
            nodes[entry, node] = nodes[entry, first + node] - moved


def recounted(nodes: Array, start: float, ratio: float, ahead: float, feeds: Array) -> Array:
    """Nodes (NODE_SIZE, n) of a surface for another count of steps and another steady feed.

    Args:
        nodes: As they are.
        start: The place that becomes the origin.
        ratio: New steps a turn over the old ones.
        ahead: By how much the feed is ahead of the old steady one, m.
        feeds: The old steady feed and the new one (2,), each in its own m/step.
    """
    result = nodes.copy()
    old, new = feeds[0], feeds[1]
    place = nodes[PLACE] - start
    result[PLACE] = place * ratio
    result[HEIGHT] = nodes[HEIGHT] - ahead + (old * place - new * (place * ratio))
    for slope, curvature in (
        (SLOPE_BEFORE, CURVATURE_BEFORE),
        (SLOPE_AFTER, CURVATURE_AFTER),
    ):
        result[slope] = (nodes[slope] + old) / ratio - new
        result[curvature] = nodes[curvature] / (ratio * ratio)
    result[PITCH] = nodes[PITCH] * ratio
    return result
