from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.machines import random_machine

from lathe_chatter.errors import ParameterError
from lathe_chatter.model import Machine, Mode
from lathe_chatter.stability import (
    critical_depth,
    recommend_speeds,
    rightmost_root,
    rightmost_roots,
    stable_speed_intervals,
)

SPEEDS = 60.0 / np.linspace(60.0 / 1000.0, 60.0 / 12000.0, 150)


@pytest.mark.parametrize('seed', range(6))
def test_stable_intervals_are_where_the_rightmost_root_is_left(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(6):
        machine, seated = random_machine(rng), bool(rng.integers(2))
        depth = 10 ** rng.uniform(-3.6, -2.3)
        ends = stable_speed_intervals(
            machine, depth, seated=seated, low_rpm=1000.0, high_rpm=12000.0
        )
        inside = np.any((ends[:, :1] <= SPEEDS) & (ends[:, 1:] >= SPEEDS), axis=0)
        growth = rightmost_roots(machine, SPEEDS, depth, seated=seated).real
        assert np.array_equal(inside, growth < 0.0)


@pytest.mark.parametrize('undamped', ['tool', 'workpiece'])
def test_a_mode_without_damping_is_counted_right(undamped: str) -> None:
    machine = replace(Machine(), **{undamped: Mode(0.05, 700.0, 0.0)})
    ends = stable_speed_intervals(machine, 4e-4, seated=False, low_rpm=1000.0, high_rpm=12000.0)
    inside = np.any((ends[:, :1] <= SPEEDS) & (ends[:, 1:] >= SPEEDS), axis=0)
    growth = rightmost_roots(machine, SPEEDS, 4e-4, seated=False).real
    assert np.array_equal(inside, growth < 0.0)
    assert 10 < inside.sum() < 140


def test_at_the_ends_of_an_interval_a_root_stands_on_the_axis() -> None:
    ends = stable_speed_intervals(Machine(), 1e-3, seated=False, low_rpm=1100.0, high_rpm=11000.0)
    assert len(ends) >= 3
    growth = rightmost_roots(Machine(), ends, 1e-3, seated=False).real
    assert np.abs(growth).max() < 1e-9


@pytest.mark.parametrize('seed', range(4))
def test_identified_machines_get_a_stable_speed_whenever_one_exists(seed: int) -> None:
    rng = np.random.default_rng(100 + seed)
    advised = 0
    for _ in range(15):
        machine, seated = random_machine(rng), bool(rng.integers(2))
        depth = 10 ** rng.uniform(-3.6, -2.3)
        advice = recommend_speeds(machine, depth, seated=seated, current_rpm=3000.0)
        growth = rightmost_roots(machine, SPEEDS, depth, seated=seated).real
        assert bool(advice.speeds) >= bool(growth.min() < 0.0)
        advised += bool(advice.speeds)
        for speed in advice.speeds:
            rpm = speed.spindle_speed_rpm
            root = rightmost_root(machine, rpm, depth, seated=seated)
            assert root.real < 0.0
            assert speed.growth_rate == pytest.approx(root.real, abs=1e-9)
            assert speed.low_rpm <= rpm <= speed.high_rpm
    assert advised >= 5


def test_the_first_advice_is_the_best_damped() -> None:
    advice = recommend_speeds(Machine(), 1e-3, seated=False)
    growth = [speed.growth_rate for speed in advice.speeds]
    assert growth == sorted(growth)
    scanned = rightmost_roots(Machine(), SPEEDS, 1e-3, seated=False).real
    assert growth[0] <= scanned.min() + 1e-3
    assert advice.stable_depth == 1e-3


def test_without_a_stable_speed_the_advice_is_a_depth() -> None:
    advice = recommend_speeds(
        Machine(), 5e-3, seated=False, low_rpm=1000.0, high_rpm=2000.0, current_rpm=1500.0
    )
    assert advice.speeds == ()
    assert advice.depth_at_current_speed == critical_depth(Machine(), 1500.0, seated=False)
    at = (advice.stable_speed_rpm, advice.stable_depth)
    assert rightmost_root(Machine(), *at, seated=False).real < 0.0
    # No speed of the range keeps a cut stable that is a little deeper.
    speeds = np.linspace(1000.0, 2000.0, 400)
    deeper = rightmost_roots(Machine(), speeds, 1.001 * advice.stable_depth, seated=False)
    assert deeper.real.min() > 0.0


def test_a_speed_keeps_its_distance_from_chatter() -> None:
    for speed in recommend_speeds(Machine(), 1.2e-3, seated=False, margin=0.01).speeds:
        inset = min(0.01 * speed.spindle_speed_rpm, 0.25 * (speed.high_rpm - speed.low_rpm))
        assert speed.spindle_speed_rpm >= speed.low_rpm + 0.9 * inset
        assert speed.spindle_speed_rpm <= speed.high_rpm - 0.9 * inset


def test_an_empty_range_is_refused() -> None:
    with pytest.raises(ParameterError, match='above low_rpm'):
        recommend_speeds(Machine(), 1e-3, seated=False, low_rpm=5000.0, high_rpm=5000.0)
