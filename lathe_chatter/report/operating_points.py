"""The way of the operating point over the stability chart in the course of a run."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lathe_chatter.model import Cut, Machine
from lathe_chatter.model.machine_file import MachineDescription
from lathe_chatter.model.quantity_fields import limits_of
from lathe_chatter.plot_style import ALARM
from lathe_chatter.report.probability_chart import draw_probability, interpolation_speeds
from lathe_chatter.report.run_history import History
from lathe_chatter.report.stability_chart import (
    bearing_text,
    chart_limits,
    chart_speeds,
    draw_limits,
)
from lathe_chatter.stability.probability import StabilityProbability, stability_probability

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MOST_CHARTS = 3
_AROUND = 1.35
"""Ratio of the chart's ends to the slowest and the fastest speed of the run."""
_WAY = '#777777'
_SPEEDS = limits_of(Cut, 'spindle_speed_rpm').low, limits_of(Cut, 'spindle_speed_rpm').high
_OF_A_CHART = (
    'bearing_contact', 'bearing_clearance', 'feed_speed', 'feed_per_revolution',
    'process_damping', 'workpiece_diameter',
)  # fmt: skip


class Stay(NamedTuple):
    """A time at one operating point.

    Attributes:
        number: Of the stay, from 1.
        start: s.
        end: s.
        cut: What was cut.
        chatter: Whether the monitor's flag was raised in it.
    """

    number: int
    start: float
    end: float
    cut: Cut
    chatter: bool


class ChartOf(NamedTuple):
    """What a chart depends on beside speed and depth.

    Attributes:
        machine: That cut.
        tool_leaves_cut: The force law, see `VirtualLathe`.
        cut: Its bearing, feed and process damping, and nothing else.
        described: The machine file, None where there was none.
    """

    machine: Machine
    tool_leaves_cut: bool
    cut: Cut
    described: MachineDescription | None


def stays_of(history: History) -> list[Stay]:
    """The operating points of a run in order; where the spindle ramps, those that it reaches."""
    begin, last = history.begin, history.duration
    times = [change.time for change in history.changes]
    times += [session.time for session in history.later_sessions]
    changes = sorted({time for time in times if begin < time <= last})
    times, ends = [begin, *changes], [*changes, last]
    raised = [flag.time for flag in history.flags if flag.chatter]
    return [
        Stay(
            k + 1, start, end, history.cut_at(max(start, float(np.nextafter(end, begin)))),
            any(start <= time < end for time in raised),
        )
        for k, (start, end) in enumerate(zip(times, ends, strict=True))
    ]  # fmt: skip


def charts_of(history: History) -> list[ChartOf]:
    """The charts that a run needs, one for each bearing and feed, in order; the first few."""
    found: list[ChartOf] = []
    for stay in stays_of(history):
        chart = _chart_of(history, stay)
        if chart not in found:
            found.append(chart)
    return found[:_MOST_CHARTS]


def _chart_of(history: History, stay: Stay) -> ChartOf:
    session = history.session_at(stay.start)
    kept = {name: getattr(stay.cut, name) for name in _OF_A_CHART}
    if stay.cut.feed_per_revolution:
        kept['feed_speed'] = 0.0
    return ChartOf(session.machine, session.tool_leaves_cut, Cut(**kept), session.described)


def probabilities_of(history: History) -> list[tuple[Stay, StabilityProbability]]:
    """The operating points of a run on machines that are known with errors, and how sure."""
    found = []
    for stay in stays_of(history):
        speed = np.array([stay.cut.spindle_speed_rpm])
        probability = _probability(_chart_of(history, stay), speed)
        if probability is not None:
            found.append((stay, probability))
    return found


def _probability(chart: ChartOf, speeds: ArrayLike) -> StabilityProbability | None:
    """Of the machine of a chart, None where nothing is said of its errors."""
    if chart.described is None or not chart.described.uncertainty:
        return None
    return stability_probability(
        chart.machine, chart.described.uncertainty, chart.cut, speeds,
        tool_leaves_cut=chart.tool_leaves_cut,
    )  # fmt: skip


def draw_path(axes: Axes, history: History, chart: ChartOf) -> None:
    """A chart with every operating point that the run had on it."""
    stays = stays_of(history)
    here = [stay for stay in stays if _chart_of(history, stay) == chart]
    speeds = [stay.cut.spindle_speed_rpm for stay in stays]
    slowest, fastest = (chart.described and chart.described.speed_range) or _SPEEDS
    low = min(max(min(speeds) / _AROUND, slowest), *speeds)
    high = max(min(max(speeds) * _AROUND, fastest), *speeds)
    limits = chart_limits(
        chart.machine, chart.cut, chart_speeds(low, high), tool_leaves_cut=chart.tool_leaves_cut
    )
    lowest = float(limits.open_limit.min())
    deepest = max(stay.cut.depth_of_cut for stay in stays)
    top = max(1.4 * deepest, 1.6 * lowest if math.isfinite(lowest) else 0.0, 1e-6)
    probability = _probability(chart, interpolation_speeds(limits))
    draw_limits(axes, limits, chart.cut.bearing_contact, top, shade=probability is None)
    if probability is not None:
        draw_probability(axes, probability, top)
    # Grey: the way into and out of this chart from others.
    for before, after in itertools.pairwise(stays):
        if before in here or after in here:
            begin, (x, depth) = _point(before.cut), _point(after.cut)
            ramps = history.session_at(after.start).spindle_acceleration
            if ramps:  # the depth steps, the speed is on its way
                axes.plot((begin[0], begin[0]), (begin[1], depth), color=_WAY, lw=1.2)
                begin = begin[0], depth
            axes.annotate(
                '', (x, depth), begin,
                arrowprops={'arrowstyle': '->', 'color': _WAY, 'lw': 1.2, 'shrinkB': 7},
            )  # fmt: skip
    for stay in here:
        x, y = _point(stay.cut)
        axes.plot(
            x, y, 'o', ms=15, color='k', mfc=ALARM if stay.chatter else 'white', mew=1.2, zorder=5,
            clip_on=False,  # whole, also at the border
        )  # fmt: skip
        axes.annotate(str(stay.number), (x, y), ha='center', va='center', fontsize=9, zorder=6)
    axes.plot([], [], 'o', color='k', mfc='white', label='operating point, in order')
    if any(stay.chatter for stay in here):
        axes.plot([], [], 'o', color='k', mfc=ALARM, label='chatter flagged there')
    place = {'loc': 'upper center', 'bbox_to_anchor': (0.5, -0.17)}
    spec = axes.get_subplotspec()
    alone = spec is None or spec.get_gridspec().ncols == 1
    axes.legend(**place, ncols=3 if alone else 2, fontsize=8, frameon=False)
    axes.set_title(f'stability chart: {bearing_text(chart.cut)}', fontsize=10, color='k')


def _point(cut: Cut) -> tuple[float, float]:
    """Where a cut stands: rev/min and mm."""
    return cut.spindle_speed_rpm, cut.depth_of_cut * 1e3
