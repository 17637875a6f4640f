"""The paper's Tables 2-4 and Figures 3-17, drawn again panel by panel.

Each spans what the paper's own span, as far as its legible axes tell
(`open_questions.figure_window`): 5 turns at 3000 rev/min and 20 at 10000 rev/min.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.model import BearingContact, paper_initial_state
from lathe_chatter.paper.published_runs import PAPER_RUNS, PaperRun, run_named, run_shown_in
from lathe_chatter.paper.reproduced_run import SAMPLE_RATE, paper_lathe
from lathe_chatter.plot_style import TOOL, WORKPIECE, grid, new_figure, save, scale_for
from lathe_chatter.samples import SAMPLE_COLUMNS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WINDOWS = {3000.0: 0.1, 10000.0: 0.12}
"""s that a figure spans, by speed in rev/min."""
_TIME, _DISPLACEMENTS, _VELOCITIES = 0, (2, 4), (3, 5)
_BODIES = (('tool', TOOL), ('workpiece', WORKPIECE))
_MILLI = 1e3
_HEADROOM = 0.18
"""Of a time history, above its curves."""


class Picture(NamedTuple):
    """A picture of the reproduction.

    Attributes:
        name: Of its files.
        place: The table or figure of the paper.
        caption: For the reader.
    """

    name: str
    place: str
    caption: str


def paper_pictures() -> list[Picture]:
    """Every table and figure of the paper that shows a simulation, in its order."""
    tables = [
        Picture('table2', 'Table 2', 'Time histories of the displacements.'),
        Picture('table3', 'Table 3', 'Time histories of the velocities.'),
        Picture('table4', 'Table 4', 'Phase trajectories of tool and workpiece.'),
    ]
    figures = []
    for number in range(3, 18):
        place = f'Fig {number}'
        kind = 'Time histories' if _is_history(number) else 'Phase plots'
        caption = f'{kind}: {run_shown_in(place).title}.'
        figures.append(Picture(f'fig{number:02d}', place, caption))
    return tables + figures


def draw_paper_picture(name: str, folder: Path) -> None:
    """Draw a picture of `paper_pictures` as PNG and SVG into a folder."""
    picture = next(entry for entry in paper_pictures() if entry.name == name)
    path = folder / name
    if picture.place.startswith('Table'):
        _draw_table(picture, path)
    elif _is_history(int(name[3:])):
        _draw_histories(picture, path)
    else:
        _draw_phases(picture, path)


def _is_history(number: int) -> bool:
    return number <= 8 or number in {15, 16}


@lru_cache
def _samples(name: str) -> Array:
    """What a figure shows of a run (n, 8), from t = 0 on."""
    run = run_named(name)
    lathe = paper_lathe(run, BearingContact.SEATED)
    start = np.zeros((1, len(SAMPLE_COLUMNS)))
    start[0, 2:6] = paper_initial_state(lathe.cut)
    return np.vstack((start, lathe.advance(round(WINDOWS[run.spindle_speed_rpm] * SAMPLE_RATE))))


def _draw_table(picture: Picture, path: Path) -> None:
    """Four conditions by without and with a bearing clearance of 60 µm."""
    figure = new_figure(11.0, 13.0)
    marks = '   (ring: start, dot: end)' if picture.place == 'Table 4' else ''
    figure.suptitle(f'{picture.place}: {picture.caption[:-1]}{marks}')
    conditions = [(3000.0, 0.5e-3), (10000.0, 0.5e-3), (3000.0, 1e-3), (10000.0, 1e-3)]
    cells = figure.subplots(len(conditions), 2)
    for row, condition in zip(cells, conditions, strict=True):
        for axes, clearance in zip(row, (None, 60e-6), strict=True):
            run = next(
                run
                for run in PAPER_RUNS
                if (run.spindle_speed_rpm, run.depth_of_cut) == condition
                and run.bearing_clearance == clearance
            )
            axes.set_title(run.title, fontsize=10)
            if picture.place == 'Table 2':
                _draw_history(axes, run, 'displacement', 'm', _DISPLACEMENTS)
            elif picture.place == 'Table 3':
                _draw_history(axes, run, 'velocity', 'm/s', _VELOCITIES)
            else:
                _draw_plane(axes, run, (2, 3), 0)
                _draw_plane(axes, run, (4, 5), 1, '--')
                _label_plane(axes, run, 'displacement', 'velocity')
                axes.legend(loc='upper right', fontsize=8)
    save(figure, path)


def _draw_histories(picture: Picture, path: Path) -> None:
    """Displacements and velocities, in the plane and as a line in space."""
    run = run_shown_in(picture.place)
    figure = new_figure(11.0, 7.5)
    figure.suptitle(f'{picture.place}: {run.title}')
    cells = figure.add_gridspec(2, 2, width_ratios=(1.0, 1.1))
    quantities = (('displacement', 'm', _DISPLACEMENTS), ('velocity', 'm/s', _VELOCITIES))
    for place, (name, unit, columns) in enumerate(quantities):
        _draw_history(figure.add_subplot(cells[place, 0]), run, name, unit, columns)
        space = figure.add_subplot(cells[place, 1], projection='3d')
        samples = _samples(run.name)
        scale = scale_for(unit, samples[:, columns])
        tool, workpiece = (samples[:, c] * scale.factor for c in columns)
        space.plot(samples[:, _TIME] * _MILLI, tool, workpiece, color='k', lw=0.8)
        space.set_xlabel('time / ms', fontsize=8)
        space.set_ylabel(f'tool / {scale.unit}', fontsize=8)
        space.set_zlabel(f'workpiece / {scale.unit}', fontsize=8)
        space.set_title(name, fontsize=10, y=0.98)
        space.tick_params(labelsize=7)
        space.locator_params(axis='y', nbins=5)
        space.set_box_aspect((1.7, 1.0, 0.9), zoom=1.12)
    save(figure, path)


def _draw_history(
    axes: Axes, run: PaperRun, name: str, unit: str, columns: tuple[int, int]
) -> None:
    """Tool and workpiece over time."""
    samples = _samples(run.name)
    scale = scale_for(unit, samples[:, columns])
    for (body, colour), column, style in zip(_BODIES, columns, ('-', '--'), strict=True):
        axes.plot(
            samples[:, _TIME] * _MILLI, samples[:, column] * scale.factor,
            color=colour, lw=1.0, ls=style, label=body,
        )  # fmt: skip
    axes.set_xlabel('time / ms')
    axes.set_ylabel(scale.label(name))
    axes.margins(x=0.0)
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + _HEADROOM * (high - low))  # the legend covers no curve
    axes.legend(loc='upper right', ncols=2, fontsize=8)
    grid(axes)


def _draw_phases(picture: Picture, path: Path) -> None:
    """Phase plots of tool and workpiece, displacements and velocities against each other."""
    run = run_shown_in(picture.place)
    figure = new_figure(11.0, 8.5)
    figure.suptitle(f'{picture.place}: {run.title}   (ring: start, dot: end)')
    (tool, workpiece), (displacements, velocities) = figure.subplots(2, 2)
    for place, (axes, columns) in enumerate(((tool, (2, 3)), (workpiece, (4, 5)))):
        body = _BODIES[place][0]
        _draw_plane(axes, run, columns, place)
        _label_plane(axes, run, f'{body} displacement', f'{body} velocity')
    for axes, columns, name, unit in (
        (displacements, _DISPLACEMENTS, 'displacement', 'm'),
        (velocities, _VELOCITIES, 'velocity', 'm/s'),
    ):
        samples = _samples(run.name)
        scale = scale_for(unit, samples[:, columns])
        x, y = (samples[:, column] * scale.factor for column in columns)
        axes.plot(x, y, color='k', lw=0.8)
        _mark_ends(axes, x, y, 'k')
        axes.set_xlabel(scale.label(f'tool {name}'))
        axes.set_ylabel(scale.label(f'workpiece {name}'))
        grid(axes)
    save(figure, path)


def _draw_plane(
    axes: Axes, run: PaperRun, columns: tuple[int, int], body: int, style: str = '-'
) -> None:
    """One body's velocity over its displacement."""
    samples = _samples(run.name)
    name, colour = _BODIES[body]
    factors = [
        scale_for('m', samples[:, _DISPLACEMENTS]).factor,
        scale_for('m/s', samples[:, _VELOCITIES]).factor,
    ]
    x, y = (samples[:, c] * factor for c, factor in zip(columns, factors, strict=True))
    axes.plot(x, y, color=colour, lw=0.8, ls=style, label=name)
    _mark_ends(axes, x, y, colour)


def _mark_ends(axes: Axes, x: Array, y: Array, colour: str) -> None:
    """A ring where the line begins, a dot where it ends: inward or outward is then plain."""
    axes.plot(x[:1], y[:1], 'o', color=colour, mfc='none', ms=6)
    axes.plot(x[-1:], y[-1:], 'o', color=colour, ms=4)


def _label_plane(axes: Axes, run: PaperRun, x_name: str, y_name: str) -> None:
    """Labels with the units that `_draw_plane` draws in: those of both bodies."""
    samples = _samples(run.name)
    axes.set_xlabel(scale_for('m', samples[:, _DISPLACEMENTS]).label(x_name))
    axes.set_ylabel(scale_for('m/s', samples[:, _VELOCITIES]).label(y_name))
    grid(axes)
