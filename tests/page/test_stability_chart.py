"""What the page draws its chart of."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from lathe_chatter.model import Cut, Machine
from lathe_chatter.model.lathe_parameter_table import LATHE
from lathe_chatter.page import server
from lathe_chatter.page.stability_chart import chart_key, fits, stability_chart
from lathe_chatter.report.stability_chart import plot_lobes

START = LATHE.complete({})


@pytest.mark.parametrize(
    ('name', 'value', 'is_of_chart'),
    [
        ('force_noise', 0.01, False),
        ('tool_runout', 1e-6, False),
        ('sample_rate', 2e4, False),
        ('tick_rate', 100.0, False),
        ('spindle_speed_rpm', 4000.0, False),
        ('speed_variation_amplitude', 0.1, False),
        ('tool.mass', 0.06, True),
        ('bearing_clearance', 1e-5, True),
        ('workpiece_diameter', 0.1, True),
        ('tool_leaves_cut', False, True),
    ],
)
def test_the_chart_is_drawn_anew_only_where_it_depends_on_what_changed(
    name: str, value: Any, is_of_chart: bool
) -> None:
    changed = {**START, name: value}
    assert (chart_key(changed) != chart_key(START)) is is_of_chart


def test_what_the_key_leaves_out_changes_no_chart() -> None:
    left_out = {
        'force_noise': 0.01, 'runout': 1e-6, 'unbalance': 1e-6, 'sample_rate': 2e4, 'seed': 3,
        'accelerometers': True, 'spindle_acceleration': 100.0,
    }  # fmt: skip
    assert chart_key(LATHE.complete(left_out)) == chart_key(START)
    assert stability_chart(LATHE.complete(left_out)) == stability_chart(START)


def test_a_chart_has_the_speed_of_the_cut_and_the_one_that_is_recommended() -> None:
    usual, fast, slow = stability_chart(START), 27_545.0, 200.0
    assert fits(usual, [3000.0, None])
    assert not fits(usual, [3000.0, fast])
    assert not fits(usual, [slow])
    assert fits(None, [fast])
    assert fits({'error': 'no machine'}, [fast])
    wide = stability_chart(START, [fast, slow])
    assert fits(wide, [3000.0, fast, slow])
    assert min(usual['open_limit']) == pytest.approx(min(wide['open_limit']), rel=0.02)
    assert stability_chart(START, [4000.0]) == usual


@pytest.mark.parametrize('advised', [27_465.0, 13_000.0, 200.0])
def test_a_chart_is_no_wider_than_its_speeds_once_an_advice_is_gone(advised: float) -> None:
    wide = stability_chart(START, [3000.0, advised])
    assert fits(wide, [3000.0, advised])
    assert not fits(wide, [3000.0, None])
    assert not fits(wide, [3000.0, 4000.0])


@pytest.mark.parametrize('speed', [900.0, 3000.0, 11_500.0, 20_000.0])
@pytest.mark.parametrize('advised', [None, 700.0, 11_900.0, 27_465.0])
def test_a_chart_that_is_drawn_anew_fits(speed: float, advised: float | None) -> None:
    values = {**START, 'spindle_speed_rpm': speed}
    assert fits(stability_chart(values, [speed, advised]), [speed, advised])


def test_a_line_has_one_name_on_the_page_and_in_a_picture() -> None:
    drawn = Path(server.__file__).with_name('static').joinpath('draw.js').read_text()
    _, labels = plot_lobes(Machine(), Cut()).get_legend_handles_labels()
    assert len(labels) == 5
    assert not [label for label in labels if f"'{label}'" not in drawn and label != 'the cut']
