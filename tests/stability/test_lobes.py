from __future__ import annotations

import math

import numpy as np
import pytest
from support.machines import random_machine

from lathe_chatter.model import Machine, Mode
from lathe_chatter.stability import critical_depth, lobe_boundary, rightmost_root, rightmost_roots

PUBLISHED = [
    (3000.0, False, 0.664984, 6),
    (10000.0, False, 0.615028, 6),
    (3000.0, True, 0.467076, 6),
    (10000.0, True, 0.431282, 6),
    (6000.0, True, 1.287, 3),
]


@pytest.mark.parametrize(('rpm', 'seated', 'millimetres', 'digits'), PUBLISHED)
def test_limits_of_the_paper(*, rpm: float, seated: bool, millimetres: float, digits: int) -> None:
    depth = critical_depth(Machine(), rpm, seated=seated)
    assert round(1e3 * depth, digits) == millimetres
    assert abs(rightmost_root(Machine(), rpm, depth, seated=seated).real) < 1e-9


def test_the_lowest_limit_over_all_speeds() -> None:
    boundary = lobe_boundary(Machine(), seated=False, points=2000)
    assert round(1e3 * boundary.depth_of_cut.min(), 4) == 0.5960
    speeds = np.geomspace(60.0, 30000.0, 200)
    limits = [critical_depth(Machine(), rpm, seated=False) for rpm in speeds]
    assert min(limits) >= boundary.depth_of_cut.min() * (1.0 - 1e-6)


@pytest.mark.parametrize('seed', range(3))
def test_every_boundary_point_has_a_root_on_the_axis(seed: int) -> None:
    machine = random_machine(np.random.default_rng(seed), damping=0.01)
    boundary = lobe_boundary(machine, seated=True, lobes=8, points=60)
    assert boundary.spindle_speed_rpm.shape == (8, 60)
    assert boundary.lobe[:, 0].tolist() == list(range(8))
    delay = 60.0 / boundary.spindle_speed_rpm
    echo = 1.0 - np.exp(-1j * boundary.angular_frequency * delay)
    s = 1j * boundary.angular_frequency
    tool, workpiece = machine.tool, machine.workpiece
    receptance = 1.0 / (tool.mass * s**2 + tool.damping * s + tool.stiffness)
    stiffness = machine.workpiece_stiffness(seated=True)
    receptance += 1.0 / (workpiece.mass * s**2 + workpiece.damping * s + stiffness)
    value = 1.0 + machine.cutting_coefficient * boundary.depth_of_cut * receptance * echo
    assert np.abs(value).max() < 1e-10
    assert boundary.depth_of_cut.max() <= 0.005 * (1.0 + 1e-9)


def test_the_lower_envelope_of_the_lobes_is_the_critical_depth() -> None:
    boundary = lobe_boundary(Machine(), seated=False, lobes=25, points=4000)
    for rpm in (1500.0, 2790.0, 4321.0, 9000.0):
        limits = []
        for speeds, depths in zip(boundary.spindle_speed_rpm, boundary.depth_of_cut, strict=True):
            below = speeds[:-1] < rpm
            crossing = np.flatnonzero(below != (speeds[1:] < rpm))
            part = (rpm - speeds[crossing]) / (speeds[crossing + 1] - speeds[crossing])
            limits += (
                depths[crossing] + part * (depths[crossing + 1] - depths[crossing])
            ).tolist()
        assert critical_depth(Machine(), rpm, seated=False) == pytest.approx(min(limits), rel=1e-4)


def test_the_growth_rate_changes_sign_at_the_critical_depth_and_not_before() -> None:
    rng = np.random.default_rng(11)
    for _ in range(10):
        machine, rpm = random_machine(rng), rng.uniform(300.0, 20000.0)
        limit = critical_depth(machine, rpm, seated=False)
        depths = np.minimum(limit * np.append(np.linspace(0.0, 0.9999, 30), 1.0001), 0.01)
        growth = rightmost_roots(machine, rpm, depths, seated=False).real
        assert np.all(growth[:-1] < 0.0)
        assert growth[-1] > 0.0 or limit > 0.01


def test_a_material_without_force_is_never_unstable() -> None:
    machine = Machine(cutting_coefficient=0.0)
    assert critical_depth(machine, 3000.0, seated=False) == math.inf
    assert lobe_boundary(machine, seated=False).depth_of_cut.size == 0


def test_below_the_lowest_lobe_the_boundary_is_empty() -> None:
    assert lobe_boundary(Machine(), seated=False, depth_limit=5e-4).depth_of_cut.shape == (20, 0)


@pytest.mark.parametrize('rpm', [3000.0, 3500.0, 5000.0, 7000.0, 9000.0])
def test_a_cut_damps_or_excites_an_undamped_mode_from_the_first_depth_on(rpm: float) -> None:
    machine = Machine(Mode(0.05, 700.0, 0.0), Mode(0.05, 650.0, 0.05))
    limit = critical_depth(machine, rpm, seated=False)
    shallow = rightmost_root(machine, rpm, 1e-6, seated=False)
    assert (limit < 1e-9) == (shallow.real > 0.0)
    if limit > 1e-9:
        assert rightmost_root(machine, rpm, 0.999 * limit, seated=False).real < 0.0
        assert rightmost_root(machine, rpm, 1.001 * limit, seated=False).real > 0.0
