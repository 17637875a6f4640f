"""Machines with several modes and process damping, against textbooks and against collocation."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from support.machines import random_structure

from lathe_chatter.model import Cut, Machine, Mode
from lathe_chatter.stability import (
    ProcessDamping,
    contact_at,
    count_roots_right_of,
    critical_depth,
    critical_depths,
    floquet,
    growth_map,
    leading_roots,
    lobe_boundary,
    recommend_speeds,
    rightmost_root,
    rightmost_roots,
    safe_limit,
    seating_depth,
    stable_speed_intervals,
)

RIGID = Mode(1e6, 1e6, 0.05)
"""A workpiece that does not move."""
FLANK = ProcessDamping(1e3, 0.05)


def tool_of(*modes: Mode, coefficient: float = 1e9) -> Machine:
    return Machine([*modes], RIGID, bearing_stiffness=1.0, cutting_coefficient=coefficient)


def collocation_root(
    machine: Machine, rpm: float, depth: float, *, seated: bool, process: ProcessDamping
) -> float:
    """Growth rate by Chebyshev collocation of r over a turn: an eigenproblem, and no search."""
    delay = 60.0 / rpm
    a, b, _ = machine.matrices(depth, seated=seated)
    across = np.zeros(len(a))
    across[::2] = [
        *(mode.chip for mode in machine.tool.modes),
        *(-mode.chip for mode in machine.workpiece.modes),
    ]
    moving = np.roll(across, 1)
    push = b @ np.linalg.pinv(across[None, :])[:, 0] / machine.cutting_stiffness(depth)
    a = a - process.per_width_and_delay * depth * delay * np.outer(push, moving)
    order = math.ceil(0.7 * 4000.0 * delay) + 30
    nodes = np.cos(np.pi * np.arange(order + 1) / order)
    sign = (-1.0) ** np.arange(order + 1) * np.where(np.arange(order + 1) % order, 1.0, 2.0)
    derivative = np.outer(sign, 1.0 / sign) / (nodes[:, None] - nodes + np.eye(order + 1))
    derivative -= np.diag(derivative.sum(axis=1))
    derivative *= 2.0 / delay
    size = len(a)
    problem = np.zeros((size + order, size + order))
    problem[:size, :size] = a
    problem[:size, -1] = push * machine.cutting_stiffness(depth)
    problem[size:, :size] = np.outer(derivative[1:, 0], across)
    problem[size:, size:] = derivative[1:, 1:]
    return float(np.linalg.eigvals(problem).real.max())


def test_the_textbook_limit_of_one_mode() -> None:
    """b = 2 k zeta (1 + zeta) / K at the speeds where omega = omega_n sqrt(1 + 2 zeta)."""
    mode, coefficient = Mode(2.0, 1885.0, 0.03), 1.5e9
    machine = tool_of(mode, coefficient=coefficient)
    zeta = mode.damping_ratio
    lowest = 2.0 * mode.stiffness * zeta * (1.0 + zeta) / coefficient
    ratio = math.sqrt(1.0 + 2.0 * zeta)
    angle = math.atan2(-2.0 * zeta * ratio, 1.0 - ratio**2)
    for lobe in (0, 3, 20):
        phase = 2.0 * math.pi * lobe + 3.0 * math.pi + 2.0 * angle
        rpm = 60.0 * mode.natural_frequency * ratio / phase
        assert critical_depth(machine, rpm, seated=False) == pytest.approx(lowest, rel=1e-9)
    boundary = lobe_boundary(machine, seated=False, depth_limit=2.0 * lowest, points=4000)
    assert boundary.depth_of_cut.min() == pytest.approx(lowest, rel=1e-5)
    assert boundary.depth_of_cut.min() >= lowest * (1.0 - 1e-12)


@pytest.mark.parametrize('factor', [-0.287, 0.4])
def test_the_closed_form_of_two_modes(factor: float) -> None:
    """w = -1 / (2 K min Re G), the modes weighed by their directions: mode coupling below 0."""
    modes = (
        Mode(1.0, 2.0 * math.pi * 700.0, 0.04, force=0.7),
        Mode(0.8, 2.0 * math.pi * 850.0, 0.03, chip=factor, force=1.0),
    )
    machine = tool_of(*modes)

    def response(omega: float) -> complex:
        return sum(
            m.chip * m.force / complex(m.stiffness - m.mass * omega**2, m.damping * omega)
            for m in modes
        )

    lower = np.linspace(3000.0, 9000.0, 6001)
    start = lower[np.argmin([response(omega).real for omega in lower])]
    found = minimize_scalar(
        lambda omega: 1e6 * response(omega).real, bracket=(start - 1.0, start, start + 1.0),
        tol=1e-14,
    )  # fmt: skip
    omega = float(found.x)
    expected = -0.5 / (machine.cutting_coefficient * response(omega).real)
    phase = 6.0 * math.pi + (math.pi + 2.0 * np.angle(response(omega))) % (2.0 * math.pi)
    rpm = 60.0 * omega / phase
    assert critical_depth(machine, rpm, seated=False) == pytest.approx(expected, rel=1e-9)
    root = rightmost_root(machine, rpm, expected, seated=False)
    assert abs(root.real) < 1e-6
    assert root.imag == pytest.approx(omega, rel=1e-6)
    speeds = np.geomspace(300.0, 30000.0, 3000)
    assert critical_depths(machine, speeds, seated=False).min() >= expected * (1.0 - 1e-9)


@pytest.mark.parametrize('modes', [(1, 1), (2, 2), (4, 4), (8, 8)])
@pytest.mark.parametrize('seated', [False, True])
@pytest.mark.parametrize('process', [ProcessDamping(), FLANK])
def test_roots_of_structures_agree_with_collocation(
    modes: tuple[int, int], process: ProcessDamping, *, seated: bool
) -> None:
    rng = np.random.default_rng(sum(modes))
    for _ in range(4):
        machine = random_structure(rng, *modes)
        rpm, depth = rng.uniform(1500.0, 12000.0), rng.uniform(1e-4, 2e-3)
        root = rightmost_root(machine, rpm, depth, seated=seated, process=process)
        expected = collocation_root(machine, rpm, depth, seated=seated, process=process)
        assert root.real == pytest.approx(expected, abs=1e-6 * abs(root))
        first = leading_roots(machine, rpm, depth, seated=seated, process=process, count=3)
        assert first[0] == pytest.approx(root, rel=1e-12)


@pytest.mark.parametrize('process', [ProcessDamping(), FLANK])
def test_at_the_critical_depth_of_a_structure_the_first_pair_crosses(
    process: ProcessDamping,
) -> None:
    rng = np.random.default_rng(9)
    for _ in range(25):
        machine = random_structure(rng, int(rng.integers(1, 5)), int(rng.integers(1, 5)))
        rpm, seated = float(np.exp(rng.uniform(np.log(200.0), np.log(30000.0)))), False
        limit = critical_depth(machine, rpm, seated=seated, process=process)
        if limit > 0.05:
            continue
        for part, expected in ((0.5, 0), (1.0 - 1e-7, 0), (1.0 + 1e-7, 2)):
            count = count_roots_right_of(
                machine, rpm, part * limit, 0.0, seated=seated, process=process
            )
            assert count == expected


def test_process_damping_lifts_the_limit_at_low_speed() -> None:
    """Figures of an independent calculation for the paper's open machine, in mm."""
    process = ProcessDamping(3e-4 * 3.5e6, 0.05)
    for rpm, without, damped in ((300.0, 0.596, 0.855), (3000.0, 0.665, 0.681)):
        assert 1e3 * critical_depth(Machine(), rpm, seated=False) == pytest.approx(
            without, abs=1e-3
        )
        assert 1e3 * critical_depth(Machine(), rpm, seated=False, process=process) == (
            pytest.approx(damped, abs=1.1e-3)
        )


def test_lobes_with_process_damping_bend_back() -> None:
    boundary = lobe_boundary(Machine(), seated=False, process=FLANK, lobes=6, points=80)
    known = np.isfinite(boundary.depth_of_cut)
    assert known.any(axis=1).all()
    for row in range(6):
        columns = np.flatnonzero(known[row])[:: max(1, known[row].sum() // 12)]
        for column in columns:
            rpm, depth = (
                boundary.spindle_speed_rpm[row, column],
                boundary.depth_of_cut[row, column],
            )
            if not 60.0 < rpm < 1e5:
                continue
            s = 1j * boundary.angular_frequency[row, column]
            delay = 60.0 / rpm
            force = Machine().cutting_stiffness(depth) * (1.0 - np.exp(-s * delay))
            force += FLANK.per_width_and_delay * depth * delay * s
            response = sum(
                1.0 / (m.mass * s**2 + m.damping * s + m.stiffness)
                for m in (Machine().tool, Machine().workpiece)
            )
            assert abs(1.0 + force * response) < 1e-9
    limit = critical_depth(Machine(), 600.0, seated=False, process=FLANK)
    assert limit > critical_depth(Machine(), 600.0, seated=False)


@pytest.mark.parametrize('process', [ProcessDamping(), FLANK])
def test_stable_intervals_of_structures_are_where_the_roots_say(process: ProcessDamping) -> None:
    rng = np.random.default_rng(21)
    speeds = np.geomspace(800.0, 14000.0, 160)
    for _ in range(4):
        machine = random_structure(rng, 2, 2)
        lowest = critical_depths(machine, speeds, seated=True, process=process).min()
        depth = float(min(1.3 * lowest, 0.05))
        ends = stable_speed_intervals(
            machine, depth, seated=True, process=process, low_rpm=800.0, high_rpm=14000.0
        )
        inside = ((ends[:, :1] <= speeds) & (speeds <= ends[:, 1:])).any(axis=0)
        growth = rightmost_roots(machine, speeds, depth, seated=True, process=process).real
        assert np.array_equal(inside, growth < 0.0)
        advice = recommend_speeds(
            machine, depth, seated=True, process=process, low_rpm=800.0, high_rpm=14000.0
        )
        for speed in advice.speeds:
            root = rightmost_root(
                machine, speed.spindle_speed_rpm, depth, seated=True, process=process
            )
            assert root.real == pytest.approx(speed.growth_rate)
            assert root.real < 0.0


@pytest.mark.parametrize('modes', [(1, 1), (2, 2), (3, 4)])
@pytest.mark.parametrize('seated', [False, True])
def test_at_constant_speed_the_multiplier_of_a_structure_is_that_of_its_root(
    modes: tuple[int, int], *, seated: bool
) -> None:
    machine = random_structure(np.random.default_rng(5), *modes)
    cut = Cut(4000.0, 8e-4, speed_variation_amplitude=0.0, speed_variation_frequency=7.0)
    found = floquet(machine, cut, seated=seated)
    root = rightmost_root(machine, 4000.0, 8e-4, seated=seated)
    assert found.growth_rate == pytest.approx(root.real, abs=1e-6)


def test_many_machines_at_once_are_each_as_alone() -> None:
    rng = np.random.default_rng(2)
    machines = [random_structure(rng, int(rng.integers(1, 4)), 2) for _ in range(6)]
    speeds, depths = np.linspace(2000.0, 9000.0, 5), 7e-4
    several = np.array(machines, object)[:, None]
    roots = rightmost_roots(several, speeds, depths, seated=True)
    limits = critical_depths(several, speeds, seated=True)
    assert roots.shape == limits.shape == (6, 5)
    for row, machine in enumerate(machines):
        assert np.array_equal(roots[row], rightmost_roots(machine, speeds, depths, seated=True))
        alone = critical_depths(machine, speeds, seated=True)
        assert limits[row] == pytest.approx(alone, rel=1e-13)


def test_the_bearing_of_a_structure_is_seated_by_its_own_compliance() -> None:
    workpiece = [
        Mode(0.1, 600.0, 0.05, bearing=0.5),
        Mode(0.05, 1500.0, 0.03, chip=0.8, force=0.8, bearing=-0.4),
    ]
    machine = Machine(Mode(0.05, 775.0, 0.05), workpiece)
    depth = seating_depth(machine, 5e-6, 5e-5)
    a, b, _ = machine.matrices(depth, seated=False)
    force = machine.cutting_stiffness(depth) * 5e-5
    pushed = np.array([0.0, 0.0, *(m.bearing * m.force / m.stiffness for m in workpiece)]).sum()
    assert force * pushed == pytest.approx(5e-6)
    assert len(a) == len(b) == 6
    away = [Mode(0.1, 600.0, 0.05, bearing=-0.5)]
    assert seating_depth(Machine(Mode(0.05, 775.0, 0.05), away), 5e-6, 5e-5) == math.inf


def test_where_the_workpiece_stands_on_the_edge_of_its_bearing_nothing_is_safe() -> None:
    """No clearance and no mean force: 0.60 mm grows though either limit alone is above it."""
    cut = Cut(3000.0, 6e-4, bearing_clearance=0.0)
    limits = safe_limit(Machine(), cut, tool_leaves_cut=False)
    assert float(limits.depth_of_cut) == 0.0
    assert not contact_at(Machine(), cut, tool_leaves_cut=False).stable
    with_mean = safe_limit(Machine(), cut)
    assert with_mean.depth_of_cut == with_mean.seated_limit


def test_a_map_tells_how_far_it_is() -> None:
    told: list[int] = []
    growth_map(
        Machine(), Cut(), [2000.0, 3000.0], [1e-4, 5e-4, 1e-3],
        progress=told.append,
    )  # fmt: skip
    assert told == [3, 3]
