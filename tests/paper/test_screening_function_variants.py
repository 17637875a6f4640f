"""Four readings of the screening function: stepped through, judged, and told apart."""

from __future__ import annotations

import numpy as np
import pytest

from lathe_chatter.model import BearingContact, Machine
from lathe_chatter.paper.figures import WINDOWS
from lathe_chatter.paper.open_questions import coefficient_range
from lathe_chatter.paper.published_runs import run_named
from lathe_chatter.paper.reproduced_run import paper_lathe
from lathe_chatter.paper.screening_function_variants import (
    Reading,
    ScreeningReading,
    axes_without_bearing,
    screening_readings,
    simulate,
)

MACHINE = Machine()


@pytest.fixture(scope='module')
def readings() -> dict[Reading, ScreeningReading]:
    return {found.reading: found for found in screening_readings(MACHINE, WINDOWS)}


@pytest.mark.parametrize('reading', [Reading.GAP, Reading.SEATED])
@pytest.mark.parametrize('name', ['bc60-10000-1', 'bc5-3000-0.5', 'bc80-3000-1', 'no-bc-3000-1'])
def test_a_run_is_that_of_the_lathe(name: str, reading: Reading) -> None:
    """The lathe propagates exactly between events that it locates."""
    run = run_named(name)
    states = simulate(run, reading, MACHINE, 0.2)
    lathe = paper_lathe(run, BearingContact(reading.value), MACHINE)
    expected = lathe.advance(2000)
    turn = 60.0 / run.spindle_speed_rpm
    times = np.arange(len(states)) * turn / round(turn / 1e-5)
    for place in (0, 2):
        found = np.interp(expected[:, 0], times, states[:, place])
        size = np.abs(expected[:, 2 + place]).max()
        assert found == pytest.approx(expected[:, 2 + place], abs=1e-7 * size)


def test_two_readings_give_every_verdict(readings: dict[Reading, ScreeningReading]) -> None:
    assert [readings[r].verdicts for r in Reading] == [8, 8, 14, 14]
    wrong = readings[Reading.GAP].against
    assert wrong == readings[Reading.NONE].against
    assert all('bc' in name and name.endswith('-0.5') for name in wrong)
    for reading in (Reading.NONE, Reading.GAP):
        assert readings[reading].coefficient is None


def test_the_range_of_c_of_either_is_that_of_the_roots(
    readings: dict[Reading, ScreeningReading],
) -> None:
    roots = coefficient_range(MACHINE)
    for reading in (Reading.SEATED, Reading.REVERSED):
        assert readings[reading].coefficient == pytest.approx((roots.low, roots.high), rel=3e-4)


def test_one_run_tells_them_apart_by_its_axes(readings: dict[Reading, ScreeningReading]) -> None:
    """The figures that were found before the page computed them, see the paper's folder."""
    seated, other = readings[Reading.SEATED], readings[Reading.REVERSED]
    assert seated.same_as_seated == 10
    assert other.same_as_seated == 9
    assert seated.axes_met == pytest.approx((0.1198, 0.1232), abs=6e-5)
    assert other.axes_met == pytest.approx((0.1128, 0.1162), abs=9e-5)
    without = axes_without_bearing(MACHINE)
    assert without is not None
    assert without[0] < 0.1128
    assert without[1] > 0.1198
