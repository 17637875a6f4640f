"""Ticks due against a clock: the number that time asks for, whatever the pattern of calls."""

from __future__ import annotations

import numpy as np
import pytest

from lathe_chatter.nodes.real_time_loop import SECOND, Pacer

TICK = 2_000_000


def test_a_timer_with_jitter_makes_one_tick_a_call() -> None:
    pacer = Pacer(TICK)
    jitter = np.random.default_rng(1).integers(-TICK // 3, TICK // 3, 1000)
    pacer.start(0)
    assert {pacer.due(k * TICK + int(jitter[k])) for k in range(1, 1000)} == {1}
    assert pacer.overruns == 0


@pytest.mark.parametrize('factor', [0.01, 0.3, 1.0, 7.0, 100.0])
def test_the_number_of_ticks_follows_time_and_not_the_calls(factor: float) -> None:
    random = np.random.default_rng(2)
    pacer = Pacer(TICK, factor)
    pacer.start(0)
    calls = np.cumsum(random.integers(1, 20_000_000, 500))
    made = sum(pacer.due(int(now)) for now in calls)
    assert pacer.overruns == 0
    assert abs(made - calls[-1] * factor / TICK) <= 0.5 + 1e-6


def test_behind_by_more_than_it_may_catch_up_the_excess_is_counted() -> None:
    pacer = Pacer(TICK, patience=10 * TICK)
    pacer.start(0)
    assert pacer.due(110 * TICK) == 10
    assert pacer.lag == 100 * TICK
    assert pacer.overruns == 1
    assert pacer.due(111 * TICK) == 1


def test_no_simulated_time_is_lost_unaccounted() -> None:
    random = np.random.default_rng(3)
    pacer = Pacer(TICK, 2.5)
    pacer.start(0)
    calls = np.cumsum(random.integers(1, 200_000_000, 300))
    made = sum(pacer.due(int(now)) for now in calls)
    assert pacer.overruns > 0
    assert abs(made * TICK + pacer.lag - 2.5 * calls[-1]) <= TICK


def test_a_pause_is_no_lag() -> None:
    pacer = Pacer(TICK)
    pacer.start(0)
    assert pacer.due(TICK) == 1
    pacer.start(1000 * SECOND)
    assert pacer.due(1000 * SECOND + TICK) == 1
    assert (pacer.lag, pacer.overruns) == (0.0, 0)


def test_a_clock_that_jumps_loses_as_much_simulated_time_as_it_asks_for() -> None:
    pacer = Pacer(TICK, 3.0)
    pacer.start(0)
    assert pacer.due(TICK) == 3
    pacer.skip(11 * TICK)
    assert pacer.lag == pytest.approx(30 * TICK)
    assert pacer.due(12 * TICK) == 3


def test_a_follower_makes_everything_up_in_bounded_portions() -> None:
    pacer = Pacer(TICK, patience=10 * TICK, keeps_all=True)
    pacer.start(0)
    portions = [pacer.due(105 * TICK) for _ in range(12)]
    assert portions == [10] * 10 + [5, 0]
    assert pacer.lag == 0.0


def test_a_clock_that_goes_back_is_noticed_and_jitter_is_not_one() -> None:
    pacer = Pacer(TICK, keeps_all=True)
    assert not pacer.started
    pacer.start(100 * SECOND)
    early = 100 * SECOND + TICK - TICK // 3
    assert pacer.due(early) == 1
    assert not pacer.gone_back(early)
    assert pacer.gone_back(99 * SECOND)


def test_a_change_of_factor_neither_wins_nor_loses_time() -> None:
    pacer = Pacer(TICK, 1.0)
    pacer.start(0)
    now = made = 0
    for k in range(2000):
        now += TICK // 10
        pacer.change(1.0 + 1.0 * (k % 2), now)
        made += pacer.due(now) * TICK / pacer.factor
    assert made + pacer.lateness(now) == pytest.approx(now, abs=1.0)
    assert made > 0.9 * now


def test_a_slow_factor_waits() -> None:
    pacer = Pacer(TICK, 0.01)
    pacer.start(0)
    assert [pacer.due(k * TICK) for k in range(1, 101)] == [0] * 49 + [1] + [0] * 50
