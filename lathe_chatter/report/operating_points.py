"""The way of the operating point over the stability chart in the course of a run."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lathe_chatter.model import BearingContact, Cut, Machine
from lathe_chatter.plot_style import ALARM
from lathe_chatter.report.run_history import History
from lathe_chatter.report.stability_chart import chart_limits, chart_speeds, draw_limits

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MOST_CHARTS = 3
_AROUND = 1.35
"""Ratio of the chart's ends to the slowest and the fastest speed of the run."""
_WAY = '#777777'
_LOW, _HIGH = 60.0, 30000.0


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


class Bearing(NamedTuple):
    """What a chart depends on beside speed and depth."""

    machine: Machine
    tool_leaves_cut: bool
    contact: BearingContact
    clearance: float
    feed_speed: float


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


def bearings_of(history: History) -> list[Bearing]:
    """The bearings that need a chart of their own, in order; the first few."""
    found = [_bearing(history, stay) for stay in stays_of(history)]
    return list(dict.fromkeys(found))[:_MOST_CHARTS]


def _bearing(history: History, stay: Stay) -> Bearing:
    session, cut = history.session_at(stay.start), stay.cut
    bearing = cut.bearing_contact, cut.bearing_clearance, cut.feed_speed
    return Bearing(session.machine, session.tool_leaves_cut, *bearing)


def draw_path(axes: Axes, history: History, bearing: Bearing) -> None:
    """The chart of a bearing, with every operating point that the run had with it."""
    stays = stays_of(history)
    here = [stay for stay in stays if _bearing(history, stay) == bearing]
    speeds = [stay.cut.spindle_speed_rpm for stay in stays]
    low = max(min(speeds) / _AROUND, _LOW)
    high = min(max(speeds) * _AROUND, _HIGH)
    limits = chart_limits(
        bearing.machine, here[0].cut, chart_speeds(low, high),
        tool_leaves_cut=bearing.tool_leaves_cut,
    )  # fmt: skip
    lowest = float(limits.open_limit.min())
    deepest = max(stay.cut.depth_of_cut for stay in stays)
    top = max(1.4 * deepest, 1.6 * lowest if math.isfinite(lowest) else 0.0, 1e-6)
    draw_limits(axes, limits, bearing.contact, top)
    # Grey: the way into and out of this chart from others.
    for before, after in itertools.pairwise(stays):
        if before in here or after in here:
            begin, (x, depth) = _point(before.cut), _point(after.cut)
            if history.spindle_acceleration:  # the depth steps, the speed is on its way
                axes.plot((begin[0], begin[0]), (begin[1], depth), color=_WAY, lw=1.2)
                begin = begin[0], depth
            axes.annotate(
                '', (x, depth), begin,
                arrowprops={'arrowstyle': '->', 'color': _WAY, 'lw': 1.2, 'shrinkB': 7},
            )  # fmt: skip
    for stay in here:
        x, y = _point(stay.cut)
        axes.plot(
            x, y, 'o', ms=15, color='k', mfc=ALARM if stay.chatter else 'white', mew=1.2, zorder=5
        )
        axes.annotate(str(stay.number), (x, y), ha='center', va='center', fontsize=9, zorder=6)
    axes.plot([], [], 'o', color='k', mfc='white', label='operating point, in order')
    if any(stay.chatter for stay in here):
        axes.plot([], [], 'o', color='k', mfc=ALARM, label='chatter flagged there')
    place = {'loc': 'upper center', 'bbox_to_anchor': (0.5, -0.17)}
    axes.legend(**place, ncols=3, fontsize=8, frameon=False)
    title = {
        BearingContact.NONE: 'no bearing clearance',
        BearingContact.GAP: f'clearance {bearing.clearance * 1e6:g} µm, '
        f'feed {bearing.feed_speed * 1e3:g} mm/s',
        BearingContact.SEATED: 'on its bearing',
    }[bearing.contact]
    axes.set_title(f'stability chart: {title}', fontsize=10, color='k')


def _point(cut: Cut) -> tuple[float, float]:
    """Where a cut stands: rev/min and mm."""
    return cut.spindle_speed_rpm, cut.depth_of_cut * 1e3
