"""A machine told wrong raises no alarm by itself, is noticed, and its frequency is corrected."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lathe_chatter.detection import ChatterDetector, Estimate
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import Cut, Machine
from lathe_chatter.model.machine import Mode
from lathe_chatter.stability import critical_depth, rightmost_root

_HZ = 2.0 * np.pi
_RPM = 3000.0


def _cut(part: float, rpm: float = _RPM) -> Cut:
    """A part of the critical depth, in the noise of a workshop."""
    return Cut(
        spindle_speed_rpm=rpm,
        depth_of_cut=part * critical_depth(Machine(), rpm, seated=False),
        bearing_contact='none',
        force_noise=4.5e-4,
        sensor_noise=1e-7,
    )


def _told(factor: float) -> Machine:
    tool, workpiece = (
        replace(part, natural_frequency=factor * part.natural_frequency)
        for part in (Machine().tool, Machine().workpiece)
    )
    return replace(Machine(), tool=tool, workpiece=workpiece)


def _watch(detector: ChatterDetector, lathe: VirtualLathe, duration: float) -> list[Estimate]:
    blocks = round(100 * duration)
    return [detector.update(lathe.advance(100), lathe.columns) for _ in range(blocks)]


@pytest.mark.parametrize('factor', [0.8, 0.9, 0.95, 1.05, 1.1, 1.2])
@pytest.mark.parametrize('rpm', [3000.0, 10000.0])
def test_a_machine_told_wrong_raises_no_alarm_and_hides_none(factor: float, rpm: float) -> None:
    """From the first sample on, when nobody can know yet that it is wrong."""
    lathe = VirtualLathe(cut=_cut(0.6, rpm), seed=3)
    detector = ChatterDetector(_told(factor))
    assert not any(estimate.chatter for estimate in _watch(detector, lathe, 8.0))
    deep = _cut(1.6, rpm)
    lathe.retune(deep)
    assert rightmost_root(Machine(), rpm, deep.depth_of_cut, seated=False).real > 0.0
    seen = _watch(detector, lathe, 1.5)
    assert seen[-1].chatter


@pytest.mark.parametrize('factor', [0.9, 0.95, 1.05, 1.1])
def test_a_machine_told_wrong_is_noticed_and_corrected(factor: float) -> None:
    detector = ChatterDetector(_told(factor))
    seen = _watch(detector, VirtualLathe(cut=_cut(0.45)), 16.0)
    assert 'MISFIT' in {estimate.mode.name for estimate in seen}
    last = seen[-1]
    assert last.mode.name == 'CORRECTED'
    told = factor * Machine().tool.natural_frequency / _HZ
    assert f'told at {told:.1f} Hz' in last.machine_fit
    taken = float(last.machine_fit.split('taken at ')[1].split(' ')[0])
    assert taken == pytest.approx(Machine().tool.natural_frequency / _HZ, rel=0.02)


@pytest.mark.parametrize('seed', [0, 1, 2])
def test_a_machine_told_right_is_believed(seed: int) -> None:
    seen = _watch(ChatterDetector(), VirtualLathe(cut=_cut(0.45), seed=seed), 16.0)
    assert {estimate.mode.name for estimate in seen[1:]} == {'FULL'}


@pytest.mark.parametrize('rate', [10_000.0, 20_000.0, 50_000.0])
def test_a_stable_start_from_the_history_of_the_paper_is_no_chatter(rate: float) -> None:
    """On a stiff machine, of which few samples a period are seen at 10 kHz."""
    tool = Mode(mass=479.6, natural_frequency=_HZ * 150.0, damping_ratio=0.01)
    workpiece = Mode(mass=10.0, natural_frequency=_HZ * 2000.0, damping_ratio=0.03)
    machine = Machine(
        tool=tool, workpiece=workpiece, bearing_stiffness=0.0, cutting_coefficient=1e9
    )
    cut = Cut(spindle_speed_rpm=12_094.0, depth_of_cut=0.005, bearing_contact='none')
    assert rightmost_root(machine, 12_094.0, 0.005, seated=False).real < 0.0
    lathe, detector = VirtualLathe(machine, cut=cut, sample_rate=rate), ChatterDetector(machine)
    blocks = [lathe.advance(round(0.02 * rate)) for _ in range(100)]
    assert not any(detector.update(block, lathe.columns).chatter for block in blocks)
