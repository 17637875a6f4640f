"""What becomes of vibration by a move, beside roots and knocks that last."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from lathe_chatter.knocks import Margin, smallest_lasting_knock
from lathe_chatter.model import BearingContact, Cut, Machine
from lathe_chatter.stability import contact_at, critical_depth, rightmost_root
from lathe_chatter.supervisor.rehearsal import dies

MACHINE = Machine()
CHATTERS = Cut(depth_of_cut=1e-3, bearing_contact=BearingContact.NONE)


def rehearsed(cut: Cut, new: Cut, amplitude: float = 2e-5, **options: Any) -> bool:
    """On the paper's machine, by its own spindle."""
    at = new.spindle_speed_rpm, new.depth_of_cut
    growth = rightmost_root(MACHINE, *at, seated=contact_at(MACHINE, new).seated).real
    given = {'ramp': 5000.0, 'amplitude_limit': 1e-3, **options}
    return dies(MACHINE, cut, new, growth_rate=growth, amplitude=amplitude, **given)


@pytest.mark.parametrize(('part', 'died'), [(0.9, True), (1.1, False)])
def test_without_a_clearance_vibration_dies_below_the_limit(part: float, died: bool) -> None:
    limit = critical_depth(MACHINE, CHATTERS.spindle_speed_rpm, seated=False)
    new = CHATTERS.with_changes(depth_of_cut=part * limit)
    assert rehearsed(CHATTERS, new) is died


def test_across_a_clearance_large_vibration_lasts_where_a_small_one_dies() -> None:
    new = Cut(depth_of_cut=6e-4, bearing_clearance=1.2e-5, feed_per_revolution=1e-4)
    assert smallest_lasting_knock(MACHINE, new).margin is Margin.FINITE
    assert not rehearsed(new.with_changes(depth_of_cut=1e-3), new)
    assert rehearsed(new, new, 1e-7)


def test_a_way_that_leads_beyond_the_limit_of_the_amplitude_is_none() -> None:
    stable = CHATTERS.with_changes(spindle_speed_rpm=3700.0)
    assert rehearsed(CHATTERS, stable)
    assert rehearsed(CHATTERS, stable, amplitude_limit=1e-4)
    assert not rehearsed(CHATTERS, stable, amplitude_limit=1e-5)


def test_a_ramp_of_hours_is_not_waited_for() -> None:
    far = CHATTERS.with_changes(spindle_speed_rpm=10_000.0, depth_of_cut=1e-4)
    assert rehearsed(CHATTERS, far, ramp=1.0)


@pytest.mark.parametrize('scale', [0.05, 20.0])
def test_other_machines_are_rehearsed_at_their_own_pace(scale: float) -> None:
    """All times are in periods of the machine: so is what becomes of vibration."""
    tool, workpiece = (
        replace(body.modes[0], natural_frequency=scale * body.modes[0].natural_frequency)
        for body in (MACHINE.tool, MACHINE.workpiece)
    )
    machine = replace(
        MACHINE, tool=tool, workpiece=workpiece,
        cutting_coefficient=scale**2 * MACHINE.cutting_coefficient,
    )  # fmt: skip
    cut = CHATTERS.with_changes(
        spindle_speed_rpm=scale * CHATTERS.spindle_speed_rpm,
        feed_speed=scale * CHATTERS.feed_speed,
    )
    limit = critical_depth(machine, cut.spindle_speed_rpm, seated=False)
    for part, died in ((0.8, True), (1.2, False)):
        new = cut.with_changes(depth_of_cut=part * limit)
        growth = rightmost_root(
            machine, new.spindle_speed_rpm, new.depth_of_cut, seated=False
        ).real
        done = dies(
            machine, cut, new, growth_rate=growth, ramp=5000.0, amplitude=2e-5, amplitude_limit=1.0
        )
        assert done is died
