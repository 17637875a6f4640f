"""The moves that are looked for, against the roots of the machine and of others than it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.machines import random_machine

from lathe_chatter.errors import ParameterError
from lathe_chatter.model import BearingContact, Cut, Machine
from lathe_chatter.stability import critical_depth, floquet, leading_roots
from lathe_chatter.supervisor import Limits, moves_for
from lathe_chatter.supervisor.moves import heard, removal_rate

MACHINE = Machine()
DEEP = Cut(depth_of_cut=1e-3, bearing_contact=BearingContact.NONE)
NARROW = Limits(2990.0, 3010.0)
"""rev/min, in which no speed is stable at that depth."""


def growth(machine: Machine, cut: Cut, *, seated: bool = False) -> float:
    """By another way than the one that the moves are found by."""
    at = cut.spindle_speed_rpm, cut.depth_of_cut
    return max(root.real for root in leading_roots(machine, *at, seated=seated, count=1))


@pytest.mark.parametrize('seed', range(12))
def test_every_speed_is_stable_with_a_reserve_and_within_the_limits(seed: int) -> None:
    rng = np.random.default_rng(seed)
    machine, limits = random_machine(rng), Limits(2000.0, 9000.0)
    rpm = float(rng.uniform(2500.0, 8000.0))
    depth = 1.3 * critical_depth(machine, rpm, seated=False)
    cut = DEEP.with_changes(spindle_speed_rpm=rpm, depth_of_cut=depth)
    moves = moves_for(machine, cut, limits)
    assert moves
    for move in moves:
        new = move.cut
        assert 2000.0 <= new.spindle_speed_rpm <= 9000.0
        assert new.depth_of_cut <= depth
        assert move.kept == pytest.approx(min(removal_rate(new) / removal_rate(cut), 1.0))
        if not new.speed_variation_amplitude:
            assert growth(machine, new) == pytest.approx(move.growth_rate, abs=1e-6)
            deeper = new.with_changes(depth_of_cut=1.03 * new.depth_of_cut)
            assert growth(machine, deeper) < 0.0
    assert [move.worth for move in moves] == sorted((m.worth for m in moves), reverse=True)


def test_across_a_clearance_a_move_suits_floating_and_seated() -> None:
    cut = Cut(depth_of_cut=6.2e-4)
    best = moves_for(MACHINE, cut, Limits())[0]
    assert best.kept == pytest.approx(1.0)
    assert all(growth(MACHINE, best.cut, seated=seated) < 0.0 for seated in (False, True))


def test_where_no_speed_helps_the_depth_is_reduced_no_more_than_needed() -> None:
    (best, *_) = moves_for(MACHINE, DEEP, replace(NARROW, largest_variation=0.0))
    limit = critical_depth(MACHINE, best.cut.spindle_speed_rpm, seated=False)
    assert 0.75 * limit < best.cut.depth_of_cut < 0.9 * limit
    assert best.margin == pytest.approx(limit / best.cut.depth_of_cut - 1.0)


def test_no_depth_below_the_smallest() -> None:
    limits = replace(NARROW, smallest_depth=0.9e-3, largest_variation=0.0)
    assert not moves_for(MACHINE, DEEP, limits)


def test_where_no_constant_speed_helps_it_is_varied_as_far_as_the_spindle_can() -> None:
    cut = DEEP.with_changes(spindle_speed_rpm=2000.0)
    limits = Limits(1580.0, 2420.0, ramp=40e3, smallest_depth=DEEP.depth_of_cut)
    moves = [m for m in moves_for(MACHINE, cut, limits) if m.cut.speed_variation_amplitude]
    assert moves
    for move in moves:
        new = move.cut
        swing = new.speed_variation_amplitude * new.spindle_speed_rpm
        assert 2.0 * np.pi * new.speed_variation_frequency * swing <= 40e3 * 1.001
        assert floquet(MACHINE, new, seated=False).growth_rate < -1.0


def test_a_way_on_which_the_vibration_would_grow_beyond_its_limit_is_not_gone() -> None:
    near = moves_for(MACHINE, DEEP, Limits(), amplitude=1e-6)[0]
    assert near.kept == pytest.approx(1.0)
    slow = Limits(near.cut.spindle_speed_rpm - 1.0, 12000.0, ramp=100.0, largest_variation=0.0)
    assert any(move.kept > 0.99 for move in moves_for(MACHINE, DEEP, slow))
    for move in moves_for(MACHINE, DEEP, slow, amplitude=1e-4):
        assert move.cut.depth_of_cut < DEEP.depth_of_cut


def test_the_c_that_is_heard_counts_where_it_is_greater() -> None:
    told = MACHINE.cutting_stiffness(1e-3)
    for stiffness, factor in ((1.2, 1.2), (0.8, 1.0), (50.0, 1.0), (np.nan, 1.0), (np.inf, 1.0)):
        found = heard(MACHINE, DEEP, stiffness * told)
        assert found.cutting_stiffness(1e-3) == pytest.approx(factor * told)


def test_nothing_is_cut_so_nothing_moves() -> None:
    assert not moves_for(MACHINE, DEEP.with_changes(depth_of_cut=0.0), Limits())


def test_a_range_without_a_speed_is_refused() -> None:
    with pytest.raises(ParameterError, match='fastest_speed'):
        Limits(5000.0, 5000.0)
