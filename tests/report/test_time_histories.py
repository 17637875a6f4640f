"""What the picture of a run joins by lines, and what not."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from matplotlib.figure import Figure
from support.histories import history_of

from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.lathe.change_and_knock_sentences import Change, Knock
from lathe_chatter.report.time_histories import apart, draw_time_histories
from lathe_chatter.samples import SAMPLE_COLUMNS


def test_figures_are_not_joined_over_a_silence() -> None:
    series = np.array([[0.0, 0.05, 0.1, 1.0, 1.05, 3.0], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]])
    times, values = apart(series, 0.2)
    assert np.array_equal(values, [1.0, 2.0, 3.0, np.nan, 4.0, 5.0, np.nan, 6.0], equal_nan=True)
    assert np.array_equal(np.isnan(times), np.isnan(values))


def test_a_series_without_a_silence_is_left_as_it_is() -> None:
    for count in (0, 1, 5):
        series = np.vstack([0.05 * np.arange(count), np.arange(count)])
        assert np.array_equal(apart(series, 0.2), series)


def test_a_settled_run_has_axes_that_can_be_read() -> None:
    lathe = VirtualLathe()
    lathe.advance(1_000_000)
    samples = dict(zip(SAMPLE_COLUMNS, lathe.advance(20_000).T, strict=True))
    figure = Figure()
    panels = figure.subplots(4)
    draw_time_histories(panels, history_of(samples))
    figure.draw_without_rendering()
    for axes in panels:
        assert not axes.yaxis.get_offset_text().get_text()
        assert max(len(label.get_text()) for label in axes.get_yticklabels()) <= 8
    assert panels[0].get_xlim() == pytest.approx((100.0001, 102.0))


def test_a_gap_is_left_open() -> None:
    lathe = VirtualLathe()
    parts = [lathe.advance(1000)]
    lathe.advance(500)
    samples = np.concatenate([*parts, lathe.advance(1000)])
    panels = Figure().subplots(4)
    draw_time_histories(panels, history_of(dict(zip(SAMPLE_COLUMNS, samples.T, strict=True))))
    drawn = panels[0].lines[0].get_ydata()
    assert len(drawn) == 2001
    assert np.flatnonzero(np.isnan(drawn)).tolist() == [1000]
    assert 'samples missing' in [text.get_text() for text in panels[0].texts]


def test_labels_of_much_that_happens_leave_room_to_the_plots() -> None:
    lathe = VirtualLathe()
    samples = dict(zip(SAMPLE_COLUMNS, lathe.advance(5000).T, strict=True))
    knocks = [Knock(0.1 + 1e-4 * k, 0.01) for k in range(200)]
    run = history_of(samples, knocks=knocks)
    figure = Figure(figsize=(12.0, 9.0), layout='constrained')
    panels = figure.subplots(4)
    draw_time_histories(panels, run)
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        figure.draw_without_rendering()
    labels = [text.get_text() for text in panels[0].texts]
    assert f'{200 - len(labels)} more are in the table' == panels[0].get_title(loc='left')
    assert all(axes.get_position().height > 0.05 for axes in panels)


@pytest.mark.parametrize(
    ('change', 'side'), [({'depth_of_cut': 1e-3}, 'left'), ({'workpiece_diameter': 0.06}, 'right')]
)
def test_a_short_label_begins_at_its_line_also_at_the_end(
    change: dict[str, float], side: str
) -> None:
    lathe = VirtualLathe()
    samples = dict(zip(SAMPLE_COLUMNS, lathe.advance(5000).T, strict=True))
    run = history_of(samples, changes=[Change(0.495, {}, change)])
    panels = Figure(figsize=(12.0, 9.0), layout='constrained').subplots(4)
    draw_time_histories(panels, run)
    (label,) = panels[0].texts
    assert label.get_horizontalalignment() == side
