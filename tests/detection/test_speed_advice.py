"""A better speed or a smaller depth for a cut that is known; the characteristic roots judge."""

from __future__ import annotations

import numpy as np
import pytest
from support.machines import random_machine

from lathe_chatter.detection.speed_advice import Advice, AdvisedSpeed, advise, rule_of_thumb
from lathe_chatter.model import Machine
from lathe_chatter.stability import critical_depth, rightmost_root, rightmost_roots

_RANGE = (1000.0, 12000.0)
_RPM = 5000.0
_EVERY = np.linspace(*_RANGE, 2000)


def _advised(seed: int, seated: bool) -> tuple[Machine, float, Advice]:
    machine = random_machine(np.random.default_rng(seed))
    depth = 1.6 * critical_depth(machine, _RPM, seated=seated)
    stiffness = machine.cutting_coefficient * depth
    return machine, depth, advise(machine, stiffness, _RANGE, _RPM, seated=seated)


@pytest.mark.parametrize('seated', [False, True])
@pytest.mark.parametrize('seed', [2, 3, 4, 5, 6, 8, 9, 10])
def test_recommended_speeds_are_stable_and_as_well_damped_as_is_said(
    seed: int, seated: bool
) -> None:
    machine, depth, advice = _advised(seed, seated)
    if rightmost_roots(machine, _EVERY, depth, seated=seated).real.min() >= 0.0:
        pytest.skip('no speed is stable here')
    assert advice.speeds
    for speed, growth in [(s.spindle_speed_rpm, s.growth_rate) for s in advice.speeds]:
        assert _RANGE[0] <= speed <= _RANGE[1]
        found = [rightmost_root(machine, speed, depth, seated=s).real for s in (False, True)]
        assert found[seated] < 0.0
        # Predicted for the contact that is worse, unless no speed suits both.
        assert growth == pytest.approx(max(found)) or growth == pytest.approx(found[seated])


@pytest.mark.parametrize('seed', [1, 7])
def test_where_no_speed_is_stable_the_depth_is_reduced_no_more_than_it_must(seed: int) -> None:
    machine, depth, advice = _advised(seed, seated=False)
    assert rightmost_roots(machine, _EVERY, depth, seated=False).real.min() > 0.0
    assert advice.speeds == ()
    reduced = advice.depth_factor * depth
    assert rightmost_root(machine, advice.depth_speed_rpm, reduced, seated=False).real < 0.0
    deeper = rightmost_roots(machine, _EVERY, 1.05 * reduced, seated=False).real
    assert deeper.min() > 0.0
    words = advice.in_words(depth)
    assert words == (
        f'no stable speed, reduce the depth to {1e3 * reduced:.3f} mm '
        f'at {advice.depth_speed_rpm:.0f} rev/min'
    )


@pytest.mark.parametrize('speeds', [(500.0, 3000.0), (1000.0, 6000.0), (60.0, 30_000.0)])
def test_a_reduced_depth_is_stable_whether_or_not_the_bearing_carries(
    speeds: tuple[float, float],
) -> None:
    machine = Machine()
    for depth in (1.5e-3, 3e-3, 8e-3, 2e-2):
        advice = advise(machine, machine.cutting_stiffness(depth), speeds, 1500.0)
        if advice.speeds:
            continue
        at, reduced = advice.depth_speed_rpm, advice.depth_factor * depth
        for seated in (False, True):
            assert rightmost_root(machine, at, reduced, seated=seated).real < 0.0
        every = np.geomspace(*speeds, 3000)
        growths = [
            rightmost_roots(machine, every, 1.05 * reduced, seated=s).real for s in (False, True)
        ]
        assert np.max(growths, axis=0).min() > 0.0


def test_speeds_that_are_recommended_differ() -> None:
    machine = Machine()
    stiffness = machine.cutting_stiffness(1e-3)
    advice = advise(machine, stiffness, (1000.0, 6000.0), 1500.0)
    speeds = sorted(speed.spindle_speed_rpm for speed in advice.speeds)
    assert len(speeds) == 3
    assert min(np.diff(speeds) / speeds[:-1]) > 0.02


def test_of_a_speed_without_stable_ones_around_it_the_width_is_told_as_less_than_was_tried() -> (
    None
):
    words = [Advice((AdvisedSpeed(2785.0, -2.5, width),)).in_words() for width in (0.0, 0.01)]
    assert words == [
        'try 2785 rev/min (growth rate -2.5 1/s, stable within less than +-0.5 %)',
        'try 2785 rev/min (growth rate -2.5 1/s, stable within +-0.5 %)',
    ]


def test_the_rule_of_thumb_puts_whole_waves_on_a_turn() -> None:
    speeds = [speed.spindle_speed_rpm for speed in rule_of_thumb(130.0, _RANGE).speeds]
    assert speeds == pytest.approx([7800.0, 3900.0, 2600.0])
    assert rule_of_thumb(130.0, (3000.0, 7000.0)).speeds[0].spindle_speed_rpm == 3900.0
    # Of more than three waves a turn fewer are stable than is said.
    assert rule_of_thumb(130.0, (60.0, 2500.0)).speeds == ()
    # As text: of two nan no two Pythons think alike.
    assert repr(rule_of_thumb(float('nan'), _RANGE)) == repr(Advice())


def test_advice_is_news_where_it_says_another_thing() -> None:
    nothing, less, slower = Advice(), Advice((), 0.8, 3000.0), Advice((AdvisedSpeed(3000.0),))
    same, faster = Advice((AdvisedSpeed(3010.0),)), Advice((AdvisedSpeed(3600.0),))
    for told, now in [(nothing, slower), (nothing, less), (slower, faster), (less, slower)]:
        assert now.differs_from(told)
        assert told is nothing or told.differs_from(now)
    unknown = Advice(found_at_rpm=900.0)
    assert unknown.in_words() == 'no stable speed is known'
    assert unknown.after(nothing) == unknown.in_words()
    assert slower.differs_from(unknown)
    assert not unknown.after(unknown)
    assert not unknown.after(slower)
    for told, now in [(nothing, nothing), (less, less), (slower, same), (slower, nothing)]:
        assert not now.differs_from(told)
