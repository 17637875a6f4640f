"""The picture of a run: over time, in its excerpts, and on the stability chart."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from lathe_chatter.plot_style import new_figure, save
from lathe_chatter.report.operating_points import charts_of, draw_path
from lathe_chatter.report.phase_and_spectrum import draw_portrait, draw_section, draw_spectrum
from lathe_chatter.report.run_excerpts import Excerpt
from lathe_chatter.report.run_history import History
from lathe_chatter.report.time_histories import draw_time_histories

_BESIDE = 2
"""Charts beside each other: the legends of more would take all the width."""


def draw_run(history: History, excerpts: Sequence[Excerpt], path: Path) -> None:
    """Draw a run: time histories, phase portraits, spectra, sections and the chart.

    Args:
        history: The run.
        excerpts: Of it.
        path: Of the PNG file to write; an SVG is put beside it.
    """
    charts = charts_of(history)
    more = (len(charts) - 1) // _BESIDE  # rows of charts after the first
    heights = [1.0, 1.0, 0.7, 0.8, 1.5, 1.1, 1.3, *[1.7] * (1 + more)]
    figure = new_figure(12.0, 21.0 + 3.9 * more)
    rows = figure.add_gridspec(len(heights), 1, height_ratios=heights)
    tool = figure.add_subplot(rows[0])
    others = [figure.add_subplot(rows[k], sharex=tool) for k in (1, 2, 3)]
    draw_time_histories([tool, *others], history)
    for row, draw in ((4, draw_portrait), (5, draw_spectrum), (6, draw_section)):
        cells = rows[row].subgridspec(1, len(excerpts))
        for place, excerpt in enumerate(excerpts):
            draw(figure.add_subplot(cells[place]), excerpt)
    beside = min(len(charts), _BESIDE)
    lines = [rows[k].subgridspec(1, beside) for k in range(7, len(heights))]
    for place, chart in enumerate(charts):
        draw_path(figure.add_subplot(lines[place // beside][place % beside]), history, chart)
    save(figure, path)
