"""What a knock does: rest, the linear reach, and the outcomes that are known from elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

from lathe_chatter.errors import ParameterError
from lathe_chatter.knocks import follow_knock, linear_reach, resting_state
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import BearingContact, Cut, Machine, Mode
from lathe_chatter.model.machine_file import load_machine

MACHINE = Machine()
CUTS = [
    Cut(3000.0, 0.65e-3, 10e-6),
    Cut(3000.0, 0.30e-3, 1e-6),  # beyond its seating line: it rests on the bearing
    Cut(8000.0, 0.9e-3, 5e-6, BearingContact.SEATED),
    Cut(3000.0, 0.5e-3, bearing_contact=BearingContact.NONE),
]


@pytest.mark.parametrize('cut', CUTS)
def test_a_cut_at_rest_stays_at_rest(cut: Cut) -> None:
    rest = resting_state(MACHINE, cut)
    lathe = VirtualLathe(MACHINE, cut, initial_state=rest)
    samples = lathe.advance(2000)
    assert np.abs(samples[:, 2:6] - rest).max() < 1e-15
    assert not lathe.events


@pytest.mark.parametrize('cut', CUTS)
@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_the_linear_reach_is_where_the_first_event_comes(cut: Cut, sign: float) -> None:
    """Within what a peak between two samples hides: (omega h)^2 / 8, of 1e-3."""
    reach = dict(zip((1.0, -1.0), linear_reach(MACHINE, cut), strict=True))[sign]
    for share, expected in ((0.997, False), (1.003, True)):
        lathe = VirtualLathe(MACHINE, cut, initial_state=resting_state(MACHINE, cut))
        lathe.knock(sign * share * reach)
        lathe.advance(20_000)
        assert bool(lathe.events) == expected


@pytest.mark.parametrize(('impulse', 'lasts'), [(1e-3, False), (2.5e-3, True), (8e-3, False)])
def test_the_known_chatter_is_met_by_knocks_between_two_others(
    impulse: float, *, lasts: bool
) -> None:
    """41.9 um at the tool, as from other starts: the knocks that last are an island."""
    outcome = follow_knock(MACHINE, CUTS[0], impulse)
    assert outcome.lasts == lasts
    if lasts:
        assert outcome.amplitude == pytest.approx(41.9e-6, abs=0.05e-6)


HEAVY = Machine(Mode(3e3, 314.0, 0.04), Mode(4e4, 138.0, 0.04), 2e9, 2e9)
LIGHT = Machine(Mode(4e-3, 31400.0, 0.02), Mode(9e-3, 20100.0, 0.02), 0.0, 8e8)
SHAFT = load_machine('chucked_shaft')


@pytest.mark.parametrize(
    ('machine', 'cut'),
    [
        (HEAVY, Cut(30.0, 0.011, 2e-4, feed_per_revolution=6e-3)),
        (HEAVY, Cut(30.0, 0.011, 5e-5, feed_per_revolution=6e-3)),
        (LIGHT, Cut(9e4, 1e-4, bearing_contact=BearingContact.NONE, feed_per_revolution=5e-6)),
        (SHAFT.machine, SHAFT.cut),
        (SHAFT.machine, SHAFT.cut.with_changes(bearing_clearance=1e-6)),
    ],
    ids=['heavy', 'heavy, seated', 'light', 'shaft', 'shaft, seated'],
)
def test_machines_of_any_size_and_several_modes_are_knocked_where_they_rest(
    machine: Machine, cut: Cut
) -> None:
    rest = resting_state(machine, cut)
    lathe = VirtualLathe(machine, cut, sample_rate=1e5, initial_state=rest)
    for _ in range(40 if len(machine.workpiece.modes) > 1 else 1):
        samples = lathe.advance(20_000)  # a body of several modes settles, see `resting_state`
    assert samples[-1, 2:6] == pytest.approx(rest, abs=1e-6 * cut.feed)
    settled = lathe.snapshot()
    forward, _ = linear_reach(machine, cut)
    for share, expected in ((0.995, False), (1.005, True)):
        lathe.restore(settled)
        lathe.knock(share * forward)
        lathe.advance(200_000)
        assert bool(lathe.events) == expected
    assert not follow_knock(machine, cut, 0.9 * forward).lasts


def test_a_spindle_that_turns_slowly_is_followed_for_enough_turns() -> None:
    cut = Cut(6.0, 4e-4, bearing_contact=BearingContact.NONE)
    outcome = follow_knock(MACHINE, cut, 1e-3)
    assert not outcome.lasts
    assert outcome.time >= 2 * 5 * cut.delay


def test_without_a_feed_there_is_nothing_to_thin() -> None:
    with pytest.raises(ParameterError, match='feed is 0'):
        linear_reach(MACHINE, Cut(feed_speed=0.0))
