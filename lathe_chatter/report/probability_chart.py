"""The stability chart of a machine that is known with errors: how probable it is to be stable."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.signal import argrelmin

from lathe_chatter.array_types import Array
from lathe_chatter.model import Cut
from lathe_chatter.plot_style import SAFE
from lathe_chatter.stability.probability import StabilityProbability
from lathe_chatter.stability.safe_limit import SafeLimit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SURE = 0.95
"""The probability at which a depth is called safe."""
_WORTH_A_WORD = 0.05
"""Share of the variance below which a figure is not named."""
_ROWS = 200
_MILLI = 1e3


def cut_probability(cut: Cut, probability: StabilityProbability) -> dict[str, Any]:
    """How sure a cut is to be stable, up to where it is, and what makes it unsure.

    Args:
        cut: The operating point.
        probability: At its speed.
    """
    return {
        'spindle_speed_rpm': cut.spindle_speed_rpm,
        'depth_of_cut': cut.depth_of_cut,
        'stable_with': float(probability.at(cut.depth_of_cut)[0, 0]),
        'safe_with_95_percent': float(probability.safe_depth(SURE)[0]),
        'worth_repeating': dict(probability.worth_repeating(cut.spindle_speed_rpm)),
    }


def probability_sentence(cut: Cut, probability: StabilityProbability) -> str:
    """The same in words."""
    found = cut_probability(cut, probability)
    share, drawn = found['stable_with'], len(probability.limits)
    sure = found['safe_with_95_percent'] * _MILLI
    least = max(min(share, 1.0 - 1.0 / drawn), 1.0 / drawn)
    bound = {0.0: 'less than ', 1.0: 'more than '}.get(share, '')
    said = (
        f'At {cut.spindle_speed_rpm:g} rev/min {cut.depth_of_cut * _MILLI:g} mm is stable with '
        f'{bound}{least:.1%}; up to {sure:.4g} mm is with {SURE:.0%}.'
    )
    repeat = [
        f'{name} {part:.0%}'
        for name, part in list(found['worth_repeating'].items())[:4]
        if part >= _WORTH_A_WORD
    ]
    if repeat:
        said += f' Worth measuring again, by their share: {", ".join(repeat)}.'
    return said


def probable_speeds(limits: SafeLimit, count: int) -> Array:
    """Speeds for a chart of probability: evenly spaced, but at each minimum of the limit.

    Where lobes are narrower than the spacing, the chart then shows the depth that is safe in all
    of them, and not that of speeds that happen to lie between two.

    Args:
        limits: Of the machine as it is told, over rising speeds.
        count: How many.

    Returns:
        Rising from the first to the last of the limits' speeds, rev/min (count,).
    """
    speeds, depths = limits.spindle_speed_rpm, limits.depth_of_cut
    found = np.linspace(speeds[0], speeds[-1], count)
    lowest = argrelmin(depths)[0]
    lowest = lowest[np.argsort(-depths[lowest], kind='stable')]  # the deepest of a cell comes last
    cells = np.searchsorted(0.5 * (found[1:] + found[:-1]), speeds[lowest])
    inside = (cells > 0) & (cells < count - 1)
    found[cells[inside]] = speeds[lowest[inside]]
    return found


def draw_probability(axes: Axes, chart: StabilityProbability, depth_limit: float) -> None:
    """Colour a chart with the probability of stability, and draw the depth that is safe.

    Args:
        axes: With speed, rev/min, and depth, mm.
        chart: Over rising speeds.
        depth_limit: Top of the chart, m.
    """
    speeds, depths = chart.spindle_speed_rpm, np.linspace(0.0, depth_limit, _ROWS)
    even = np.linspace(speeds[0], speeds[-1], speeds.size)
    shades = np.array([np.interp(even, speeds, row) for row in chart.at(depths)])
    colours = axes.imshow(  # an image is drawn in a tenth of the time of a mesh
        shades, cmap='Greens', vmin=0.0, vmax=1.6, origin='lower', aspect='auto', zorder=0,
        extent=(speeds[0], speeds[-1], 0.0, depth_limit * _MILLI), interpolation='bilinear',
    )  # fmt: skip
    bar = axes.figure.colorbar(
        colours, ax=axes, label='probability of being stable', pad=0.01,
        boundaries=np.linspace(0.0, 1.0, 101), ticks=[0.0, 0.25, 0.5, 0.75, SURE],
    )  # fmt: skip
    bar.ax.axhline(SURE, color=SAFE, lw=2.0)
    sure = np.minimum(chart.safe_depth(SURE), 10.0 * depth_limit)
    axes.plot(speeds, sure * _MILLI, color=SAFE, lw=2.2, label=f'safe with {SURE:.0%}')
