"""The moves that are looked for, against the roots of the machine and of others than it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.machines import random_machine

from lathe_chatter.errors import ParameterError
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import BearingContact, Cut, Machine, Mode
from lathe_chatter.stability import contact_at, critical_depth, floquet, leading_roots
from lathe_chatter.supervisor import Limits
from lathe_chatter.supervisor.likely_machines import may_be
from lathe_chatter.supervisor.move_search import Move, expectation, moves_for, removal_rate

MACHINE = Machine()
DEEP = Cut(depth_of_cut=1e-3, bearing_contact=BearingContact.NONE)
NARROW = Limits(2990.0, 3010.0)
"""rev/min, in which no speed is stable at that depth."""


def moves_of(machine: Machine, cut: Cut, limits: Limits, amplitude: float = 0.0) -> list[Move]:
    """Of a machine that is told well."""
    return list(moves_for(may_be(machine, 0.01), cut, limits, amplitude))


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
    moves = moves_of(machine, cut, limits)
    assert moves
    for move in moves:
        new = move.cut
        assert 2000.0 <= new.spindle_speed_rpm <= 9000.0
        assert new.depth_of_cut <= depth
        assert move.kept == pytest.approx(removal_rate(new) / removal_rate(cut))
        if not new.speed_variation_amplitude:
            assert growth(machine, new) == pytest.approx(move.growth_rate, abs=1e-6)
            deeper = new.with_changes(depth_of_cut=1.02 * new.depth_of_cut)
            assert growth(machine, deeper) < 0.0


def test_across_a_clearance_a_move_suits_floating_and_seated() -> None:
    cut = Cut(depth_of_cut=6.2e-4)
    best = moves_of(MACHINE, cut, Limits())[0]
    assert best.kept == pytest.approx(1.0)
    assert all(growth(MACHINE, best.cut, seated=seated) < 0.0 for seated in (False, True))


def test_where_no_speed_helps_the_depth_is_reduced_no_more_than_needed() -> None:
    (best, *_) = moves_of(MACHINE, DEEP, replace(NARROW, largest_variation=0.0))
    limit = critical_depth(MACHINE, best.cut.spindle_speed_rpm, seated=False)
    assert 0.85 * limit < best.cut.depth_of_cut < 0.97 * limit
    assert best.margin == pytest.approx(limit / best.cut.depth_of_cut - 1.0)


def test_no_depth_below_the_smallest() -> None:
    limits = replace(NARROW, smallest_depth=0.9e-3, largest_variation=0.0)
    assert not moves_of(MACHINE, DEEP, limits)


def test_where_no_constant_speed_helps_it_is_varied_as_far_as_the_spindle_can() -> None:
    cut = DEEP.with_changes(spindle_speed_rpm=2000.0)
    limits = Limits(1580.0, 2420.0, ramp=40e3, smallest_depth=DEEP.depth_of_cut)
    moves = [m for m in moves_of(MACHINE, cut, limits) if m.cut.speed_variation_amplitude]
    assert moves
    for move in moves:
        new = move.cut
        swing = new.speed_variation_amplitude * new.spindle_speed_rpm
        assert 2.0 * np.pi * new.speed_variation_frequency * swing <= 40e3 * 1.001
        assert floquet(MACHINE, new, seated=False).growth_rate < -1.0
        assert (move.tried, move.share) == (8, 1.0)
        assert expectation(move).endswith('stable on 8 of 8 machines that this may be')


def test_what_is_expected_of_a_move_is_said_in_words() -> None:
    move = Move(DEEP, growth_rate=-12.34, margin=0.071, kept=0.93, tried=32, share=20 / 32)
    assert expectation(move) == (
        'predicted: growth -12.3 1/s, margin 7 %, 93 % of the removal rate; '
        'stable on at least 20 of 32 machines that this may be'
    )
    machines = may_be(MACHINE, 0.01)
    sure = moves_of(MACHINE, DEEP, Limits())[0]
    assert (sure.tried, sure.share) == (len(machines), 1.0)
    assert all(growth(machine, sure.cut) < 0.0 for machine in machines)


def test_a_way_on_which_the_vibration_would_grow_beyond_its_limit_is_not_gone() -> None:
    near = moves_of(MACHINE, DEEP, Limits(), amplitude=1e-6)[0]
    assert near.kept == pytest.approx(1.0)
    slow = Limits(near.cut.spindle_speed_rpm - 1.0, 12000.0, ramp=100.0, largest_variation=0.0,
                  amplitude_limit=3e-5)  # fmt: skip
    assert any(move.kept > 0.99 for move in moves_of(MACHINE, DEEP, slow))
    for move in moves_of(MACHINE, DEEP, slow, amplitude=1e-5):
        assert move.cut.depth_of_cut < DEEP.depth_of_cut


ACROSS = Machine(Mode(0.0353, 537.0, 0.033), Mode(0.0714, 633.2, 0.0548), 14300.0, 2.36e6)
CHATTERS_ACROSS = Cut(
    5228.0, 2.27e-3, bearing_clearance=5.6e-6, feed_speed=0.0, feed_per_revolution=7.8e-5
)
"""A clearance that mean force closes and vibration opens."""


def after(machine: Machine, cut: Cut, new: Cut) -> tuple[float, float]:
    """The vibration of the tool in a cut, and 3 s after a ramp to another begins, m."""
    lathe = VirtualLathe(machine, cut, spindle_acceleration=Limits().ramp)
    before = lathe.advance(20_000)[-3000:, 2]
    lathe.retune(new)
    return float(np.std(before)), float(np.std(lathe.advance(30_000)[-3000:, 2]))


def test_across_a_clearance_no_move_is_made_in_which_large_vibration_lasts() -> None:
    cut, limits = CHATTERS_ACROSS, Limits(smallest_depth=0.5 * CHATTERS_ACROSS.depth_of_cut)
    machines = may_be(ACROSS, 0.03)
    (small, *_) = moves_for(machines, cut, limits)
    assert small.growth_rate < -3.0
    before, end = after(ACROSS, cut, small.cut)
    assert end > 0.3 * before
    moves = list(moves_for(machines, cut, limits, amplitude=1.5 * before))
    assert moves
    for move in moves:
        before, end = after(ACROSS, cut, move.cut)
        assert end < 0.1 * before


def test_a_greater_reserve_leaves_the_contact_as_it_is() -> None:
    cut, limits = CHATTERS_ACROSS, Limits(smallest_depth=0.5 * CHATTERS_ACROSS.depth_of_cut)
    machines = may_be(ACROSS, 0.0)
    moves = list(moves_for(machines, cut, limits, reserve=1.25, odd_ones=(0,)))
    assert any(contact_at(ACROSS, move.cut).seated for move in moves)
    for move in moves:
        assert contact_at(ACROSS, move.cut).stable


def off_by(rng: np.random.Generator, machine: Machine, error: float) -> Machine:
    """A machine of which every figure differs."""
    modes = []
    for mode in (machine.tool, machine.workpiece):
        mass, frequency, damping = np.exp(error * rng.standard_normal(3))
        modes.append(
            Mode(mode.mass * mass, mode.natural_frequency * frequency,
                 mode.damping_ratio * damping)
        )  # fmt: skip
    coefficient = machine.cutting_coefficient * np.exp(error * rng.standard_normal())
    return Machine(*modes, machine.bearing_stiffness, coefficient)


@pytest.mark.parametrize('seed', range(4))
def test_a_move_suits_machines_that_differ_from_the_told_one(seed: int) -> None:
    rng = np.random.default_rng([7, seed])
    machine = random_machine(rng)
    depth = 1.3 * critical_depth(machine, 4000.0, seated=False)
    cut = DEEP.with_changes(spindle_speed_rpm=4000.0, depth_of_cut=depth)
    best = next(moves_for(may_be(machine, 0.03), cut, Limits()))
    assert best.share == 1.0
    machines = [off_by(rng, machine, 0.03) for _ in range(40)]
    unstable = sum(growth(each, best.cut) > 0.0 for each in machines)
    assert unstable <= 2


def test_nothing_is_cut_so_nothing_moves() -> None:
    assert not moves_of(MACHINE, DEEP.with_changes(depth_of_cut=0.0), Limits())


def test_a_range_without_a_speed_is_refused() -> None:
    with pytest.raises(ParameterError, match='fastest_speed'):
        Limits(5000.0, 5000.0)
