"""Free vibration of a stable cut without noise is no chatter, however slowly it dies down."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lathe_chatter.detection import ChatterDetector, Estimate
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import Cut, Machine, Mode
from lathe_chatter.model.machine import RIGID
from lathe_chatter.stability import critical_depth, rightmost_root

_TURN = 2.0 * math.pi
_SHOP = Machine(
    Mode(2.0, _TURN * 300.0, 0.03), Mode(20.0, _TURN * 120.0, 0.03), cutting_coefficient=1.5e9
)
_SMALL = Machine(
    Mode(0.05, _TURN * 1000.0, 0.02), Mode(2.0, _TURN * 300.0, 0.03), cutting_coefficient=1.5e9
)
_CUTS = [
    (_SHOP, 4000.0, 0.3e-3),
    (_SHOP, 900.0, 0.0),
    (_SMALL, 6000.0, 0.0),
    (Machine(), 3000.0, 0.0),
    (Machine(), 10000.0, 0.0),
]
_ONE_BODY = Machine(Mode(1.9, _TURN * 730.0, 0.03), RIGID, cutting_coefficient=2e9)


@pytest.mark.parametrize('told', ['machine', 'nothing', 'no angle'])
@pytest.mark.parametrize(('machine', 'rpm', 'depth'), _CUTS)
def test_the_initial_motion_of_a_stable_cut_is_not_flagged(
    machine: Machine, rpm: float, depth: float, told: str
) -> None:
    found = _heard(machine, rpm, depth or 0.95 * _limit(machine, rpm), told)
    assert not any(each.chatter for each in found)


def test_where_it_beats_the_machine_knows_that_it_dies_down() -> None:
    """Just inside the limit, where two roots a few Hz apart both die down slowly."""
    rpm = 2325.0
    found = _heard(_ONE_BODY, rpm, 0.99 * _limit(_ONE_BODY, rpm), 'machine')
    assert not any(each.chatter for each in found)


@pytest.mark.parametrize('seed', [3, 5])
def test_what_has_died_down_to_noise_after_a_change_of_depth_is_not_flagged(seed: int) -> None:
    """In all but no noise: some nm that moved after 0.4 s were flagged by their growth alone."""
    rng, limit = np.random.default_rng(seed), _limit(Machine(), 3000.0)
    cut = Cut(
        spindle_speed_rpm=3000.0, depth_of_cut=4e-4, bearing_contact='none', feed_speed=5e-3,
        force_noise=1.4e-7, sensor_noise=1e-9, runout=5e-6, tool_runout=rng.uniform(0.0, 5e-6),
    )  # fmt: skip
    lathe, detector = VirtualLathe(cut=cut, seed=seed), ChatterDetector()
    for step in range(13):
        for _ in range(20):
            known = detector.update(lathe.advance(1000), lathe.columns)
            assert step < 2 or not known.chatter
        detector.update(lathe.advance(int(rng.integers(1, 101))), lathe.columns)
        lathe.retune(cut.with_changes(depth_of_cut=rng.uniform(3e-4, 0.95 * limit)))


def _limit(machine: Machine, rpm: float) -> float:
    return float(critical_depth(machine, rpm, seated=False))


def _heard(machine: Machine, rpm: float, depth: float, told: str) -> list[Estimate]:
    """6 s from the initial motion on."""
    assert -6.0 < rightmost_root(machine, rpm, depth, seated=False).real < 0.0
    cut = Cut(
        spindle_speed_rpm=rpm, depth_of_cut=depth, bearing_contact='none',
        feed_per_revolution=2e-4, feed_speed=2e-4 * rpm / 60.0,
    )  # fmt: skip
    lathe = VirtualLathe(machine, cut=cut)
    detector = ChatterDetector(machine if told == 'machine' else None)
    skipped = 'spindle_angle' if told == 'no angle' else ''
    kept = [name for name in lathe.columns if name != skipped]
    places = [lathe.columns.index(name) for name in kept]
    return [detector.update(lathe.advance(200)[:, places], kept) for _ in range(300)]
