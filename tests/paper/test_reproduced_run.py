"""Each run of the paper against the printed digits, and by two ways that share only the model."""

from __future__ import annotations

import numpy as np
import pytest

from lathe_chatter.paper import PAPER_RUNS, Pace, Reproduced, reproduce_run
from lathe_chatter.paper.reproduced_run import AGREEMENT, vibration_root

PRINTED = {  # bearing carries, rev/min, mm: as established before the first line of code
    (False, 3000.0, 0.5): (-8.999066, 825.483211),
    (False, 10000.0, 0.5): (-7.240068, 794.924220),
    (False, 3000.0, 1.0): (13.652715, 847.585268),
    (False, 10000.0, 1.0): (21.598456, 816.172885),
    (True, 3000.0, 0.5): (1.708234, 845.306344),
    (True, 10000.0, 0.5): (4.349768, 822.140171),
    (True, 3000.0, 1.0): (19.182492, 867.884034),
    (True, 10000.0, 1.0): (28.772325, 847.879127),
}


@pytest.fixture(scope='module')
def results() -> list[Reproduced]:
    return [reproduce_run(run) for run in PAPER_RUNS]


def test_every_verdict_of_the_paper_comes_out(results: list[Reproduced]) -> None:
    assert len(results) == 14
    assert all(result.agrees for result in results)


def test_roots_have_the_printed_digits(results: list[Reproduced]) -> None:
    for result in results:
        run = result.run
        growth, frequency = PRINTED[run.has_bearing, run.spindle_speed_rpm, 1e3 * run.depth_of_cut]
        assert result.root.real == pytest.approx(growth, abs=0.6e-6)
        assert result.root.imag == pytest.approx(frequency, abs=0.6e-6)


def test_the_simulation_grows_with_the_root(results: list[Reproduced]) -> None:
    for result in results:
        assert abs(result.measured - result.root) < 1e-4 * AGREEMENT


def test_what_the_paper_calls_slow_is_slower_than_what_it_calls_rapid(
    results: list[Reproduced],
) -> None:
    slow = [r.root.real for r in results if r.run.pace is Pace.SLOW]
    rapid = [r.root.real for r in results if r.run.pace is Pace.RAPID]
    assert 0.0 < max(slow) < min(rapid)


def test_equation_9_as_printed_leaves_the_shallow_cuts_stable(results: list[Reproduced]) -> None:
    """It disagrees exactly where the workpiece never reaches its bearing."""
    for result in results:
        if result.literal is None:
            continue
        never = result.literal.touched_at is None
        assert never == (result.run.depth_of_cut < 0.7e-3)
        assert result.literal_agrees == (not never)
        if never:
            assert result.literal.reach < 3.6e-6
            assert result.run.bearing_clearance is not None
            assert result.literal.reach < result.run.bearing_clearance


@pytest.mark.parametrize('root', [complex(-9.0, 825.0), complex(28.0, 300.0)])
def test_a_known_vibration_is_measured(root: complex) -> None:
    time = np.arange(400) * 1e-3
    signal = 3e-9 * np.exp(root.real * time) * np.cos(root.imag * time + 0.3)
    found = vibration_root(signal, 1e-3)
    assert found.real == pytest.approx(root.real, abs=1e-8)
    assert found.imag == pytest.approx(root.imag, abs=1e-8)


def test_names_are_unique_and_every_figure_has_its_run() -> None:
    assert len({run.name for run in PAPER_RUNS}) == len(PAPER_RUNS)
    shown = {place for run in PAPER_RUNS for place in run.places if place.startswith('Fig')}
    assert shown == {f'Fig {number}' for number in range(3, 18)}
