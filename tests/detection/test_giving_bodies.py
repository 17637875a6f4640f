"""A body that does not give is no mode: chatter of the other one is found as it is."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from lathe_chatter.detection import ChatterDetector, Estimate
from lathe_chatter.detection.estimate import Mode as WorksWith
from lathe_chatter.detection.giving_bodies import identifiable
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import Cut, Machine, Mode
from lathe_chatter.model.machine import RIGID
from lathe_chatter.stability import critical_depth, rightmost_root

_TURN = 2.0 * math.pi
_SECONDS = 10.0
_STIFF_AND_HIGH = Mode(1e10 / (_TURN * 1e3) ** 2, _TURN * 1e3, 0.5)
"""As a user may write a body that hardly gives: 10000 N/um."""


def _mode(hertz: float, stiffness: float) -> Mode:
    return Mode(stiffness / (_TURN * hertz) ** 2, _TURN * hertz, 0.03)


def _heard(
    machine: Machine, rpm: float, share: float, told: Machine | None, *, sensor_noise: float = 0.0
) -> tuple[list[Estimate], complex]:
    """A cut at some share of its critical depth, and its rightmost root."""
    depth = share * critical_depth(machine, rpm, seated=False)
    cut = Cut(
        spindle_speed_rpm=rpm, depth_of_cut=depth, bearing_contact='none', force_noise=0.1,
        feed_per_revolution=2e-4, feed_speed=2e-4 * rpm / 60.0, sensor_noise=sensor_noise,
    )  # fmt: skip
    lathe, detector = VirtualLathe(machine, cut=cut, seed=1), ChatterDetector(told)
    found = [detector.update(lathe.advance(200), lathe.columns) for _ in range(int(50 * _SECONDS))]
    return found, rightmost_root(machine, rpm, depth, seated=False)


@pytest.mark.parametrize(
    ('tool', 'workpiece', 'rpm'),
    [
        (_mode(25.0, 20e6), RIGID, 120.0),
        (_mode(60.0, 10e6), RIGID, 300.0),
        (_mode(100.0, 10e6), RIGID, 400.0),
        (_mode(145.0, 10e6), RIGID, 600.0),
        (_mode(145.0, 10e6), _STIFF_AND_HIGH, 600.0),
        (_mode(300.0, 20e6), RIGID, 900.0),
        (RIGID, _mode(60.0, 10e6), 300.0),
        (RIGID, _mode(120.0, 10e6), 600.0),
    ],
)
def test_chatter_of_one_body_is_flagged_and_its_stable_cut_is_not(
    tool: Mode, workpiece: Mode, rpm: float
) -> None:
    machine = Machine(tool, workpiece, cutting_coefficient=2e9)
    found, root = _heard(machine, rpm, 1.6, machine)
    flag = next(k for k, each in enumerate(found) if each.chatter)
    assert found[flag].time * rpm / 60.0 < 36.0
    later = [each for each in found[flag:] if each.chatter]
    hertz = np.median([each.frequency for each in later])
    assert hertz == pytest.approx(root.imag / _TURN, rel=0.005)
    assert all(each.mode is WorksWith.FULL for each in later)
    assert not any(each.growth_rate < -each.growth_rate_error for each in later[:20])
    quiet, _ = _heard(machine, rpm, 0.5, machine)
    assert not any(each.chatter for each in quiet)


def test_chatter_of_the_slower_of_two_bodies_far_apart_is_flagged_without_a_machine() -> None:
    machine = Machine(_mode(145.0, 10e6), _mode(1000.0, 50e6), cutting_coefficient=2e9)
    found, root = _heard(machine, 600.0, 1.6, machine)
    flag = next(k for k, each in enumerate(found) if each.chatter)
    assert found[flag].time < 3.0
    assert all(each.chatter and each.mode is WorksWith.FAR_APART for each in found[flag:])
    hertz = np.median([each.frequency for each in found[flag:]])
    assert hertz == pytest.approx(root.imag / _TURN, rel=0.005)
    # Full grown it grows no more, and nobody can tell from it how it would grow from small.
    assert not any(each.growth_rate < 0.0 for each in found[flag:])


def test_a_lone_body_told_wrong_is_named() -> None:
    right = Machine(RIGID, _mode(120.0, 10e6), cutting_coefficient=2e9)
    body = right.workpiece
    assert isinstance(body, Mode)
    told = replace(right, workpiece=replace(body, natural_frequency=_TURN * 108.0))
    found, _ = _heard(right, 600.0, 0.5, told, sensor_noise=1e-9)
    words = [each.machine_fit for each in found if each.machine_fit]
    assert words
    assert words[-1].startswith('the workpiece, told at 108.0 Hz, is ')
    assert all(math.isnan(each.tool_frequency) for each in found)


def test_which_bodies_give() -> None:
    soft, stiff = _mode(100.0, 10e6), _mode(1000.0, 100e6)
    both = Machine(soft, stiff)
    assert identifiable(both).without is WorksWith.FAR_APART
    both = replace(both, workpiece=_mode(300.0, 100e6))
    assert identifiable(both)[:2] == (both, '')
    for machine, lone in [
        (Machine(soft, RIGID), 'tool'),
        (Machine(RIGID, soft), 'workpiece'),
        (Machine(stiff, _STIFF_AND_HIGH), 'tool'),
    ]:
        found = identifiable(machine)
        body = getattr(machine, lone)
        assert found.lone == lone
        assert found.machine is not None
        assert found.machine.tool == body
        # Beside it there is next to nothing.
        assert critical_depth(found.machine, 1000.0, seated=True) == pytest.approx(
            critical_depth(machine, 1000.0, seated=False), rel=2e-3
        )
    two = Machine([soft, stiff], RIGID)
    assert identifiable(two) == (None, '', WorksWith.MANY_MODES)
    assert identifiable(None) == (None, '', WorksWith.NO_MACHINE)
