"""The stability chart of a machine that is known with errors: how probable it is to be stable."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.model import Cut
from lathe_chatter.plot_style import SAFE
from lathe_chatter.stability.probability import StabilityProbability
from lathe_chatter.stability.safe_limit import SafeLimit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SURE = 0.95
"""The probability at which a depth is called safe."""
_ABOVE, _BELOW = 0.01, 0.03
"""By how much a line between two speeds may leave the limit to either side, relative."""
_COMPARED = 1e-9, 1e6
"""Limits that are told apart, m."""
_NARROW, _WIDE = 1 / 300, 1 / 150
"""Of the width of a chart: lobes within the one need not be told apart; no gap is wider than the
other."""
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


def interpolation_speeds(limits: SafeLimit) -> Array:
    """Speeds between which the limit is a straight line, or lies above it in narrow lobes.

    What is computed at these and drawn along lines is nowhere deeper than what is stable.

    Args:
        limits: Of the machine as it is told, over rising speeds.

    Returns:
        Some of these speeds, with the first and the last, rev/min.
    """
    speeds = limits.spindle_speed_rpm
    depths = np.clip(limits.depth_of_cut, *_COMPARED)  # it may be 0 throughout, or infinite
    depths = np.minimum(depths, 100.0 * depths.min())
    narrow, wide = (share * (speeds[-1] - speeds[0]) for share in (_NARROW, _WIDE))

    def leaves(begin: int, end: int) -> Array:
        line = np.interp(speeds[begin : end + 1], speeds[[begin, end]], depths[[begin, end]])
        return np.asarray(line / depths[begin : end + 1] - 1.0)

    kept = [0]
    while (here := kept[-1]) < len(speeds) - 1:
        last = int(np.searchsorted(speeds, speeds[here] + narrow, side='right')) - 1
        below = (end for end in range(last, here, -1) if leaves(here, end).max() <= _ABOVE)
        there = next(below, here + 1)
        while there + 1 < len(speeds) and speeds[there + 1] - speeds[here] <= wide:
            left = leaves(here, there + 1)
            if left.max() > _ABOVE or left.min() < -_BELOW:
                break
            there += 1
        kept.append(there)
    return np.asarray(speeds[kept])


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
