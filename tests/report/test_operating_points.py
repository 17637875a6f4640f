"""The chart of a run: for machines of any size, and how sure it is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from lathe_chatter.cli import main as cli
from lathe_chatter.model import BearingContact, Cut
from lathe_chatter.model.machine_file import load_machine
from lathe_chatter.report import run_figure
from lathe_chatter.report.operating_points import charts_of, draw_path, probabilities_of
from lathe_chatter.report.probability_chart import SURE, probability_sentence
from lathe_chatter.report.run_excerpts import excerpts_of
from lathe_chatter.report.run_history import History, read_history
from lathe_chatter.report.stability_chart import bearing_text
from lathe_chatter.stability import safe_limit

HEAVY = """
tool: {modes: [{frequency: 50 Hz, damping_ratio: 4 %, mass: 3 t}]}
workpiece: {modes: [{frequency: 22 Hz, damping_ratio: 4 %, mass: 40 t}]}
bearing: {stiffness: 2 GN/m, clearance: 0.2 mm, contact: gap}
material: {cutting_coefficient: 2000 MPa, errors: {cutting_coefficient: 15 %}}
spindle: {slowest_speed: 2 rpm, fastest_speed: 100 rpm}
cut: {spindle_speed: 30 rpm, depth_of_cut: 13 mm, feed: 1.5 mm/rev}
"""
LIGHT = """
tool: {modes: [{frequency: 5 kHz, damping_ratio: 2 %, mass: 4 g}]}
workpiece: {modes: [{frequency: 3.2 kHz, damping_ratio: 2 %, mass: 9 g}]}
material: {cutting_coefficient: 800 MPa}
spindle: {slowest_speed: 10000 rpm, fastest_speed: 100000 rpm}
cut: {spindle_speed: 82000 rpm, depth_of_cut: 0.3 mm, feed: 5 um/rev}
"""


def recorded(machine: str, duration: str, tmp_path: Path) -> History:
    run = tmp_path / 'run'
    arguments = ['simulate', '--machine', machine, '--duration', duration, '--output', str(run)]
    assert cli.main(arguments) == 0
    return read_history(run)


@pytest.mark.parametrize(('machine', 'duration'), [(HEAVY, '4'), (LIGHT, '0.05')])
def test_the_chart_of_a_run_is_at_its_speed_and_depth(
    machine: str, duration: str, tmp_path: Path
) -> None:
    history = recorded(machine, duration, tmp_path)
    (chart,) = charts_of(history)
    axes = Figure().add_subplot()
    draw_path(axes, history, chart)
    cut = load_machine(machine).cut
    low, high = axes.get_xlim()
    assert low < cut.spindle_speed_rpm < high <= 100_000.0
    assert cut.depth_of_cut * 1e3 < axes.get_ylim()[1]
    x, y = next(line.get_data() for line in axes.lines if line.get_label() == 'limit, open')
    limits = safe_limit(load_machine(machine).machine, cut, np.asarray(x))
    shown = np.minimum(limits.open_limit * 1e3, np.max(y))
    np.testing.assert_allclose(y, shown, rtol=1e-9)


def test_a_portrait_and_a_section_suit_the_machine(tmp_path: Path) -> None:
    excerpt = excerpts_of(recorded(HEAVY, '7', tmp_path))[-1]
    assert len(excerpt.section('tool').displacement) == 3  # of 30 rev/min in 7 s
    assert np.ptp(excerpt.portrait['time']) == pytest.approx(26.0 / 22.0, rel=1e-3)


def test_the_probability_of_an_operating_point(tmp_path: Path) -> None:
    history = recorded(HEAVY, '1', tmp_path)
    ((stay, found),) = probabilities_of(history)
    described = load_machine(HEAVY)
    exact = safe_limit(described.machine, described.cut).depth_of_cut
    # The limit is inverse to C, whose logarithm scatters by 0.15.
    assert found.safe_depth(SURE)[0] == pytest.approx(exact * np.exp(-1.645 * 0.15), rel=0.02)
    said = probability_sentence(stay.cut, found)
    assert said.startswith('At 30 rev/min 13 mm is stable with ')
    assert f'up to {found.safe_depth(SURE)[0] * 1e3:.4g} mm' in said
    assert 'cutting_coefficient 100%' in said
    shallow = stay.cut.with_changes(depth_of_cut=1e-3)
    assert 'more than 99.9%' in probability_sentence(shallow, found)


@pytest.mark.parametrize(
    ('changes', 'said'),
    [
        ({'bearing_contact': BearingContact.NONE}, 'no bearing'),
        ({'bearing_contact': BearingContact.SEATED}, 'on its bearing'),
        ({}, 'clearance 5 µm, feed 2.5 mm/s'),
        ({'feed_per_revolution': 1.5e-3, 'bearing_clearance': 2.5e-4},
         'clearance 250 µm, feed 1.5 mm/rev'),
        ({'bearing_contact': BearingContact.BOTH_SIDES},
         'clearance 5 µm to both sides, feed 2.5 mm/s'),
    ],
)  # fmt: skip
def test_a_chart_says_what_it_is_drawn_for(changes: dict[str, object], said: str) -> None:
    assert bearing_text(Cut(**changes)) == said  # type: ignore[arg-type]  # fields of a cut


def test_an_operating_point_at_the_border_is_whole(tmp_path: Path) -> None:
    """As one that is faster than the spindle can: the chart ends there."""
    machine = HEAVY.replace('spindle_speed: 30 rpm', 'spindle_speed: 110 rpm')
    machine = machine.replace(', errors: {cutting_coefficient: 15 %}', '')
    history = recorded(machine, '1', tmp_path)
    axes = Figure().add_subplot()
    draw_path(axes, history, *charts_of(history))
    (point,) = (line for line in axes.lines if line.get_marker() == 'o' and len(line.get_xdata()))
    assert point.get_xdata() == [axes.get_xlim()[1]]
    picture = FigureCanvasAgg(axes.figure)
    picture.draw()
    beyond = round(axes.bbox.x1 + 0.5 * point.get_markersize() * axes.figure.dpi / 72.0)
    height = picture.get_width_height()[1]
    row = round(height - axes.transData.transform(point.get_xydata()[0])[1])
    assert np.asarray(picture.buffer_rgba())[row, beyond - 2 : beyond + 1, :3].min() < 128


@pytest.mark.filterwarnings('error')
def test_the_charts_of_many_feeds_are_wide_enough_to_be_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    feeds = ''.join(f'  - {{at: {0.1 * k}, set: {{feed_speed: 0.00{20 + k}}}}}\n' for k in (1, 2))
    scenario = tmp_path / 'feeds.yaml'
    scenario.write_text(f'title: Feeds\nduration: 0.3\nsteps:\n{feeds}', encoding='utf-8')
    run = tmp_path / 'run'
    assert cli.main(['simulate', '--scenario', str(scenario), '--output', str(run)]) == 0
    history = read_history(run)
    figures: list[Figure] = []
    monkeypatch.setattr(run_figure, 'save', lambda figure, _path: figures.append(figure))
    run_figure.draw_run(history, excerpts_of(history), tmp_path / 'report.png')
    FigureCanvasAgg(figures[0]).draw()
    charts = [axes for axes in figures[0].axes if axes.get_title().startswith('stability chart')]
    assert len(charts) == 3
    assert min(axes.get_position().width for axes in charts) > 0.3
