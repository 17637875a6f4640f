"""Corners: where a derivative of the surface that is being cut jumps.

A knock, a retune, an event, a corner that the tool meets, or a force that is held for a sample
leaves one at the newest node. What follows it is known only when the cut goes on, with whatever it
goes on with.
"""

from __future__ import annotations

from lathe_chatter.arrays import Array, Integers
from lathe_chatter.compiled import compiled
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.lathe.integrator import surface


@compiled(inline=True, borrows=True)
def lower(order: int, other: int) -> int:
    """The lower of two orders of a corner, where 0 stands for none."""
    return max(order, other) if order == 0 or other == 0 else min(order, other)


@compiled(inline=True, borrows=True)
def by_place(
    rate: float, bend: float, lead: float, speed: float, acceleration: float
) -> tuple[float, float]:
    """Slope and curvature of the surface by place, from r' and r'' by time.

    Args:
        rate: r', m/step.
        bend: r'', m/step2.
        lead: m/step that the feed gains on a spindle that stands still.
        speed: Of the spindle over its target.
        acceleration: The derivative of that per step.
    """
    slope = (rate + lead * (1.0 - speed)) / speed
    return slope, (bend - (lead + slope) * acceleration) / (speed * speed)


@compiled(borrows=True)
def bend_of(
    z: Array, outputs: Array, direct: Array, met: float, on_tool: float, between: float,
    turning: float,
) -> float:  # fmt: skip
    """r'', m/step2, of coordinates that meet the surface at `met` under forces, N."""
    bend: float = 0.0
    for i in range(z.shape[0]):
        bend += outputs[i, layout.BEND] * z[i]
    bend += direct[layout.SURFACE] * met
    bend += direct[layout.UNBALANCE_FORCE] * turning
    bend += direct[layout.TOOL_FORCE] * on_tool + direct[layout.CUTTING_FORCE] * between
    return bend


@compiled(borrows=True)
def finish_corner(
    numbers: Array, counts: Integers, nodes: Array, settings: Array, bend: float,
    speed: float, acceleration: float,
) -> None:  # fmt: skip
    """Write what follows the newest node, a corner: it differs from what led to it."""
    head = counts[layout.HEAD]
    slope, curvature = numbers[layout.SLOPE], numbers[layout.CURVATURE]
    order = counts[layout.SURFACE_CORNER]
    if counts[layout.REGIME] & layout.IN_CUT != 0:
        order = lower(order, counts[layout.CORNER])
        slope, curvature = by_place(
            numbers[layout.RELATIVE_RATE], bend, settings[layout.LEAD], speed, acceleration
        )
    nodes[head, surface.SLOPE_AFTER] = slope
    nodes[head, surface.CURVATURE_AFTER] = curvature
    if order > 0:
        nodes[head, surface.ORDER] = min(nodes[head, surface.ORDER], order)
    counts[layout.CORNER] = counts[layout.SURFACE_CORNER] = 0
