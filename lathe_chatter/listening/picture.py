"""A recording, what was heard in it, and what its labels say."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lathe_chatter.listening.detector_score import CHATTER, Judged, Label
from lathe_chatter.listening.signal_file import Signals
from lathe_chatter.plot_style import (
    NEUTRAL,
    TOOL,
    WORKPIECE,
    Scale,
    grid,
    new_figure,
    save,
    scale_for,
    widen,
)
from lathe_chatter.samples.columns import UNITS

_PIECES = 2000


def draw_judged(
    signals: Signals, listened: str, judged: Judged, labels: Sequence[Label], path: Path
) -> None:
    """Draw the signal with the flag, and the frequency that was heard, into a file.

    Args:
        signals: The recording.
        listened: Label of the column to show.
        judged: What was said of it.
        labels: What was the case, if that is known.
        path: Of the picture.
    """
    figure = new_figure(10.0, 5.5)
    above, below = figure.subplots(2, sharex=True, height_ratios=(3, 2))
    time, values = signals.samples[:, 0], signals.samples[:, signals.columns.index(listened)]
    edges = np.unique(np.linspace(0, len(values), _PIECES + 1).astype(int))[:-1]
    unit, name = UNITS.get(listened, ''), listened.replace('_', ' ')
    scale = scale_for(unit, values) if unit else Scale(1.0, '')
    values = values * scale.factor
    low, high = np.minimum.reduceat(values, edges), np.maximum.reduceat(values, edges)
    above.fill_between(time[edges], low, high, color=TOOL, linewidth=0.4)
    above.set_ylabel(scale.label(name) if unit else name)
    flag = judged.flagged
    above.fill_between(
        judged.times, 0, 1, flag, transform=above.get_xaxis_transform(), color=WORKPIECE,
        alpha=0.25, linewidth=0, label='chatter flagged',
    )  # fmt: skip
    for k, label in enumerate(label for label in labels if label.state == CHATTER):
        above.plot(
            np.clip(label[:2], time[0], time[-1]), [1.02, 1.02],
            transform=above.get_xaxis_transform(), color=NEUTRAL, linewidth=3, clip_on=False,
            solid_capstyle='butt', label='' if k else 'chatter by its labels',
        )  # fmt: skip
    if flag.any() or labels:
        # Not Matplotlib's own places outside of axes: Ubuntu 24.04 has 3.6, which knows none.
        above.legend(loc='lower right', bbox_to_anchor=(1.0, 1.02), ncols=2, frameon=False)
    heard = [(each.time, each.frequency) for each in judged.estimates if each.chatter]
    if heard:
        below.plot(*zip(*heard, strict=True), '.', markersize=2, color=WORKPIECE)
        widen(below, y=1.0)
    below.set_ylabel('chatter frequency / Hz')
    below.set_xlabel('time / s')
    for axes in (above, below):
        grid(axes)
    save(figure, path)
