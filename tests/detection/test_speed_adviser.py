"""Which estimate a recommended speed comes from; whether it is stable, its root tells."""

from __future__ import annotations

import math

import numpy as np
import pytest
from support.machines import random_machine

from lathe_chatter.detection import Advice, ChatterDetector, Estimate
from lathe_chatter.detection.speed_adviser import (
    SPEEDS,
    AdviceRequest,
    Identified,
    SpeedAdviser,
)
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import Cut, Machine, Mode
from lathe_chatter.samples import SAMPLE_COLUMNS
from lathe_chatter.stability import critical_depth, rightmost_root

_RANGE = (1000.0, 12000.0)
_SHOP = Machine(
    Mode(1.2, 2.0 * math.pi * 140.0, 0.04), Mode(8.0, 2.0 * math.pi * 95.0, 0.03), 0.0,
    cutting_coefficient=1.2e9,
)  # fmt: skip
_OPEN = {'bearing_contact': 'none', 'force_noise': 4.5e-4, 'sensor_noise': 1e-7}


def _watch(detector: ChatterDetector, lathe: VirtualLathe, duration: float) -> list[Estimate]:
    blocks = round(duration * lathe.sample_rate / 100)
    return [detector.update(lathe.advance(100), SAMPLE_COLUMNS) for _ in range(blocks)]


def _growth(machine: Machine, rpm: float, depth: float) -> float:
    return rightmost_root(machine, rpm, depth, seated=False).real


@pytest.mark.parametrize('seed', [4, 5, 6, 8, 9])
def test_a_speed_comes_from_the_cut_before_the_tool_left_it(seed: int) -> None:
    machine = random_machine(np.random.default_rng(seed))
    rpm = 5000.0
    limit = critical_depth(machine, rpm, seated=False)
    quiet, deep = 0.5 * limit, 1.6 * limit
    cut = Cut(spindle_speed_rpm=rpm, depth_of_cut=quiet, **_OPEN)
    lathe = VirtualLathe(machine, cut, seed=seed)
    detector = ChatterDetector(machine, speed_range=_RANGE)
    assert not any(estimate.chatter for estimate in _watch(detector, lathe, 1.5))
    lathe.retune(lathe.cut.with_changes(depth_of_cut=deep))
    last = _watch(detector, lathe, 2.0)[-1]
    # The tool leaves the cut by now, and what is told of the cut is that of one less deep ...
    assert last.cutting_stiffness < 0.9 * machine.cutting_coefficient * deep
    # ... but the recommended speed suits the depth that there is.
    assert math.isfinite(last.recommended_speed_rpm)
    assert _growth(machine, last.recommended_speed_rpm, deep) < 0.0


def test_advice_is_looked_for_when_it_is_asked_for_and_once() -> None:
    lathe = VirtualLathe(cut=Cut(spindle_speed_rpm=3000.0, depth_of_cut=1.1e-3, **_OPEN))
    detector = ChatterDetector(speed_range=_RANGE)
    seen = [each for each in _watch(detector, lathe, 1.5) if each.request is not None]
    last, before = seen[-1], seen[-2]
    assert last.request is before.request
    assert 'answer' not in vars(last.request)
    assert before.advice.speeds
    assert last.advice is before.advice


def test_after_a_speed_that_was_no_cure_another_is_recommended() -> None:
    depth, worse = 1.1e-3, 4300.0
    assert _growth(Machine(), worse, depth) > 0.0
    lathe = VirtualLathe(cut=Cut(spindle_speed_rpm=3000.0, depth_of_cut=depth, **_OPEN))
    detector = ChatterDetector(speed_range=_RANGE)
    before = _watch(detector, lathe, 1.5)[-1]
    lathe.retune(lathe.cut.with_changes(spindle_speed_rpm=worse))
    after = _watch(detector, lathe, 1.5)[-1]
    assert after.chatter
    assert after.recommended_speed_rpm != before.recommended_speed_rpm
    assert _growth(Machine(), after.recommended_speed_rpm, depth) < 0.0


def test_after_a_speed_that_was_no_cure_it_is_said_that_the_advice_stands() -> None:
    lathe = VirtualLathe(cut=Cut(spindle_speed_rpm=3000.0, depth_of_cut=1.1e-3, **_OPEN))
    detector = ChatterDetector(speed_range=_RANGE)
    heard: list[str] = []
    said = Advice()
    for speed in (3000.0, 3200.0):  # the second is no cure, and as near to the same one
        lathe.retune(lathe.cut.with_changes(spindle_speed_rpm=speed))
        for estimate in _watch(detector, lathe, 2.0):
            words = estimate.advice.after(said) if estimate.chatter else ''
            if words:
                heard.append(f'at {speed:.0f}: {words}')
                said = estimate.advice
    assert [words for words in heard if 'at 3200' in words] == [heard[-1]]
    assert heard[-1].startswith('at 3200: the advice stands: try ')
    assert not any('stands' in words for words in heard[:-1])


def test_nothing_is_recommended_while_the_chatter_dies_down() -> None:
    depth = 1.1e-3
    lathe = VirtualLathe(cut=Cut(spindle_speed_rpm=3000.0, depth_of_cut=depth, **_OPEN))
    detector = ChatterDetector(speed_range=_RANGE)
    cure = _watch(detector, lathe, 1.5)[-1].recommended_speed_rpm
    assert _growth(Machine(), cure, depth) < 0.0
    lathe.retune(lathe.cut.with_changes(spindle_speed_rpm=cure))
    seen = _watch(detector, lathe, 2.0)
    assert not seen[-1].chatter
    dying = [estimate for estimate in seen if estimate.chatter][40:]
    assert not any(estimate.advice.speeds for estimate in dying)


def test_advice_is_for_the_depth_that_is_told_amid_chatter() -> None:
    depth, deeper = 0.8e-3, 1.6e-3
    lathe = VirtualLathe(cut=Cut(spindle_speed_rpm=3000.0, depth_of_cut=depth, **_OPEN))
    detector = ChatterDetector(speed_range=_RANGE)
    before = _watch(detector, lathe, 2.0)[-1].recommended_speed_rpm
    assert _growth(Machine(), before, depth) < 0.0 < _growth(Machine(), before, deeper)
    lathe.retune(lathe.cut.with_changes(depth_of_cut=deeper))
    detector.follow_depth(depth)
    detector.follow_depth(deeper)
    for estimate in _watch(detector, lathe, 2.0):
        assert estimate.chatter
        advice = estimate.advice
        if advice.speeds:
            assert _growth(Machine(), advice.speeds[0].spindle_speed_rpm, deeper) < 0.0
        else:
            limited = deeper * advice.depth_factor
            assert _growth(Machine(), advice.depth_speed_rpm, limited) < 0.0
    lathe.retune(lathe.cut.with_changes(depth_of_cut=depth))
    detector.follow_depth(math.nan)
    assert all(each.request is None for each in _watch(detector, lathe, 0.5))


def _amid_chatter(seed: int) -> VirtualLathe:
    """A lathe whose tool leaves the cut for long: 80 % of C w is heard."""
    cut = Cut(
        spindle_speed_rpm=1200.0, depth_of_cut=0.12e-3, feed_per_revolution=1e-4, force_noise=0.05
    )
    lathe = VirtualLathe(_SHOP, cut, seed=seed)
    lathe.advance(round(20.0 * lathe.sample_rate))
    return lathe


@pytest.mark.parametrize('told', ['before', 'after', 'too little', 'never'])
def test_advice_for_chatter_that_grew_before_is_for_the_depth_that_is_told(told: str) -> None:
    lathe, depth = _amid_chatter(1), 0.12e-3
    detector = ChatterDetector(_SHOP, speed_range=(200.0, 3500.0))
    if told in {'before', 'too little'}:
        detector.follow_depth(depth if told == 'before' else 0.5 * depth)
    first = next(each for each in _watch(detector, lathe, 2.0) if each.request is not None)
    if told == 'after':
        detector.follow_depth(depth)
    last = _watch(detector, lathe, 2.0)[-1]
    assert last.cutting_stiffness < 0.85 * _SHOP.cutting_stiffness(depth)
    best, words = last.advice.speeds[0], last.advice.in_words()
    true = _growth(_SHOP, best.spindle_speed_rpm, depth)
    if told in {'before', 'after'}:
        assert best.growth_rate == pytest.approx(true, abs=0.1)
        assert 'at best' not in words
        assert bool(last.advice.after(first.advice)) is (told == 'after')
    else:
        assert best.growth_rate < true - 5.0
        assert words.endswith(', at best: grown chatter hides part of the force)')


def test_a_depth_that_is_told_does_not_outweigh_what_is_heard_of_an_onset() -> None:
    """C may be told wrong, and of chatter that is heard as it begins nothing is hidden."""
    lathe = VirtualLathe(cut=Cut(spindle_speed_rpm=3000.0, depth_of_cut=0.4e-3, **_OPEN))
    detector = ChatterDetector(speed_range=_RANGE)
    detector.follow_depth(4e-3)
    assert not any(estimate.chatter for estimate in _watch(detector, lathe, 3.0))
    lathe.retune(lathe.cut.with_changes(depth_of_cut=0.8e-3))
    last = _watch(detector, lathe, 2.0)[-1]
    assert last.request is not None
    assert last.request.known.cutting_stiffness == pytest.approx(
        Machine().cutting_stiffness(0.8e-3), rel=0.1
    )
    assert 'at best' not in last.advice.in_words()


@pytest.mark.parametrize('after', [0.3, 3.0])
def test_a_machine_that_is_told_amid_chatter_gives_advice_in_place_of_the_rule(
    after: float,
) -> None:
    # So it is where the monitor takes the machine from a lathe that is slow to answer.
    cut = Cut(spindle_speed_rpm=3000.0, depth_of_cut=0.5e-3, **_OPEN)
    lathe = VirtualLathe(cut=cut)
    detector = ChatterDetector(None, speed_range=_RANGE)
    _watch(detector, lathe, 0.5)
    lathe.retune(cut.with_changes(depth_of_cut=0.8e-3))
    while not _watch(detector, lathe, 0.01)[-1].chatter:
        assert lathe.time < 10.0
    _watch(detector, lathe, after)
    detector.set_machine(Machine())
    seen = _watch(detector, lathe, 2.0)
    assert all(estimate.chatter for estimate in seen)
    assert all(math.isfinite(estimate.recommended_speed_rpm) for estimate in seen)
    best = seen[-1].advice.speeds[0]
    assert math.isnan(best.probability)  # no rule of thumb any more
    assert _growth(Machine(), best.spindle_speed_rpm, 0.8e-3) < 0.0


def test_a_range_of_speeds_that_is_told_amid_chatter_holds_at_once() -> None:
    lathe = VirtualLathe(cut=Cut(spindle_speed_rpm=3000.0, depth_of_cut=0.8e-3, **_OPEN))
    detector = ChatterDetector(None)
    while not _watch(detector, lathe, 0.01)[-1].recommended_speed_rpm > 3000.0:
        assert lathe.time < 10.0
    detector.set_machine(None, (1000.0, 3000.0))
    seen = _watch(detector, lathe, 0.5)
    speeds = [estimate.recommended_speed_rpm for estimate in seen]
    assert any(speed > 0.0 for speed in speeds)
    assert not any(speed > 3000.0 for speed in speeds)


@pytest.mark.parametrize(
    ('hertz', 'rpm', 'speeds', 'words'),
    [
        (326.0, 900.0, SPEEDS, 'no stable speed is known'),
        (326.0, 900.0, (60.0, 3000.0), 'no stable speed is known'),
        (326.0, 900.0, (60.0, 12000.0), 'try 9780 rev/min'),
        (326.0, 10000.0, SPEEDS, 'try 19560 rev/min'),
        (130.0, 3000.0, SPEEDS, 'try 3900 rev/min'),
        (130.0, math.nan, SPEEDS, ''),
    ],
)
def test_the_rule_of_thumb_stays_in_reach_of_a_spindle_of_which_nothing_is_known(
    hertz: float, rpm: float, speeds: tuple[float, float], words: str
) -> None:
    known = Identified(4.0, 0.1, hertz, rpm, math.nan, math.nan)
    said = AdviceRequest(known, None, speeds).answer.in_words()
    assert said.startswith(words)
    assert bool(said) is bool(words)


def test_advice_keeps_to_what_it_said_unless_another_speed_is_clearly_better() -> None:
    """At nearly one depth two lobes are as good; found anew, each would be recommended in turn."""
    turn = 2.0 * math.pi
    shop = Machine(
        Mode(2.0, turn * 300.0, 0.03), Mode(20.0, turn * 120.0, 0.03), 0.0,
        cutting_coefficient=1.5e9,
    )  # fmt: skip
    adviser = SpeedAdviser(shop, (200.0, 4000.0))
    said, alone = [], []
    for hop, depth in enumerate([0.35e-3, 0.37e-3, 0.35e-3, 0.37e-3, 0.46e-3]):
        error = 1.0 - 0.1 * hop
        known = Identified(3.0, error, 313.0, 1200.0, 1.5e9 * depth, shop.workpiece.stiffness)
        adviser.consider(known, hop, modelled=True)
        assert adviser.request is not None
        said.append(adviser.request.answer.speeds[0].spindle_speed_rpm)
        fresh = AdviceRequest(known, shop, (200.0, 4000.0))
        alone.append(fresh.answer.speeds[0].spindle_speed_rpm)
        assert _growth(shop, said[-1], depth) < 0.0
    near, better = alone[0], alone[-1]
    assert better > 1.1 * near
    assert [each > 1.1 * near for each in alone] == [False, True, False, True, True]
    assert [each > 1.1 * near for each in said] == [False, False, False, False, True]


def test_however_often_the_depth_changes_one_answer_is_found_for_the_last() -> None:
    lathe = VirtualLathe(cut=Cut(spindle_speed_rpm=3000.0, depth_of_cut=1.1e-3, **_OPEN))
    detector = ChatterDetector(speed_range=_RANGE)
    detector.follow_depth(1.1e-3)
    request = _watch(detector, lathe, 1.5)[-1].request
    assert request is not None
    for k in range(2000):
        detector.follow_depth(1.0001 ** (k + 1) * 1.1e-3)
    last = _watch(detector, lathe, 0.01)[-1]
    assert last.request is not None
    assert last.request.earlier is request
    assert last.request.known.cutting_stiffness == pytest.approx(
        1.0001**2000 * request.known.cutting_stiffness
    )
    assert last.advice.speeds


def test_where_nobody_says_what_the_spindle_can_a_speed_within_reach_is_recommended() -> None:
    """The chatter of the teacher: far above 20,000 rev/min a lobe is better damped."""
    machine, cut = Machine(), Machine().cutting_stiffness(1.5e-3)
    known = Identified(5.0, 1.0, 120.0, 3536.0, cut, machine.workpiece.stiffness)
    anything = AdviceRequest(known, machine, SPEEDS).answer.speeds[0].spindle_speed_rpm
    assert anything <= 2.0 * 3536.0
    told = AdviceRequest(known, machine, (60.0, 29_000.0)).answer.speeds[0].spindle_speed_rpm
    assert told > 20_000.0


def test_another_run_has_nothing_of_what_was_advised_in_the_one_before() -> None:
    unsure = Identified(0.5, 1.0, 120.0, 3000.0, 5250.0, 1.5e4)
    adviser = SpeedAdviser(Machine(), SPEEDS)
    adviser.consider(Identified(5.0, 1.0, 120.0, 2000.0, 5250.0, 1.5e4), 0, modelled=True)
    adviser.end()
    adviser.consider(unsure, 0, modelled=True)
    assert adviser.request is None  # 3000 rev/min may yet be the cure
    adviser.forget()
    adviser.consider(unsure, 0, modelled=True)
    assert adviser.request is not None


@pytest.mark.parametrize(
    ('growth', 'newer', 'grown', 'hop', 'stands'),
    [
        (1.5, -12.5, False, 2, False),
        (1.5, -3.0, False, 2, True),  # not surely stable
        (15.0, -12.5, False, 2, True),  # it surely grew, and is too large for C w to be heard now
        (1.5, -12.5, True, 2, True),  # likewise
        (1.5, -12.5, False, 40, True),
    ],
)
def test_nothing_is_recommended_for_a_cut_that_is_found_surely_stable(
    growth: float, newer: float, grown: bool, hop: int, stands: bool
) -> None:
    """A false alarm comes of a short look: 5.4 1/s is its standard error, a moment later 2.1."""
    known = Identified(growth, 5.4, 137.5, 2795.0, 2.1e5, _SHOP.workpiece.stiffness, 3e4, grown)
    adviser = SpeedAdviser(_SHOP, (200.0, 3500.0))
    adviser.consider(known, 0, modelled=True)
    assert adviser.request is not None
    adviser.doubt(newer, 2.1, hop)
    assert (adviser.request is not None) is stands
