"""Corners: where a derivative of the surface that is being cut jumps.

A knock, a retune, an event, a corner that the tool meets, or a force that is held for a sample
leaves one at the newest node. What follows it is known only when the cut goes on, with whatever it
goes on with.
"""

from __future__ import annotations

from lathe_chatter.array_types import Array, Integers
from lathe_chatter.compiled import compiled
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.lathe.integrator import surface
from lathe_chatter.lathe.integrator.simd_vectors import fma


@compiled(inline=True, borrows=True, inner=True)
def lower(order: int, other: int) -> int:
    """The lower of two orders of a corner, where 0 stands for none."""
    return max(order, other) if order == 0 or other == 0 else min(order, other)


@compiled(inline=True, borrows=True, inner=True)
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


@compiled(borrows=True, inner=True)
def bend_of(
    z: Array, outputs: Array, direct: Array, met: float, on_tool: float, between: float,
    turning: float,
) -> float:  # fmt: skip
    """r'', m/step2, of coordinates that meet the surface at `met` under forces, N."""
    # In the order of a block of plain steps, so that it does not matter which of them it is.
    bend: float = fma(direct[layout.SURFACE], met, direct[layout.UNBALANCE_FORCE] * turning)
    for i in range(z.shape[0]):
        bend = fma(outputs[i, layout.BEND], z[i], bend)
    forced = direct[layout.TOOL_FORCE] * on_tool + direct[layout.CUTTING_FORCE] * between
    return bend + forced  # type: ignore[no-any-return]  # a float


@compiled(borrows=True, inner=True)
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
        slope, curvature = numbers[layout.RELATIVE_RATE], bend
        if speed != 1.0 or acceleration != 0.0:
            slope, curvature = by_place(slope, bend, settings[layout.LEAD], speed, acceleration)
    nodes[surface.SLOPE_AFTER, head] = slope
    nodes[surface.CURVATURE_AFTER, head] = curvature
    if order > 0:
        nodes[surface.ORDER, head] = min(nodes[surface.ORDER, head], order)
    counts[layout.CORNER] = counts[layout.SURFACE_CORNER] = 0
