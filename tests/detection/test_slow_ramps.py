"""A slow change of speed is no chatter, and chatter in it is found."""

from __future__ import annotations

import math

import pytest

from lathe_chatter.detection import ChatterDetector, Estimate
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import Cut, Machine, Mode
from lathe_chatter.stability import critical_depth, rightmost_root

_TURN = 2.0 * math.pi
_SHAFT = Machine(
    Mode(1.2, _TURN * 1400.0, 0.03), Mode(6.0, _TURN * 800.0, 0.025), bearing_stiffness=1e8,
    cutting_coefficient=1.8e9,
)  # fmt: skip
_CUTS = {
    'shaft': (_SHAFT, Cut(depth_of_cut=2.5e-3, feed_per_revolution=1e-4, force_noise=0.05), 14e3),
    'paper': (Machine(), Cut(depth_of_cut=3e-4, force_noise=4.5e-4, sensor_noise=1e-7), 1e4),
}


def _ramp(
    name: str,
    way: tuple[float, float],
    rate: float,
    seed: int,
    *,
    told: bool = True,
    **changes: float,
) -> list[Estimate]:
    """4 s at the first speed, rev/min, the way to the other at a rate, rev/min per s, and 2 s."""
    machine, cut, samples = _CUTS[name]
    begin, end = way
    start = cut.with_changes(spindle_speed_rpm=begin, bearing_contact='none', **changes)
    lathe = VirtualLathe(
        machine, cut=start, seed=seed, spindle_acceleration=rate, sample_rate=samples
    )
    detector = ChatterDetector(machine if told else None)
    found, batch = [], round(0.01 * samples)
    for k in range(round(100.0 * (6.0 + abs(end - begin) / rate))):
        if k == 400:
            lathe.retune(lathe.cut.with_changes(spindle_speed_rpm=end))
        found.append(detector.update(lathe.advance(batch), lathe.columns))
    return found


@pytest.mark.parametrize(
    ('name', 'way', 'rate', 'seed'),
    [
        ('shaft', (4400.0, 8400.0), 500.0, 2),
        ('shaft', (4000.0, 8000.0), 500.0, 4),
        ('paper', (3000.0, 4600.0), 200.0, 0),
        ('paper', (3000.0, 4600.0), 200.0, 2),
        ('paper', (3000.0, 4600.0), 200.0, 3),
    ],
)
def test_a_cut_that_is_stable_at_every_speed_of_a_ramp_is_not_flagged(
    name: str, way: tuple[float, float], rate: float, seed: int
) -> None:
    machine, cut, _ = _CUTS[name]
    for part in range(26):
        rpm = way[0] + (way[1] - way[0]) * part / 25
        assert cut.depth_of_cut < critical_depth(machine, rpm, seated=False)
    assert not any(each.chatter for each in _ramp(name, way, rate, seed))


@pytest.mark.parametrize('rate', [50.0, 200.0])
def test_chatter_that_a_slow_ramp_leads_to_is_flagged_in_it(rate: float) -> None:
    """From 3600 rev/min, stable up to 1.5 mm, on the way to 4400, stable up to 0.6 mm."""
    depth = 0.9e-3
    found = _ramp('paper', (3600.0, 4400.0), rate, 0, depth_of_cut=depth)
    first = next(each for each in found if each.chatter)
    root = rightmost_root(Machine(), first.spindle_speed_rpm, depth, seated=False)
    assert root.real > 0.0
    assert first.spindle_speed_rpm < 4350.0
    assert first.growth_rate > 0.0


@pytest.mark.parametrize('told', [True, False])
@pytest.mark.parametrize('depth', [0.3e-3, 0.9e-3])
def test_a_cut_is_not_called_stable_in_a_ramp_that_is_not_judged(depth: float, told: bool) -> None:
    """Nor by those bands whose hops are so short that they take it for none, but where one of
    them is louder for a moment than what chatters."""
    found = _ramp('paper', (3600.0, 4400.0), 500.0, 0, told=told, depth_of_cut=depth)
    assert {each.state for each in found[300:400]} == {'stable'}
    assert [each.state for each in found[420:560]].count('stable') < 8
