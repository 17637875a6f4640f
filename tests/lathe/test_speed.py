"""The delay while the spindle speed changes, against the machine solved over spindle angle."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

import numpy as np
import pytest
from support.reference import by_angle

from lathe_chatter.array_types import Array
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import BearingContact, Cut, Machine

_CUT = Cut(3000.0, 0.5e-3, bearing_contact=BearingContact.NONE)
_START = np.array([1e-6, 0.0025, -1e-6, 0.001])
_LAWS = pytest.mark.parametrize('law', ['linear', 'total'])


def _error(samples: Array, past: by_angle.Past) -> float:
    """Largest error of a displacement over the largest displacement, at the same angles.

    The time at an angle must be the same too, within rounding.
    """
    reference = np.array([past.at(angle) for angle in samples[:, 1]])
    assert np.abs(reference[:, 4] - samples[:, 0]).max() < 1e-13
    difference = np.abs(samples[:, [2, 4]] - reference[:, [0, 2]])
    return float(difference.max() / np.abs(reference[:, [0, 2]]).max())


def _advance(lathe: VirtualLathe, parts: Iterable[tuple[int, float | None]]) -> Array:
    """Each part: samples to take, and the speed to change to after them."""
    blocks = []
    for count, rpm in parts:
        blocks.append(lathe.advance(count))
        assert not lathe.events
        if rpm is not None:
            lathe.retune(lathe.cut.with_changes(spindle_speed_rpm=rpm))
    return np.concatenate(blocks)


def _constant(speed: float) -> Callable[[float], float]:
    return lambda _: speed


@_LAWS
@pytest.mark.parametrize(
    ('amplitude', 'frequency'), [(0.1, 3.0), (0.5, 11.0), (0.3, 200.0), (0.5, 1e-3)]
)
def test_sinusoidal_variation(law: str, amplitude: float, frequency: float) -> None:
    cut = _CUT.with_changes(
        speed_variation_amplitude=amplitude, speed_variation_frequency=frequency
    )
    total = law == 'total'
    lathe = VirtualLathe(cut=cut, tool_leaves_cut=total, initial_state=_START, sample_rate=2e4)
    samples = _advance(lathe, [(2400, None)])

    def speed(t: float) -> float:
        return 50.0 * (1.0 + amplitude * math.sin(2.0 * math.pi * frequency * t))

    past = by_angle.solve(
        Machine(), cut, _START, [(0.0, speed)], samples[-1, 1], tool_leaves_cut=total
    )
    assert _error(samples, past) < 1e-8


@_LAWS
@pytest.mark.parametrize('rpm', [2000.0, 7130.0])
def test_a_step_of_speed(law: str, rpm: float) -> None:
    total = law == 'total'
    lathe = VirtualLathe(cut=_CUT, tool_leaves_cut=total, initial_state=_START)
    samples = _advance(lathe, [(413, rpm), (800, None)])
    laws = [(0.0, _constant(50.0)), (50.0 * 0.0413, _constant(rpm / 60.0))]
    past = by_angle.solve(Machine(), _CUT, _START, laws, samples[-1, 1], tool_leaves_cut=total)
    assert _error(samples, past) < 1e-8


@_LAWS
@pytest.mark.parametrize('rpm', [2500.0, 4000.0])
def test_a_ramp_of_speed_ends_where_it_should(law: str, rpm: float) -> None:
    """20000 rev/min per s from 41.3 ms on; its end is no sample."""
    total, begin, rate = law == 'total', 0.0413, math.copysign(20000.0 / 60.0, rpm - 3000.0)
    lathe = VirtualLathe(
        cut=_CUT, tool_leaves_cut=total, initial_state=_START, spindle_acceleration=20000.0
    )
    samples = _advance(lathe, [(413, rpm), (1200, None)])
    length = (rpm / 60.0 - 50.0) / rate
    until = 50.0 * begin + 0.5 * (50.0 + rpm / 60.0) * length
    laws = [
        (0.0, _constant(50.0)),
        (50.0 * begin, lambda t: 50.0 + rate * (t - begin)),
        (until, _constant(rpm / 60.0)),
    ]
    past = by_angle.solve(Machine(), _CUT, _START, laws, samples[-1, 1], tool_leaves_cut=total)
    assert _error(samples, past) < 1e-8


def test_a_seated_bearing_and_a_ramp() -> None:
    cut = _CUT.with_changes(bearing_contact='seated')
    lathe = VirtualLathe(
        cut=cut, tool_leaves_cut=False, initial_state=_START, spindle_acceleration=20000.0
    )
    samples = _advance(lathe, [(413, 9000.0), (800, None)])
    rate = 20000.0 / 60.0
    laws = [(0.0, _constant(50.0)), (50.0 * 0.0413, lambda t: 50.0 + rate * (t - 0.0413))]
    past = by_angle.solve(Machine(), cut, _START, laws, samples[-1, 1], tool_leaves_cut=False)
    assert _error(samples, past) < 1e-8


@pytest.mark.parametrize(
    ('amplitude', 'acceleration'), [(0.0, 0.0), (0.0, 3e4), (0.2, 0.0), (0.2, 3e4)]
)
def test_a_tenth_of_the_step_gives_the_same(amplitude: float, acceleration: float) -> None:
    """With chatter, contact and a tool that leaves the cut, over 0.2 s."""
    cut = Cut(
        3017.0, 0.8e-3, 5e-6, BearingContact.GAP,
        speed_variation_amplitude=amplitude, speed_variation_frequency=7.0,
    )  # fmt: skip
    runs, events = [], []
    for refinement in (1, 10):
        lathe = VirtualLathe(
            cut=cut, sample_rate=1e4 * refinement, spindle_acceleration=acceleration
        )
        blocks = [lathe.advance(700 * refinement)]
        found = len(lathe.events)
        lathe.retune(cut.with_changes(spindle_speed_rpm=4213.0))
        blocks.append(lathe.advance(1300 * refinement))
        runs.append(np.concatenate(blocks)[refinement - 1 :: refinement])
        events.append(found + len(lathe.events))
    coarse, fine = runs
    assert np.abs(coarse[:, 1] - fine[:, 1]).max() < 1e-12
    error = np.abs(coarse[:, 2:5:2] - fine[:, 2:5:2]).max()
    assert error < 1e-8 * np.abs(fine[:, 2:5:2]).max()
    assert events[0] == events[1] > 0


def test_the_angle_is_the_integral_of_speed_over_many_turns() -> None:
    """No drift: after 20 s with variation the angle is still its closed form."""
    cut = Cut(6000.0, 0.0, speed_variation_amplitude=0.4, speed_variation_frequency=2.5)
    samples = VirtualLathe(cut=cut, sample_rate=1000.0).advance(20_000)
    turn = 2.0 * math.pi * 2.5
    exact = 100.0 * (samples[:, 0] + 0.4 / turn * (1.0 - np.cos(turn * samples[:, 0])))
    assert np.abs(samples[:, 1] - exact).max() < 1e-11 * 100.0
