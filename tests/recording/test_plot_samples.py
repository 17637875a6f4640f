"""Plots of a run and its samples, and how short both show themselves."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from support.recorded import BOOL
from support.two_lathes import FLAGS, record_two_lathes

import lathe_chatter as lc
from lathe_chatter.errors import ParameterError
from lathe_chatter.recording.ros_messages import message_bytes, topic_of_type
from lathe_chatter.recording.run_writer import RunWriter
from lathe_chatter.samples.codec import SAMPLES_TYPE, encode_block

HERE = Path(__file__).parent
RUN = HERE.parent / 'golden' / 'run'
FLAG = '/chatter_monitor/chatter'


def test_samples_are_plotted_into_the_axes_given() -> None:
    samples = lc.read_run(RUN).samples()
    axes = Figure().subplots()
    assert samples.plot('tool_displacement', axes=axes) is axes
    time = samples.columns['time']
    assert axes.dataLim.x0 >= time[0]
    assert axes.dataLim.x1 <= time[-1]
    highest = samples.columns['tool_displacement'].max()
    drawn = axes.dataLim.y1 / (1e3 if 'mm' in axes.get_ylabel() else 1e6)
    assert drawn == pytest.approx(highest, rel=1e-9)


def test_a_run_is_plotted_with_what_the_monitor_flagged(tmp_path: Path) -> None:
    scenario = lc.Scenario('test', 'Test', 3.0, {'depth_of_cut': 1.2e-3})
    lc.simulate(scenario, tmp_path / 'run', monitor=True)
    run = lc.read_run(tmp_path / 'run')
    axes = run.plot(axes=Figure().subplots())
    shapes = [(patch.get_path(), patch.get_patch_transform()) for patch in axes.patches]
    shades = [path.get_extents(transform).x0 for path, transform in shapes]
    flagged = [m.log_time for m in run.messages('/chatter_monitor/chatter') if m.message.data]
    assert shades == pytest.approx(run.samples().simulated_time(flagged).tolist())
    assert [text.get_text() for text in axes.get_legend().get_texts()] == [
        'tool displacement',
        'workpiece displacement',
    ]


def shades_of(run: lc.Run) -> list[tuple[float, float]]:
    """From when to when chatter is drawn, s."""
    axes = run.plot(axes=Figure().subplots())
    extents = [patch.get_extents() for patch in axes.patches]
    found = [each.transformed(axes.transData.inverted()) for each in extents]
    return [(round(each.x0, 3), round(each.x1, 3)) for each in found]


def record_flags(folder: Path, *, step: float = 0.0, restart: bool = False) -> lc.Run:
    """A flag every 0.1 s, up and down; the clock steps at 0.25 s, or the lathe at 0.15 s."""
    lathe, now = lc.VirtualLathe(), 10**18
    with RunWriter(folder) as writer:
        writer.add_topic(topic_of_type('/lathe/samples', SAMPLES_TYPE))
        writer.add_topic(topic_of_type(FLAG, BOOL))
        for k in range(300):
            now += round(step * 1e9) if k == 125 else 0
            if restart and k == 75:
                lathe = lc.VirtualLathe()
            now += 2_000_000
            stamps = {'log_time': now, 'publish_time': now}
            writer.write('/lathe/samples', encode_block(lathe.advance(20)), **stamps)
            if k % 50 == 49:
                writer.write(FLAG, message_bytes(BOOL, data=k % 100 < 50), **stamps)
    return lc.read_run(folder)


def test_a_flag_stands_where_it_was_whatever_the_clock_did(tmp_path: Path) -> None:
    run = record_flags(tmp_path / 'run', step=-0.2)
    assert shades_of(run) == [(0.1, 0.2), (0.3, 0.4), (0.5, 0.6)]
    samples = run.samples()
    stamps = [10**18 + round(time * 1e9) for time in (0.02, 0.04, 0.1, 0.24, 0.26, 0.5)]
    found = samples.simulated_time(stamps)
    # The clock showed what it shows from 0.052 to 0.25 s a second time.
    assert found == pytest.approx([0.02, 0.04, np.nan, np.nan, 0.46, 0.6], nan_ok=True)


def test_a_flag_that_is_up_when_a_lathe_is_reset_ends_with_its_cut(tmp_path: Path) -> None:
    run = record_flags(tmp_path / 'run', restart=True)
    assert shades_of(run) == [(0.1, 0.15), (0.0, 0.05), (0.15, 0.25), (0.35, 0.45)]


@pytest.mark.parametrize(
    ('columns', 'words'),
    [
        (['tool'], "columns is 'tool': it must be some of"),
        (['tool_displacement', 'cutting_force'], 'columns of one unit'),
    ],
)
def test_what_cannot_be_plotted_is_named(columns: list[str], words: str) -> None:
    with pytest.raises(ParameterError, match=words):
        lc.read_run(RUN).samples().plot(*columns, axes=Figure().subplots())


def test_both_show_themselves_in_a_line() -> None:
    run = lc.read_run(RUN)
    assert repr(run) == f'<Run {RUN}: 1 file>'
    samples = run.samples(columns=['tool_velocity'])
    count, ends = len(samples.columns['tool_velocity']), samples.block_ends
    shown = f'{count} of tool_velocity from {ends[0]:g} to {ends[-1]:g} s'
    assert repr(samples) == f'<Samples: {shown}>'
    with pytest.raises(ParameterError, match='read together with time'):
        samples.plot(axes=Figure().subplots())
    assert '/lathe/samples' in run._repr_html_()
    empty = lc.Samples({'time': np.zeros(0)}, np.zeros(0, np.int64), np.zeros(0), [], [])
    assert repr(empty) == '<Samples: 0 of time>'


@pytest.mark.parametrize('cell', FLAGS)
def test_each_lathe_of_a_run_is_plotted_with_its_own_flag(cell: str, tmp_path: Path) -> None:
    run = lc.read_run(record_two_lathes(tmp_path))
    axes = run.plot(axes=Figure().subplots(), topic=f'/{cell}/lathe/samples')
    (shade,) = axes.patches
    assert shade.get_extents().transformed(axes.transData.inverted()).x0 == pytest.approx(
        0.02 * (FLAGS[cell] + 1)
    )
