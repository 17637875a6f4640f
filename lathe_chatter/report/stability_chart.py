"""The stability chart: both limits, where the clearance closes, and the safe region they leave."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from lathe_chatter.array_types import Array
from lathe_chatter.model import BearingContact, Cut, Machine
from lathe_chatter.model.quantity_fields import limits_of
from lathe_chatter.plot_style import (
    LINE,
    OPEN,
    SAFE,
    SEATED,
    axes_or_new,
    grid,
    new_figure,
    save,
    text_of,
)
from lathe_chatter.report.probability_chart import draw_probability
from lathe_chatter.stability import GrowthMap, SafeLimit, safe_limit
from lathe_chatter.stability.probability import StabilityProbability

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_REFINEMENTS, _BETWEEN, _CLOSE = 3, 6, 1e-5
"""Times that speeds are added about peaks, how many between two, and how near is near enough."""
_LEAST_SHADE = 0.02
"""Part of the largest growth rate that the colours of the other sign go to at least."""
_MILLI = 1e3
_USUAL = (0.161, 1.933)
"""Turns in a period of the most flexible mode, where nothing is said of the spindle: of the
paper's machine 1000 to 12,000 rev/min."""
_ABOUT_THE_CUT = 1.25
"""Ratio of a usual range's ends to the speed of the cut, at least; of its top to the depth."""
_HEADROOM = 2.6
_WIDE = 10.0
"""Width of a figure from which on its legend fits into one line, inches."""
SEATING_LINE = 'here the force closes the clearance'


def chart_speeds(low_rpm: float, high_rpm: float, count: int = 800) -> Array:
    """Speeds for a chart, denser where the lobes are: even in 1/speed and in speed by halves."""
    even = np.linspace(low_rpm, high_rpm, count // 2)
    by_delay = 1.0 / np.linspace(1.0 / high_rpm, 1.0 / low_rpm, count // 2)
    speeds: Array = np.unique(np.concatenate((even, np.clip(by_delay, low_rpm, high_rpm))))
    return speeds


def chart_limits(
    machine: Machine, cut: Cut, speeds: Array, *, tool_leaves_cut: bool = True
) -> SafeLimit:
    """The limits at some speeds, and at more where they have peaks, which else look blunt.

    Args:
        machine: Tool, workpiece, bearing and material.
        cut: Clearance, contact and feed.
        speeds: Rising (n,), rev/min.
        tool_leaves_cut: Whether the force has a mean, see `safe_limit`.
    """
    found = safe_limit(machine, cut, speeds, tool_leaves_cut=tool_leaves_cut)
    for _ in range(_REFINEMENTS):
        more = _about_peaks(found)
        if not more.size:
            break
        new = safe_limit(machine, cut, more, tool_leaves_cut=tool_leaves_cut)
        every = {
            each.name: np.concatenate((getattr(found, each.name), getattr(new, each.name)))
            for each in fields(SafeLimit)
        }
        order = np.argsort(every['spindle_speed_rpm'], kind='stable')
        found = SafeLimit(**{name: values[order] for name, values in every.items()})
    return found


def usual_speeds(machine: Machine, cut: Cut) -> tuple[float, float]:
    """Some lobes of the most flexible mode, and the cut, rev/min."""
    return with_room_for(speeds_of_lobes(machine), [cut.spindle_speed_rpm])


def speeds_of_lobes(machine: Machine) -> tuple[float, float]:
    """Some lobes of the most flexible mode, rev/min."""
    modes = (*machine.tool.modes, *machine.workpiece.modes)
    flexible = min(modes, key=lambda mode: mode.stiffness)
    low, high = (
        float(f'{turns * 60.0 * flexible.natural_frequency / (2.0 * math.pi):.2g}')
        for turns in _USUAL
    )
    return low, high


def with_room_for(shown: tuple[float, float], speeds: Iterable[float]) -> tuple[float, float]:
    """Speeds of a chart, and those about some others that are beyond them, rev/min."""
    low, high = shown
    allowed = limits_of(Cut, 'spindle_speed_rpm')
    for speed in speeds:
        low, high = min(low, speed / _ABOUT_THE_CUT), max(high, speed * _ABOUT_THE_CUT)
    return max(low, allowed.low), min(high, allowed.high)


def top_of_chart(cut: Cut, limits: SafeLimit) -> float:
    """Where a chart may end, m: some lowest limits up, and above the cut."""
    lowest = float(np.min(limits.open_limit))
    deep = _ABOUT_THE_CUT * cut.depth_of_cut
    highest = limits_of(Cut, 'depth_of_cut').high
    return min(max(_HEADROOM * lowest, deep), highest) if math.isfinite(lowest) else 2.0 * deep


def _about_peaks(limits: SafeLimit) -> Array:
    """Speeds between the highest point of each peak and its neighbours, rev/min."""
    speeds = limits.spindle_speed_rpm
    new: list[Array] = [np.zeros(0)]
    for depth in (limits.open_limit, limits.seated_limit, limits.depth_of_cut):
        inner = depth[1:-1]
        peaks = np.isfinite(inner) & (inner >= depth[:-2]) & (inner >= depth[2:])
        peaks &= (inner > depth[:-2]) | (inner > depth[2:])
        for k in np.flatnonzero(peaks) + 1:
            new += [
                np.linspace(speeds[j], speeds[j + 1], _BETWEEN + 2)[1:-1]
                for j in (k - 1, k)
                if speeds[j + 1] - speeds[j] > _CLOSE * speeds[j]
            ]
    found: Array = np.setdiff1d(np.concatenate(new), speeds)
    return found


def draw_lobes(  # noqa: PLR0913 -- what a chart may show
    cut: Cut,
    limits: SafeLimit,
    growth: GrowthMap | None,
    depth_limit: float,
    path: Path,
    *,
    probability: StabilityProbability | None = None,
    mark: bool = True,
) -> None:
    """Draw a chart into a file, see `draw_chart` and `save`."""
    figure = new_figure(11.0, 6.0)
    draw_chart(
        figure.subplots(), cut, limits, growth, depth_limit, probability=probability, mark=mark
    )
    save(figure, path)


def draw_chart(  # noqa: PLR0913 -- what a chart may show
    axes: Axes,
    cut: Cut,
    limits: SafeLimit,
    growth: GrowthMap | None,
    depth_limit: float,
    *,
    probability: StabilityProbability | None = None,
    mark: bool = True,
) -> None:
    """Draw a chart with its point of operation.

    Args:
        axes: To draw into.
        cut: The point of operation; its bearing is that of the limits.
        limits: Over rising speeds.
        growth: To colour the chart with, or None.
        depth_limit: Top of the chart, m.
        probability: To colour it with, of a machine that is known with errors.
        mark: Whether the point of operation is known, and marked.
    """
    varied = cut.speed_variation_amplitude > 0.0
    if growth is not None:
        _draw_growth(axes, growth, zero=varied)
    plain = growth is None and probability is None
    draw_limits(axes, limits, cut.bearing_contact, depth_limit, shade=plain)
    if probability is not None:
        draw_probability(axes, probability, depth_limit)
    slowest, fastest = limits.spindle_speed_rpm[[0, -1]].tolist()
    if mark and cut.depth_of_cut <= depth_limit and slowest <= cut.spindle_speed_rpm <= fastest:
        axes.plot(
            cut.spindle_speed_rpm, cut.depth_of_cut * _MILLI, 'o', color='k', mfc='white',
            ms=7, label='the cut', clip_on=False, zorder=5,
        )  # fmt: skip
    wide = axes.figure.bbox.width > _WIDE * axes.figure.dpi
    axes.legend(
        loc='upper center', bbox_to_anchor=(0.5, -0.1 if wide else -0.13),
        ncols=5 if wide else 2, fontsize=9, frameon=False,
    )  # fmt: skip
    text = f'Stability chart: {bearing_text(cut)}'
    if varied and growth is not None:
        text += (
            f'; colours and heavy line: {growth.law.value} varied by '
            f'{cut.speed_variation_amplitude:.0%} at {cut.speed_variation_frequency:g} Hz'
        )
    axes.set_title(text, fontsize=11)


def bearing_text(cut: Cut) -> str:
    """What a chart is drawn for beside its axes."""
    if cut.bearing_contact is BearingContact.NONE:
        return 'no bearing'
    if cut.bearing_contact is BearingContact.SEATED:
        return 'on its bearing'
    feed = f'{cut.feed_speed * _MILLI:.4g} mm/s'
    if cut.feed_per_revolution:
        feed = f'{cut.feed_per_revolution * _MILLI:.4g} mm/rev'
    sides = ' to both sides' if cut.bearing_contact is BearingContact.BOTH_SIDES else ''
    return f'clearance {text_of(cut.bearing_clearance, "m")}{sides}, feed {feed}'


def plot_lobes(
    machine: Machine | None = None,
    cut: Cut | None = None,
    spindle_speed_rpm: ArrayLike | None = None,
    *,
    axes: Axes | None = None,
) -> Axes:
    """Plot the limits and the safe region of a machine, its cut as a point: mm over rev/min.

    Args:
        machine: Tool, workpiece, bearing and material; by default the paper's.
        cut: Clearance, contact, feed, and the point; by default the usual one.
        spindle_speed_rpm: Rising speeds, rev/min; by default from a third of the cut's to three
            times as much.
        axes: To draw into; by default those of a new figure.

    Returns:
        The axes.
    """
    machine, cut = machine or Machine(), cut or Cut()
    speed = cut.spindle_speed_rpm
    speeds = chart_speeds(speed / 3.0, speed * 3.0)
    if spindle_speed_rpm is not None:
        speeds = np.asarray(spindle_speed_rpm, float)
    limits = chart_limits(machine, cut, speeds)
    edges = [limits.open_limit, limits.seated_limit, limits.depth_of_cut]
    finite = [edge[np.isfinite(edge)] for edge in edges]
    highest = max((float(np.median(edge)) for edge in finite if len(edge)), default=0.0)
    top = max(2.0 * highest, 1.2 * cut.depth_of_cut)
    axes = axes_or_new(axes)
    draw_chart(axes, cut, limits, None, top)
    return axes


def _draw_growth(axes: Axes, growth: GrowthMap, *, zero: bool) -> None:
    """Growth rate as colour, white where a vibration neither grows nor decays."""
    from matplotlib.colors import TwoSlopeNorm
    from matplotlib.ticker import MaxNLocator

    low, high = float(growth.growth_rate.min()), float(growth.growth_rate.max())
    least = _LEAST_SHADE * max(-low, high) or 1.0
    lowest, highest = min(low, -least), max(high, least)
    # Grey to orange by way of white: the lines over it keep their colours.
    colours = axes.pcolormesh(
        growth.spindle_speed_rpm, growth.depth_of_cut * _MILLI, growth.growth_rate,
        cmap='PuOr_r', norm=TwoSlopeNorm(0.0, lowest, highest),
        shading='gouraud', rasterized=True,
    )  # fmt: skip
    # Either side has a scale of its own, and needs figures of its own.
    sides = [MaxNLocator(4).tick_values(0.0, end) for end in (lowest, highest)]
    ticks = [tick for tick in np.unique(np.concatenate(sides)) if lowest <= tick <= highest]
    label = 'growth rate / s$^{-1}$'
    axes.figure.colorbar(colours, ax=axes, label=label, pad=0.01, ticks=ticks)
    if zero:
        axes.contour(
            growth.spindle_speed_rpm, growth.depth_of_cut * _MILLI, growth.growth_rate,
            levels=[0.0], colors='k', linewidths=2.2,
        )  # fmt: skip


def draw_limits(
    axes: Axes,
    limits: SafeLimit,
    contact: BearingContact,
    depth_limit: float,
    *,
    shade: bool = True,
) -> None:
    """Draw limits and safe region over speed, rev/min, and depth, mm.

    Args:
        axes: To draw into.
        limits: Over rising speeds.
        contact: Of the cut.
        depth_limit: Top of the chart, m.
        shade: Whether to shade the safe region.
    """
    speeds, top = limits.spindle_speed_rpm, depth_limit * _MILLI

    def shown(depth: Array) -> Array:
        result: Array = np.minimum(depth * _MILLI, 10.0 * top)
        return result

    if shade:
        axes.fill_between(
            speeds,
            0.0,
            shown(limits.depth_of_cut),
            color=SAFE,
            alpha=0.16,
            lw=0,
            label='every smaller depth is stable',
        )  # fmt: skip
    if contact is not BearingContact.SEATED:
        axes.plot(speeds, shown(limits.open_limit), color=OPEN, lw=1.3, label='limit, open')
    if contact is not BearingContact.NONE:
        axes.plot(
            speeds, shown(limits.seated_limit), color=SEATED, lw=1.3, ls='--',
            label='limit, on its bearing',
        )  # fmt: skip
    if contact is not BearingContact.SEATED and limits.seating_line.min() <= depth_limit:
        axes.plot(
            speeds, shown(limits.seating_line), color=LINE, lw=1.1, ls=':', label=SEATING_LINE
        )
    axes.set_xlim(speeds[0], speeds[-1])
    axes.set_ylim(0.0, top)
    axes.set_xlabel('spindle speed / (rev/min)')
    axes.set_ylabel('depth of cut / mm')
    grid(axes)
