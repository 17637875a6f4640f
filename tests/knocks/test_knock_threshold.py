"""The smallest lasting knock: from both sides, at other sample rates, and where there is none."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lathe_chatter.errors import ParameterError
from lathe_chatter.knocks import Margin, resting_state, smallest_lasting_knock
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import BearingContact, Cut, Machine
from lathe_chatter.stability import critical_depth, seating_depth

MACHINE = Machine()
CONDITIONAL = Cut(3000.0, 0.65e-3, 10e-6)


def _lasts(cut: Cut, impulse: float) -> bool:
    """By another rule than the package's: after 15 s, at four times the sample rate."""
    rate = 4e4
    lathe = VirtualLathe(MACHINE, cut, sample_rate=rate, initial_state=resting_state(MACHINE, cut))
    lathe.knock(impulse)
    lathe.advance(round(14.0 * rate))
    return bool(np.ptp(lathe.advance(round(rate))[:, 2]) > 1e-6)


def test_the_threshold_holds_from_both_sides() -> None:
    limit = smallest_lasting_knock(MACHINE, CONDITIONAL, tolerance=0.003)
    assert limit.margin is Margin.FINITE
    assert limit.linear < limit.survived < abs(limit.impulse) <= 1.004 * limit.survived
    sign = math.copysign(1.0, limit.impulse)
    assert _lasts(CONDITIONAL, limit.impulse)
    for share in (1.0, 0.8, 0.6):
        assert not _lasts(CONDITIONAL, sign * share * limit.survived)
        assert not _lasts(CONDITIONAL, -sign * share * limit.survived)


def test_the_margin_shrinks_to_nothing_as_the_clearance_closes() -> None:
    """To the clearance that the mean force closes, k_wp gamma = C w f, the margin goes to 0."""
    force = MACHINE.cutting_stiffness(CONDITIONAL.depth_of_cut) * CONDITIONAL.feed
    closed = force / MACHINE.workpiece.stiffness
    margins = []
    for beyond in (1.01, 1.3, 1.9):
        cut = CONDITIONAL.with_changes(bearing_clearance=beyond * closed)
        limit = smallest_lasting_knock(MACHINE, cut, tolerance=0.1)
        assert limit.margin is Margin.FINITE
        margins.append(abs(limit.impulse))
    assert margins == sorted(margins)
    assert margins[0] < 0.05 * margins[-1]
    at_rest = CONDITIONAL.with_changes(bearing_clearance=0.99 * closed)
    assert smallest_lasting_knock(MACHINE, at_rest).margin is Margin.UNSTABLE


@pytest.mark.parametrize('rpm', [2800.0, 4400.0, 10000.0])
@pytest.mark.parametrize('clearance', [2e-6, 10e-6])
def test_below_the_seated_limit_no_knock_lasts(rpm: float, clearance: float) -> None:
    """There the machine is stable open and on its bearing alike."""
    depth = 0.9 * critical_depth(MACHINE, rpm, seated=True)
    limit = smallest_lasting_knock(MACHINE, Cut(rpm, depth, clearance), step=1.5)
    assert limit.margin is Margin.NONE_FOUND
    assert math.isnan(limit.impulse)
    assert limit.survived >= 30.0 * limit.linear / 1.5


def test_without_a_clearance_no_knock_lasts_up_to_the_limit() -> None:
    depth = 0.97 * critical_depth(MACHINE, 3000.0, seated=False)
    cut = Cut(3000.0, depth, bearing_contact=BearingContact.NONE)
    assert smallest_lasting_knock(MACHINE, cut, step=1.5).margin is Margin.NONE_FOUND


def test_an_unstable_cut_needs_no_knock_and_no_cut_takes_any() -> None:
    clearance = 1e-6
    line = seating_depth(MACHINE, clearance, Cut().feed)
    assert line < 0.5e-3  # so the workpiece rests on its bearing, whose limit is 0.467 mm
    unstable = smallest_lasting_knock(MACHINE, Cut(3000.0, 0.5e-3, clearance))
    assert unstable.margin is Margin.UNSTABLE
    assert unstable.impulse == 0.0
    idle = smallest_lasting_knock(MACHINE, Cut(3000.0, 0.0))
    assert idle.margin is Margin.NONE_FOUND


@pytest.mark.parametrize(
    'name', ['force_noise', 'runout', 'tool_runout', 'speed_variation_amplitude']
)
def test_a_disturbed_cut_is_refused(name: str) -> None:
    with pytest.raises(ParameterError, match=name):
        smallest_lasting_knock(MACHINE, Cut(**{name: 1e-3}))
