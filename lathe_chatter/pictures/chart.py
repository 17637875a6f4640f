"""The stability chart: both limits, the seating line, and the safe region that they leave."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lathe_chatter.model import Array, BearingContact, Cut, Machine
from lathe_chatter.pictures.style import LINE, OPEN, SAFE, SEATED, grid
from lathe_chatter.stability import safe_limit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SPEEDS = 800
_MILLI = 1e3
_HEADROOM = 2.6
"""Top of a chart, in lowest open limits."""


def chart_speeds(low_rpm: float, high_rpm: float) -> Array:
    """Speeds for a chart, denser where the lobes are: even in 1/speed and in speed by halves."""
    even = np.linspace(low_rpm, high_rpm, _SPEEDS // 2)
    by_delay = 1.0 / np.linspace(1.0 / high_rpm, 1.0 / low_rpm, _SPEEDS // 2)
    speeds: Array = np.unique(np.concatenate((even, np.clip(by_delay, low_rpm, high_rpm))))
    return speeds


def draw_chart(  # noqa: PLR0913 -- one keyword for each thing that a chart shows
    axes: Axes,
    machine: Machine,
    cut: Cut,
    *,
    low_rpm: float,
    high_rpm: float,
    depth_limit: float | None = None,
    tool_leaves_cut: bool = True,
    shade: bool = True,
) -> None:
    """Draw limits and safe region over speed, rev/min, and depth, mm.

    Args:
        axes: To draw into.
        machine: Tool, workpiece, bearing and material.
        cut: Clearance, contact and feed speed.
        low_rpm: From here, rev/min.
        high_rpm: To here.
        depth_limit: Top of the chart, m; by default a few times the lowest limit.
        tool_leaves_cut: Whether the force has a mean, see `safe_limit`.
        shade: Whether to shade the safe region.
    """
    speeds = chart_speeds(low_rpm, high_rpm)
    limits = safe_limit(machine, cut, speeds, tool_leaves_cut=tool_leaves_cut)
    finite = limits.open_limit[np.isfinite(limits.open_limit)]
    lowest = float(finite.min()) if finite.size else 1e-3
    top = _MILLI * (depth_limit if depth_limit is not None else _HEADROOM * lowest)

    def shown(depth: Array) -> Array:
        result: Array = np.minimum(depth * _MILLI, 10.0 * top)
        return result

    if shade:
        axes.fill_between(
            speeds, 0.0, shown(limits.depth_of_cut), color=SAFE, alpha=0.16, lw=0, label='safe'
        )
    contact = cut.bearing_contact
    if contact is not BearingContact.SEATED:
        axes.plot(speeds, shown(limits.open_limit), color=OPEN, lw=1.3, label='limit, open')
    if contact is not BearingContact.NONE:
        axes.plot(
            speeds, shown(limits.seated_limit), color=SEATED, lw=1.3, ls='--',
            label='limit, on its bearing',
        )  # fmt: skip
    if contact is BearingContact.GAP and np.isfinite(limits.seating_line).any():
        axes.plot(
            speeds, shown(limits.seating_line), color=LINE, lw=1.1, ls=':', label='seating line'
        )
    axes.set_xlim(low_rpm, high_rpm)
    axes.set_ylim(0.0, top)
    axes.set_xlabel('spindle speed / (rev/min)')
    axes.set_ylabel('depth of cut / mm')
    grid(axes)
