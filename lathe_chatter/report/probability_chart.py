"""The stability chart of a machine that is known with errors: how probable it is to be stable."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lathe_chatter.plot_style import SAFE
from lathe_chatter.stability.probability import StabilityProbability

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SURE = 0.95
"""The probability at which a depth is called safe."""
_ROWS = 200
_MILLI = 1e3


def draw_probability(axes: Axes, chart: StabilityProbability, depth_limit: float) -> None:
    """Colour a chart with the probability of stability, and draw the depth that is safe.

    Args:
        axes: With speed, rev/min, and depth, mm.
        chart: Over rising speeds.
        depth_limit: Top of the chart, m.
    """
    speeds, depths = chart.spindle_speed_rpm, np.linspace(0.0, depth_limit, _ROWS)
    colours = axes.pcolormesh(
        speeds, depths * _MILLI, chart.at(depths), cmap='Greens', vmin=0.0, vmax=1.6,
        shading='gouraud', rasterized=True, zorder=0,
    )  # fmt: skip
    bar = axes.figure.colorbar(
        colours, ax=axes, label='probability of being stable', pad=0.01,
        boundaries=np.linspace(0.0, 1.0, 101), ticks=[0.0, 0.05, 0.25, 0.5, 0.75, SURE, 1.0],
    )  # fmt: skip
    bar.ax.axhline(SURE, color=SAFE, lw=2.0)
    sure = np.minimum(chart.safe_depth(SURE), 10.0 * depth_limit)
    axes.plot(speeds, sure * _MILLI, color=SAFE, lw=2.2, label=f'safe with {SURE:.0%}')
