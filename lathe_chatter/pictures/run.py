"""Pictures of a run: readable at a glance, the same colours for the same things throughout."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lathe_chatter.changes import on_the_shop_floor
from lathe_chatter.history import History
from lathe_chatter.model import BearingContact
from lathe_chatter.pictures.style import ALARM, NEUTRAL, TOOL, WORKPIECE, envelope, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MICRO = 1e6
_WINDOW = 0.25
"""s of cutting that a phase portrait or a spectrum shows."""


def draw_run(history: History, path: Path) -> None:
    """Draw a run over time, and what the cut was like before, during and after chatter.

    Args:
        history: The run.
        path: Of the PNG file to write.
    """
    figure = new_figure(12.0, 10.5)
    rows = figure.add_gridspec(4, 3, height_ratios=[1.1, 1.1, 0.8, 1.3])
    tool = figure.add_subplot(rows[0, :])
    workpiece = figure.add_subplot(rows[1, :], sharex=tool)
    growth = figure.add_subplot(rows[2, :], sharex=tool)
    time = history.samples['time']
    for axes, name, colour in (
        (tool, 'tool', TOOL),
        (workpiece, 'workpiece', WORKPIECE),
    ):
        envelope(axes, time, history.samples[f'{name}_displacement'] * _MICRO, colour)
        axes.set_ylabel(f'{name}\ndisplacement / µm')
        axes.tick_params(labelbottom=False)
    if history.start.bearing_contact is not BearingContact.NONE:
        edges = [0.0, *(change.time for change in history.changes), history.duration]
        gaps = [history.cut_at(edge).bearing_clearance * _MICRO for edge in edges]
        workpiece.step(
            edges, gaps, where='post', color='k', lw=1, ls='--', label='bearing clearance'
        )
        workpiece.legend(loc='upper left', frameon=False)
    _draw_growth(growth, history)
    for axes in (tool, workpiece, growth):
        _mark(axes, history)
        axes.grid(visible=True, alpha=0.25)
        axes.margins(x=0.0)
    _label_changes(tool, history)
    moments = _moments(history)
    for place, (title, moment) in enumerate(moments):
        _draw_moment(figure.add_subplot(rows[3, place]), history, title, moment)
    figure.savefig(path, dpi=110)


def _draw_growth(axes: Axes, history: History) -> None:
    """What the monitor said of the growth rate; above zero chatter builds."""
    known = history.estimates.get('growth_rate')
    if known is not None and known.shape[1]:
        axes.plot(known[0], known[1], color=NEUTRAL, lw=1.0)
        low, high = np.nanpercentile(known[1], [2, 98])
        axes.set_ylim(min(1.3 * low, -5.0), max(1.3 * high, 5.0))
    axes.axhline(0.0, color='k', lw=0.8)
    axes.set_ylabel('growth rate\n(monitor) / s$^{-1}$')
    axes.set_xlabel('simulated time / s')


def _mark(axes: Axes, history: History) -> None:
    """Parameter changes as lines, the raised flag as a shade."""
    for change in history.changes:
        axes.axvline(change.time, color='k', lw=0.9, ls=':')
    for start, end in history.chatter_spans():
        axes.axvspan(start, end, color=ALARM, alpha=0.22, lw=0)


def _label_changes(axes: Axes, history: History) -> None:
    """Say above the plot what changed, and where the flag was up."""
    for change in history.changes:
        text = '\n'.join(on_the_shop_floor(name, value) for name, value in change.new.items())
        axes.annotate(
            text, (change.time, 1.0), (3, 4), xycoords=('data', 'axes fraction'),
            textcoords='offset points', fontsize=9, va='bottom',
        )  # fmt: skip
    spans = history.chatter_spans()
    if spans:
        start, _ = spans[0]
        axes.annotate(
            'chatter flagged', (max(start, 0.0), 0.04), (3, 0), xycoords=('data', 'axes fraction'),
            textcoords='offset points', fontsize=9, color='#8a3c66',
        )  # fmt: skip


def _moments(history: History) -> list[tuple[str, float]]:
    """Up to three instants worth a closer look: before the first change, chatter, the end."""
    end = history.duration
    first = history.changes[0].time if history.changes else end
    result = [('before the first change', first)]
    spans = history.chatter_spans()
    if spans:
        start, stop = spans[0]
        inside = [change.time for change in history.changes if start < change.time < stop]
        result.append(('chatter', inside[0] if inside else stop))
    if end > first:
        result.append(('at the end', end))
    return result


def _draw_moment(axes: Axes, history: History, title: str, until: float) -> None:
    """Phase portraits of tool and workpiece in the last part of a second before an instant."""
    samples = history.samples
    inside = (samples['time'] > until - _WINDOW) & (samples['time'] <= until)
    for name, colour in (('tool', TOOL), ('workpiece', WORKPIECE)):
        axes.plot(
            samples[f'{name}_displacement'][inside] * _MICRO,
            samples[f'{name}_velocity'][inside] * 1e3,
            color=colour, lw=0.8, label=name, marker='o', ms=3, markevery=[-1],
        )  # fmt: skip
    # A cut at rest is a point: without a floor the axes would show rounding as motion.
    for low_high, setter in (
        (axes.get_xlim(), axes.set_xlim),
        (axes.get_ylim(), axes.set_ylim),
    ):
        middle, half = 0.5 * sum(low_high), 0.5 * (low_high[1] - low_high[0])
        setter(middle - max(half, 0.5), middle + max(half, 0.5))
    cut = history.cut_at(until - 0.5 * _WINDOW)
    axes.set_title(
        f'{title} (to {until:.2f} s)\n{cut.spindle_speed_rpm:g} rev/min, '
        f'{cut.depth_of_cut * 1e3:g} mm',
        fontsize=10,
    )
    axes.set_xlabel('displacement / µm')
    axes.set_ylabel('velocity / (mm/s)')
    axes.grid(visible=True, alpha=0.25)
    axes.legend(loc='upper right', frameon=False, fontsize=8)
