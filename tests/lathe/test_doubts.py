"""What is said of lathes whose samples would mean little, against eigenvalues by NumPy."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.lathe.config import config_from
from lathe_chatter.model import Cut, Machine, Mode
from lathe_chatter.scenario.scenario import Scenario
from lathe_chatter.scenario.simulation import simulate

_FAST = Machine(Mode(0.05, 2.0 * math.pi * 4000.0, 0.03), Mode(0.05, 650.0, 0.05))


def _highest(machine: Machine, depth: float, *, seated: bool) -> float:
    """The highest frequency, Hz, of one mode a body with the cut's stiffness between them."""
    tool, work = machine.tool, machine.workpiece
    cut = machine.cutting_stiffness(depth)
    bearing = machine.bearing_stiffness if seated else 0.0
    stiffness = np.array([[tool.stiffness + cut, -cut], [-cut, work.stiffness + bearing + cut]])
    mass = np.diag([tool.mass, work.mass])
    damping = np.diag([tool.damping, work.damping])
    system = np.block(
        [
            [np.zeros((2, 2)), np.eye(2)],
            [-np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, damping)],
        ]
    )
    return float(np.linalg.eigvals(system).imag.max()) / (2.0 * math.pi)


def test_the_papers_machine_is_beyond_doubt() -> None:
    assert VirtualLathe().doubts == []


def test_a_sample_rate_too_low_is_told_with_one_that_would_do() -> None:
    (sentence,) = VirtualLathe(_FAST, Cut(depth_of_cut=1e-3)).doubts
    told, enough = (float(x) for x in re.findall(r'([0-9.]+) Hz', sentence)[::2])
    exact = _highest(_FAST, 1e-3, seated=True)
    assert told == pytest.approx(exact, rel=1e-3)
    assert 3.0 * exact < enough < 3.0 * exact + 200.0
    assert VirtualLathe(_FAST, Cut(depth_of_cut=1e-3), sample_rate=enough).doubts == []


def test_a_bearing_too_stiff_for_real_time_is_told() -> None:
    machine = Machine(bearing_stiffness=1e12)
    (sentence,) = VirtualLathe(machine).doubts
    assert 'slower than real time' in sentence
    told = float(re.findall(r'up to ([0-9.e+]+) Hz', sentence)[0])
    assert told == pytest.approx(_highest(machine, 5e-4, seated=True), rel=5e-3)
    assert VirtualLathe(machine, Cut(bearing_contact='none')).doubts == []


def test_a_simulation_tells_its_doubts_once(tmp_path: Path) -> None:
    said: list[str] = []
    scenario = Scenario('low', 'A low rate', 0.01, parameters={'sample_rate': 300.0})
    simulate(scenario, tmp_path / 'run', tell=lambda _now, what: said.append(what))
    assert len([what for what in said if 'a third of the sample rate' in what]) == 1


@pytest.mark.parametrize('rpm', [1.0, 1e5])
def test_the_limits_of_real_machines_are_allowed(rpm: float, tmp_path: Path) -> None:
    """By name, as nodes and files have it: 100 mm deep, a million kilograms, any speed."""
    file = tmp_path / 'large.yaml'
    file.write_text(
        'tool: {modes: [{frequency: 5 Hz, damping_ratio: 0.05, mass: 1e6 kg}]}\n'
        'workpiece: {modes: [{frequency: 4 Hz, damping_ratio: 0.05, mass: 1e6 kg}]}\n'
    )
    values = {'machine': str(file), 'spindle_speed_rpm': rpm, 'depth_of_cut': 0.1}
    lathe = config_from(values).lathe()
    assert lathe.machine.tool.modes[0].mass == 1e6
    assert np.isfinite(lathe.advance(200)).all()
