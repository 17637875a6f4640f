"""Corners: where a derivative of the surface that is being cut jumps.

A knock, a retune, an event, or a corner that the tool meets leaves one at the newest node. What
follows it is known only when the cut goes on, with whatever it goes on with.
"""

from __future__ import annotations

from lathe_chatter.arrays import Array, Integers
from lathe_chatter.compiled import compiled
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.lathe.integrator import surface
from lathe_chatter.lathe.integrator.propagation import IN_CUT, relative_acceleration


@compiled(inline=True, borrows=True)
def lower(order: int, other: int) -> int:
    """The lower of two orders of a corner, where 0 stands for none."""
    return max(order, other) if order == 0 or other == 0 else min(order, other)


@compiled(inline=True, borrows=True)
def finish_corner(
    numbers: Array, counts: Integers, nodes: Array, settings: Array, matrices: Array,
    force: float, speed: float, acceleration: float,
) -> None:  # fmt: skip
    """Write what follows the newest node, a corner: it differs from what led to it."""
    head, regime = counts[layout.HEAD], counts[layout.REGIME]
    slope, curvature = numbers[layout.MET_SLOPE], numbers[layout.MET_CURVATURE]
    order = counts[layout.SURFACE_CORNER]
    if regime & IN_CUT != 0:
        order = lower(order, counts[layout.CORNER])
        xt, vt = numbers[layout.TOOL_X], numbers[layout.TOOL_V]
        xw, vw = numbers[layout.WORKPIECE_X], numbers[layout.WORKPIECE_V]
        met = numbers[layout.MET] - numbers[layout.FED]
        bend = relative_acceleration(matrices[regime], xt, vt, xw, vw, met, force)
        slope = (settings[layout.FEED_SPEED] + vt - vw) * (1.0 / speed)
        curvature = (bend - slope * acceleration) * (1.0 / (speed * speed))
    nodes[head, surface.SLOPE_AFTER] = slope
    nodes[head, surface.CURVATURE_AFTER] = curvature
    if order > 0:
        nodes[head, surface.ORDER] = min(nodes[head, surface.ORDER], order)
    counts[layout.CORNER] = counts[layout.SURFACE_CORNER] = 0
