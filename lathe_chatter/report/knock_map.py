"""The knock that a cut survives, over speed and depth or over clearance."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lathe_chatter.knocks import KnockMap, Margin
from lathe_chatter.knocks.knock_map import Point
from lathe_chatter.model import BearingContact
from lathe_chatter.plot_style import (
    ALARM,
    NEUTRAL,
    OPEN,
    SAFE,
    SEATED,
    grid,
    new_figure,
    save,
    scale_for,
)
from lathe_chatter.report.stability_chart import (
    bearing_text,
    chart_limits,
    chart_speeds,
    draw_limits,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MILLI = 1e3
_WIDTH, _HEIGHT = 9.0, 4.5
"""Of a panel, about, inches."""


def draw_knock_map(knocks: KnockMap, path: Path) -> None:
    """Draw a map as PNG and SVG, one panel for each clearance, or a curve over clearance."""
    grid_of = knocks.grid
    if len(grid_of.speeds) > 1 and len(grid_of.depths) > 1:
        panels = len(grid_of.clearances)
        figure = new_figure(_WIDTH + 2.0, 1.0 + (_HEIGHT + 0.5) * panels)
        for axes, clearance in zip(
            figure.subplots(panels, squeeze=False)[:, 0], grid_of.clearances, strict=True
        ):
            _draw_plane(axes, knocks, clearance)
    else:
        figure = new_figure(9.0, 5.5)
        _draw_curves(figure.subplots(), knocks)
    save(figure, path)


def _draw_plane(axes: Axes, knocks: KnockMap, clearance: float) -> None:
    """Each point that was computed, impulse as colour, over speed and depth, with the limits."""
    from matplotlib.colors import LogNorm

    of = knocks.grid
    here = [point for point in of.points() if point.bearing_clearance == clearance]
    points = {point: knocks.limits[point] for point in here if point in knocks.limits}
    # Points in inches times 72, so that neighbours do not touch; none is cut by the frame.
    gap = min(_WIDTH / len(of.speeds), _HEIGHT / len(of.depths))
    style: dict[str, Any] = {'s': (50.0 * min(gap, 0.25)) ** 2, 'clip_on': False, 'zorder': 3}
    for margin, colour, said in (
        (Margin.NONE_FOUND, SAFE, 'no lasting knock found'),
        (Margin.UNSTABLE, NEUTRAL, 'chatters unknocked'),
    ):
        of_kind = [point for point, limit in points.items() if limit.margin is margin]
        x, y = ([point[k] for point in of_kind] for k in (0, 1))
        axes.scatter(x, _MILLI * np.array(y), color=colour, alpha=0.35, lw=0, label=said, **style)
    finite = {p: abs(v.impulse) for p, v in points.items() if v.margin is Margin.FINITE}
    if finite:
        impulse = np.array([*finite.values()])
        scale = scale_for('N s', impulse)
        low, high = impulse.min() * scale.factor, impulse.max() * scale.factor
        x, y = ([point[k] for point in finite] for k in (0, 1))
        colours = axes.scatter(
            x, _MILLI * np.array(y), c=impulse * scale.factor, cmap='plasma', lw=0,
            norm=LogNorm(low, max(high, 1.01 * low)), **style,
        )  # fmt: skip
        label = f'smallest lasting knock / ({scale.unit})'
        bar = axes.figure.colorbar(colours, ax=axes, label=label, pad=0.02)
        bar.ax.yaxis.set_major_formatter('{x:g}')
        bar.ax.yaxis.set_minor_formatter('{x:g}')
    cut = of.config.cut.with_changes(bearing_clearance=clearance)
    limits = chart_limits(of.config.machine, cut, chart_speeds(of.speeds[0], of.speeds[-1]))
    draw_limits(axes, limits, cut.bearing_contact, of.depths[-1], shade=False)
    axes.set_ylim(of.depths[0] * _MILLI, of.depths[-1] * _MILLI)
    axes.legend(
        loc='upper center', bbox_to_anchor=(0.5, -0.13), ncols=5, fontsize=9, frameon=False
    )
    axes.set_title(f'The knock that a cut survives: {bearing_text(cut)}', size=11, pad=14)


def _draw_curves(axes: Axes, knocks: KnockMap) -> None:
    """Impulse over whichever of clearance, speed and depth varies."""
    of = knocks.grid
    gaps = scale_for('m', np.array(of.clearances))
    name, factor, label, values = (
        'bearing_clearance', gaps.factor, gaps.label('clearance'), of.clearances,
    )  # fmt: skip
    if len(of.speeds) > 1:
        name, factor, label, values = (
            'spindle_speed_rpm', 1.0, 'spindle speed / (rev/min)', of.speeds,
        )  # fmt: skip
    elif len(of.depths) > 1 or of.config.cut.bearing_contact is BearingContact.NONE:
        name, factor, label, values = 'depth_of_cut', _MILLI, 'depth of cut / mm', of.depths
    points = [point for point in of.points() if point in knocks.limits]
    x = np.array([getattr(point, name) * factor for point in points])
    limits = [knocks.limits[point] for point in points]
    shown = np.array([lim.impulse if lim.margin is Margin.FINITE else math.nan for lim in limits])
    scale = scale_for(
        'N s', [abs(k) for limit in limits for k in (limit.impulse, limit.linear, limit.searched)
                if math.isfinite(k)],
    )  # fmt: skip
    linear = np.array([limit.linear if limit.linear > 0.0 else math.nan for limit in limits])
    tried = np.array(
        [lim.searched if lim.margin is Margin.NONE_FOUND else math.nan for lim in limits]
    )
    for impulses, style, colour, said in (
        (np.abs(shown), 'o-', SEATED, 'smallest lasting knock'),
        (linear, '-' if x.size > 1 else 'v', OPEN, 'below: dies out for sure'),
        (tried, '^', SAFE, 'none lasts up to here'),
    ):
        if np.isfinite(impulses).any():
            axes.plot(x, impulses * scale.factor, style, color=colour, lw=1.2, ms=5, label=said)
    unstable = np.array([limit.margin is Margin.UNSTABLE for limit in limits])
    half = 0.5 * (np.diff(x).min() if x.size > 1 else float(np.abs(x).max(initial=0.0)) or 1.0)
    for k, place in enumerate(x[unstable].tolist()):
        axes.axvspan(
            place - half, place + half, color=ALARM, alpha=0.3, lw=0,
            label='chatters unknocked' if k == 0 else None,
        )  # fmt: skip
    axes.set_yscale('log')
    axes.set_xlim(min(values) * factor - half, max(values) * factor + half)
    axes.set_xlabel(label)
    axes.set_ylabel(f'impulse on the tool / ({scale.unit})')
    first = points[0] if points else Point(of.speeds[0], of.depths[0], of.clearances[0])
    parts = {
        'spindle_speed_rpm': f'{first.spindle_speed_rpm:g} rev/min',
        'depth_of_cut': f'{first.depth_of_cut * _MILLI:g} mm',
    }
    cut = of.config.cut.with_changes(bearing_clearance=first.bearing_clearance)
    fixed = ', '.join(text for key, text in parts.items() if key != name)
    fixed += f', {bearing_text(cut)}' if name != 'bearing_clearance' else ''
    axes.set_title(f'The knock that a cut survives: {fixed}', size=11)
    axes.legend(fontsize=9)
    grid(axes)
