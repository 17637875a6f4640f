"""What a knock does: rest, the linear reach, and the outcomes that are known from elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

from lathe_chatter.errors import ParameterError
from lathe_chatter.knocks import follow_knock, linear_reach, resting_state
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import BearingContact, Cut, Machine

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


def test_without_a_feed_there_is_nothing_to_thin() -> None:
    with pytest.raises(ParameterError, match='feed_speed is 0'):
        linear_reach(MACHINE, Cut(feed_speed=0.0))
