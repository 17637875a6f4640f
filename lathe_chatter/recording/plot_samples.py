"""Samples over time as a plot, into axes that are given or new."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from lathe_chatter.errors import ParameterError
from lathe_chatter.plot_style import ALARM, axes_or_new, draw_band, grid, scale_for
from lathe_chatter.recording.recorded_cuts import message_of
from lathe_chatter.recording.run_timeline import read_timeline
from lathe_chatter.samples.columns import UNITS
from lathe_chatter.samples.extremes import TIME, Extremes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from lathe_chatter.recording.run import Run
    from lathe_chatter.recording.sample_series import Samples

_USUAL = ('tool_displacement', 'workpiece_displacement')


def plot_samples(samples: Samples, columns: Iterable[str], axes: Axes | None) -> Axes:
    """Plot columns of one unit over simulated time, with missing samples in grey.

    Raises:
        ParameterError: If there is no such column, no time, or several units.
    """
    known = [name for name in samples.columns if name != TIME]
    names = [*columns] or [name for name in _USUAL if name in known] or known[:1]
    unknown = next((name for name in names if name not in known), None)
    if unknown is not None:
        raise ParameterError('columns', unknown, '', f'some of {", ".join(known)}')
    if TIME not in samples.columns:
        raise ParameterError('columns', ', '.join(known), '', 'read together with time')
    units = {UNITS.get(name, '') for name in names}
    if len(units) > 1:
        raise ParameterError('columns', ', '.join(names), '', 'columns of one unit')
    axes = axes_or_new(axes)
    extremes = Extremes.of_signals({name: samples.columns[name] for name in (TIME, *names)})
    scale = scale_for(units.pop(), *(samples.columns[name] for name in names))
    for number, name in enumerate(names):
        label = name.replace('_', ' ')
        low, high = (values * scale.factor for values in extremes.of(name))
        draw_band(axes, extremes.times, (low, high), f'C{number}', label)
    for before, after in samples.gaps:
        axes.axvspan(before, after, color='0.85', lw=0)
    axes.set_xlabel('simulated time / s')
    axes.set_ylabel(scale.label('value') if len(names) > 1 else scale.label(names[0]))
    axes.legend(loc='upper left', fontsize=9)
    grid(axes)
    return axes


def plot_run(
    run: Run, columns: Iterable[str], axes: Axes | None, topic: str | None = None
) -> Axes:
    """The same of a run, with the times at which the monitor flagged chatter shaded."""
    of_samples = run.samples_topic(topic)
    samples: Any = run.samples(of_samples)
    axes = plot_samples(samples, columns, axes)
    flags = (name for name in run.monitor_topics(of_samples) if name.endswith('/chatter'))
    if (flag := next(flags, None)) is not None:
        for begin, end in _flagged(run, of_samples, flag):
            axes.axvspan(begin, end, color=ALARM, alpha=0.2, lw=0)
    return axes


def _flagged(run: Run, samples: str, flag: str) -> Iterator[tuple[float, float]]:
    """From when to when a flag was up, s: of each cut by itself, as their times overlap."""
    timeline, found = read_timeline(run, samples, flag.__eq__)
    ends = [*timeline.restarts.tolist(), len(timeline.first)]
    told = [(timeline.steady(each)[0], message_of(each).data) for each in found]
    up = False
    for begin, end in pairwise([0, *ends]):
        until = timeline.received[end] if end < len(timeline.first) else math.inf
        raised = float(timeline.first[begin])
        while told and told[0][0] < until:
            received, now = told.pop(0)
            time = timeline.simulated_time(received, slice(begin, end))
            if up and not now:
                yield raised, time
            raised, up = raised if up else time, now
        if up:
            yield raised, float(timeline.last[end - 1])
