"""A run over time: displacements, force and growth rates, with what happened when."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.lathe.change_and_knock_sentences import on_the_shop_floor
from lathe_chatter.plot_style import (
    ALARM,
    ALARM_TEXT,
    KNOCK,
    NEUTRAL,
    TOOL,
    WORKPIECE,
    Scale,
    draw_band,
    grid,
    scale_for,
    text_of,
    widen,
)
from lathe_chatter.report.run_excerpts import clearance_is_seen
from lathe_chatter.report.run_history import History
from lathe_chatter.stability import contact_at, root_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LABEL_WIDTH = 0.12
"""Of the picture, that a label above it takes."""
_LONG = 16
"""Letters in a line of such a label."""
_HIGHEST = 160
"""Points above the plot up to which labels stand: more would leave no room to the plots."""
_GAPS = 200
"""That are hatched at most."""
_SILENCE = 0.2
"""s between two figures of the monitor from which on they are not joined: it knew none."""
_RAMP_POINTS = 150
"""At which the root is computed while the spindle ramps."""
_LEAST = {'m': 1e-9, 'N': 1e-3}
"""Half an axis at least. What moves less is at rest, and its rounding is no motion."""
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
        axes.tick_params(labelbottom=axes is growth)
    _label_changes(tool, history)


def _draw_displacements(tool: Axes, workpiece: Axes, history: History) -> None:
    """Both envelopes, and the clearance where there is one."""
    for axes, (name, colour) in zip((tool, workpiece), _BODIES, strict=True):
        scale = _draw_signal(axes, history, f'{name}_displacement', 'm', colour)
        axes.set_ylabel(f'{name}\n{scale.label("displacement")}')
        edges = _edges(history)
        if name == 'workpiece' and any(_clearance_is_seen(history, edge) for edge in edges):
            gaps = [
                history.cut_at(edge).bearing_clearance * scale.factor
                if _clearance_is_seen(history, edge) else math.nan
                for edge in edges
            ]  # fmt: skip
            axes.step(
                edges, gaps, where='post', color='k', lw=1, ls='--', label='bearing clearance'
            )
            _legend_above(axes)
        widen(axes, y=_LEAST['m'] * scale.factor)


def _clearance_is_seen(history: History, time: float) -> bool:
    return clearance_is_seen(history.cut_at(time), history.session_at(time).machine)


def _draw_force(axes: Axes, history: History) -> None:
    """The cutting force: at zero the tool is out of the cut."""
    scale = _draw_signal(axes, history, 'cutting_force', 'N', NEUTRAL)
    axes.set_ylabel(scale.label('cutting\nforce'))
    widen(axes, y=_LEAST['N'] * scale.factor)


def _draw_signal(axes: Axes, history: History, name: str, unit: str, colour: str) -> Scale:
    """The band between the smallest and largest values; a short signal as it is."""
    extremes = history.samples.extremes
    low, high = extremes.of(name)
    scale = scale_for(unit, low[np.isfinite(low)], high[np.isfinite(high)], _LEAST[unit])
    draw_band(axes, extremes.times, (low * scale.factor, high * scale.factor), colour)
    return scale


def _edges(history: History) -> list[float]:
    """Simulated times from one of which to the next the cut is one, or the spindle ramps, s."""
    return sorted({history.begin, history.duration} | history.edges)


def _draw_rates(axes: Axes, history: History) -> None:
    """Growth rates: what the monitor measured, and the root of the cut in force."""
    edges = set(_edges(history))
    for ramp in history.ramps:
        edges |= set(np.linspace(ramp.start, ramp.end, _RAMP_POINTS).tolist())
    times, rates = [], []
    for edge in sorted(edge for edge in edges if history.begin <= edge <= history.duration):
        # A step is drawn upright: what held until then, and what holds from then on.
        for time in (np.nextafter(edge, -np.inf), edge):
            if time >= history.begin:
                times.append(edge)
                rates.append(_rate_at(history, float(time)))
    axes.plot(times, rates, color='k', lw=1.2, ls='--', label='rightmost root')
    known = history.estimates.get('growth_rate')
    low, high = min(0.0, *rates), max(0.0, *rates)
    if known is not None and known.shape[1]:
        measured = apart(known, _SILENCE)
        axes.plot(*measured, color=NEUTRAL, lw=1.0, marker='.', ms=1.5, label='monitor')
        spread = np.nanpercentile(known[1], [2, 98])
        low, high = min(low, spread[0]), max(high, spread[1])
    margin = 0.15 * (high - low or 1.0)
    axes.set_ylim(low - margin, high + margin)
    axes.axhline(0.0, color='k', lw=0.8)
    _legend_above(axes)
    axes.set_ylabel('growth rate / s$^{-1}$')
    axes.set_xlabel('simulated time / s')


def _legend_above(axes: Axes) -> None:
    """A legend above the plot, where no line strikes it through."""
    place = {'loc': 'lower right', 'bbox_to_anchor': (1.0, 0.97)}
    axes.legend(**place, frameon=False, ncols=2, fontsize=9)


def _rate_at(history: History, time: float) -> float:
    """Growth rate of the rightmost root of the cut in force at a simulated time, 1/s."""
    cut = history.cut_at(time)
    session = history.session_at(time)
    contact = contact_at(session.machine, cut, tool_leaves_cut=session.tool_leaves_cut)
    return root_of(session.machine, cut, seated=contact.seated).real


def apart(series: Array, silence: float) -> Array:
    """A series (2, m) with a nan wherever nothing came for longer than `silence`."""
    gaps = np.flatnonzero(np.diff(series[0]) > silence) + 1
    return np.insert(series, gaps, np.nan, axis=1)


def _mark(axes: Axes, history: History) -> None:
    """Parameter changes and knocks as lines, the raised flag as a shade, gaps as hatching."""
    for knock in history.knocks:
        axes.axvline(knock.time, color=KNOCK, lw=0.9, ls='-.')
    for change in history.changes:
        axes.axvline(change.time, color='k', lw=0.9, ls=':')
    for session in history.later_sessions:
        axes.axvline(session.time, color='k', lw=1.4)
    for start, end in history.chatter_spans():
        axes.axvspan(start, end, color=ALARM, alpha=0.22, lw=0)
    for gap in history.samples.gaps[:_GAPS]:
        axes.axvspan(*gap, facecolor='none', edgecolor='#999999', hatch='////', lw=0)
    axes.set_xlim(history.begin, max(history.duration, history.begin + 1e-9))


def _label_changes(axes: Axes, history: History) -> None:
    """Say above the plot what changed, where the flag was up, and where samples are missing."""
    labels = [
        (change.time, '\n'.join(on_the_shop_floor(*entry) for entry in change.new.items()), 'k')
        for change in history.changes
    ]
    labels += [
        (knock.time, f'knock {text_of(knock.impulse, "N s")}', 'k') for knock in history.knocks
    ]
    labels += [(session.time, session.why, 'k') for session in history.later_sessions]
    spans = history.chatter_spans()
    labels += [(start, 'chatter flagged', ALARM_TEXT) for start, _ in spans[:1]]
    labels += [(before, 'samples missing', 'k') for before, _ in history.samples.gaps[:1]]
    length = history.duration - history.begin
    last, height, left_out = -math.inf, 4, 0
    for at, text, colour in sorted(labels):
        time = min(max(at, history.begin), history.duration)
        # One that would run into the one before stands above it.
        near = time - last < _LABEL_WIDTH * length
        above = height + 12 * (text.count('\n') + 1) if near else 4
        if above > _HIGHEST:
            left_out += 1
            continue
        last, height = time, above
        # A long one would take the plots their room on the right.
        long = max(map(len, text.split('\n'))) > _LONG
        late = long and time > history.duration - 0.5 * _LABEL_WIDTH * length
        axes.annotate(
            text, (time, 1.0), (-3 if late else 3, height), xycoords=('data', 'axes fraction'),
            textcoords='offset points', fontsize=9, va='bottom', color=colour,
            ha='right' if late else 'left',
        )  # fmt: skip
    if left_out:
        axes.set_title(
            f'{left_out} more are in the table', fontsize=9, loc='left', pad=_HIGHEST + 24
        )
