"""A run over time: displacements, force and growth rates, with what happened when."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from lathe_chatter.arrays import Array
from lathe_chatter.lathe.cut_events import on_the_shop_floor
from lathe_chatter.model import BearingContact
from lathe_chatter.plot_style import (
    ALARM,
    ALARM_TEXT,
    KNOCK,
    NEUTRAL,
    TOOL,
    WORKPIECE,
    envelope,
    grid,
    scale_for,
)
from lathe_chatter.report.history import History
from lathe_chatter.stability import contact_at, rightmost_root

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LABEL_WIDTH = 0.12
"""Of the picture, that a label above it takes."""
_SILENCE = 0.2
"""s between two figures of the monitor from which on they are not joined: it knew none."""
_BODIES = (('tool', TOOL), ('workpiece', WORKPIECE))


def draw_time_histories(panels: Sequence[Axes], history: History) -> None:
    """Draw tool, workpiece, cutting force and growth rate over time.

    Args:
        panels: Four, from top to bottom, with one axis of time.
        history: The run.
    """
    tool, workpiece, force, growth = panels
    _draw_displacements(tool, workpiece, history)
    _draw_force(force, history)
    _draw_rates(growth, history)
    for axes in panels:
        _mark(axes, history)
        grid(axes)
        axes.margins(x=0.0)
        axes.tick_params(labelbottom=axes is growth)
    _label_changes(tool, history)


def _draw_displacements(tool: Axes, workpiece: Axes, history: History) -> None:
    """Both envelopes, and the clearance where there is one."""
    time = history.samples['time']
    for axes, (name, colour) in zip((tool, workpiece), _BODIES, strict=True):
        values = history.samples[f'{name}_displacement']
        scale = scale_for('m', values)
        envelope(axes, time, values * scale.factor, colour)
        axes.set_ylabel(f'{name}\n{scale.label("displacement")}')
        if name == 'workpiece' and history.start.bearing_contact is not BearingContact.NONE:
            edges = [0.0, *(change.time for change in history.changes), history.duration]
            gaps = [history.cut_at(edge).bearing_clearance * scale.factor for edge in edges]
            axes.step(
                edges, gaps, where='post', color='k', lw=1, ls='--', label='bearing clearance'
            )
            axes.legend(loc='upper left', frameon=False)


def _draw_force(axes: Axes, history: History) -> None:
    """The cutting force: at zero the tool is out of the cut."""
    values = history.samples['cutting_force']
    scale = scale_for('N', values)
    envelope(axes, history.samples['time'], values * scale.factor, NEUTRAL)
    axes.set_ylabel(scale.label('cutting\nforce'))


def _draw_rates(axes: Axes, history: History) -> None:
    """Growth rates: what the monitor measured, and the root of the cut in force."""
    edges = [0.0, *(change.time for change in history.changes), history.duration]
    rates = []
    for edge in edges:
        cut = history.cut_at(edge)
        contact = contact_at(history.machine, cut, tool_leaves_cut=history.tool_leaves_cut)
        root = rightmost_root(
            history.machine, cut.spindle_speed_rpm, cut.depth_of_cut, seated=contact.seated
        )
        rates.append(root.real)
    axes.step(edges, rates, where='post', color='k', lw=1.2, ls='--', label='rightmost root')
    known = history.estimates.get('growth_rate')
    low, high = min(rates), max(rates)
    if known is not None and known.shape[1]:
        times, growth = apart(known, _SILENCE)
        axes.plot(times, growth, color=NEUTRAL, lw=1.0, marker='.', ms=1.5, label='monitor')
        spread = np.nanpercentile(known[1], [2, 98])
        low, high = min(low, spread[0]), max(high, spread[1])
    margin = 0.15 * max(high - low, 1.0)
    axes.set_ylim(min(low - margin, -5.0), max(high + margin, 5.0))
    axes.axhline(0.0, color='k', lw=0.8)
    axes.legend(loc='upper left', frameon=False, ncols=2, fontsize=9)
    axes.set_ylabel('growth rate / s$^{-1}$')
    axes.set_xlabel('simulated time / s')


def apart(series: Array, silence: float) -> Array:
    """A series (2, m) with a nan wherever nothing came for longer than `silence`."""
    gaps = np.flatnonzero(np.diff(series[0]) > silence) + 1
    return np.insert(series, gaps, np.nan, axis=1)


def _mark(axes: Axes, history: History) -> None:
    """Parameter changes and knocks as lines, the raised flag as a shade."""
    for knock in history.knocks:
        axes.axvline(knock.time, color=KNOCK, lw=0.9, ls='-.')
    for change in history.changes:
        axes.axvline(change.time, color='k', lw=0.9, ls=':')
    for start, end in history.chatter_spans():
        axes.axvspan(start, end, color=ALARM, alpha=0.22, lw=0)


def _label_changes(axes: Axes, history: History) -> None:
    """Say above the plot what changed, and where the flag was up."""
    last, height = -history.duration, 4
    labels = [
        (change.time, '\n'.join(on_the_shop_floor(*entry) for entry in change.new.items()), 'k')
        for change in history.changes
    ]
    labels += [
        (knock.time, f'knock {knock.impulse * 1e3:g} mN s', 'k') for knock in history.knocks
    ]
    spans = history.chatter_spans()
    labels += [(max(start, 0.0), 'chatter flagged', ALARM_TEXT) for start, _ in spans[:1]]
    for time, text, colour in sorted(labels):
        # One that would run into the one before stands above it.
        near = time - last < _LABEL_WIDTH * history.duration
        height = height + 12 * (text.count('\n') + 1) if near else 4
        last = time
        axes.annotate(
            text, (time, 1.0), (3, height), xycoords=('data', 'axes fraction'),
            textcoords='offset points', fontsize=9, va='bottom', color=colour,
        )  # fmt: skip
