from __future__ import annotations

import numpy as np
import pytest
from support.machines import random_machine
from support.reference import collocation

from lathe_chatter.errors import ParameterError, UnprovenError
from lathe_chatter.model import Machine, Mode
from lathe_chatter.stability import (
    count_roots_right_of,
    leading_roots,
    rightmost_root,
    rightmost_roots,
)

PUBLISHED = [
    (3000.0, 0.0005, False, -8.999066, 825.483211),
    (10000.0, 0.0005, False, -7.240068, 794.924220),
    (3000.0, 0.001, False, 13.652715, 847.585268),
    (10000.0, 0.001, False, 21.598456, 816.172885),
    (3000.0, 0.0005, True, 1.708234, 845.306344),
    (10000.0, 0.0005, True, 4.349768, 822.140171),
    (3000.0, 0.001, True, 19.182492, 867.884034),
    (10000.0, 0.001, True, 28.772325, 847.879127),
]


@pytest.mark.parametrize(('rpm', 'depth', 'seated', 'growth', 'frequency'), PUBLISHED)
def test_runs_of_the_paper(
    *, rpm: float, depth: float, seated: bool, growth: float, frequency: float
) -> None:
    root = rightmost_root(Machine(), rpm, depth, seated=seated)
    assert (round(root.real, 6), round(root.imag, 6)) == (growth, frequency)
    assert collocation.residual(Machine(), rpm, depth, root, seated=seated) < 1e-13


@pytest.mark.parametrize('seed', range(4))
def test_random_machines_agree_with_collocation(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(12):
        machine = random_machine(rng)
        rpm, depth = np.exp(rng.uniform(np.log(700), np.log(30000))), 10 ** rng.uniform(-6, -2)
        seated = bool(rng.integers(2))
        expected = collocation.rightmost_root(machine, rpm, depth, seated=seated)
        found = rightmost_root(machine, rpm, depth, seated=seated)
        assert found.real == pytest.approx(expected.real, abs=1e-9)
        assert found.imag == pytest.approx(expected.imag, abs=1e-9)


def test_a_growth_map_agrees_with_collocation_at_every_point() -> None:
    speeds, depths = np.linspace(1000.0, 12000.0, 23), np.linspace(1e-4, 2e-3, 8)
    found = rightmost_roots(Machine(), speeds, depths[:, None], seated=False)
    for (row, column), root in np.ndenumerate(found):
        expected = collocation.rightmost_root(Machine(), speeds[column], depths[row], seated=False)
        assert root.real == pytest.approx(expected.real, abs=1e-9)


def test_leaving_out_the_proof_leaves_the_roots() -> None:
    speeds, depths = np.geomspace(300.0, 12000.0, 40), np.linspace(1e-4, 2e-3, 8)[:, None]
    proven = rightmost_roots(Machine(), speeds, depths, seated=True)
    found = rightmost_roots(Machine(), speeds, depths, seated=True, proven=False)
    assert np.array_equal(found, proven)


def test_far_from_any_real_lathe_the_root_is_still_found_and_proven() -> None:
    rng = np.random.default_rng(8)
    for _ in range(25):
        masses, frequencies = 10 ** rng.uniform(-3, 2, 2), 10 ** rng.uniform(1, 3.5, 2)
        damping = rng.choice([0.0, 0.001, 0.3, 1.0], 2)
        modes = [Mode(*numbers) for numbers in zip(masses, frequencies, damping, strict=True)]
        machine = Machine(*modes, cutting_coefficient=10 ** rng.uniform(3, 10))
        cut = (10 ** rng.uniform(2.5, 4.4), 10 ** rng.uniform(-6, -2))
        root = rightmost_root(machine, *cut, seated=True)
        above = root.real + 1e-6 * abs(root)
        assert count_roots_right_of(machine, *cut, above, seated=True) == 0
        assert count_roots_right_of(machine, *cut, root.real - 1e-6 * abs(root), seated=True) > 0


@pytest.mark.parametrize('rpm', [200.0, 300.0])
def test_slow_spindles_agree_with_collocation(rpm: float) -> None:
    # Some 80 roots crowd the axis at 200 rev/min.
    for depth in (3e-4, 1e-3):
        expected = collocation.rightmost_root(Machine(), rpm, depth, seated=False)
        found = rightmost_root(Machine(), rpm, depth, seated=False)
        assert found == pytest.approx(expected, abs=1e-9)


def test_without_depth_the_least_damped_mode_decides() -> None:
    machine = Machine()
    mode = machine.workpiece
    for seated in (False, True):
        stiffness = machine.workpiece_stiffness(seated=seated)
        decay = mode.damping / (2.0 * mode.mass)
        frequency = np.sqrt(stiffness / mode.mass - decay**2)
        root = rightmost_root(machine, 3000.0, 0.0, seated=seated)
        assert root == pytest.approx(complex(-decay, frequency), rel=1e-12)


def test_two_equal_modes_give_a_double_root() -> None:
    mode = Mode(0.05, 700.0, 0.05)
    root = rightmost_root(Machine(mode, mode), 3000.0, 0.0, seated=False)
    # A double root is known to the square root of rounding.
    assert root == pytest.approx(complex(-35.0, 700.0 * np.sqrt(1 - 0.05**2)), abs=1e-3)


@pytest.mark.parametrize('apart', [0.0, 1e-12])
@pytest.mark.parametrize('ratio', [1.0, 1e2, 1e5])
def test_two_modes_of_one_frequency_and_damping_keep_a_root_that_no_force_moves(
    ratio: float, apart: float
) -> None:
    """They cut as one mode of both flexibilities, and move against each other without force."""
    omega, zeta = 2.0 * np.pi * 200.0, 0.02
    tool = Mode(1e7 / omega**2, omega, zeta)
    stiff = Mode(ratio * 1e7 / omega**2, omega * (1.0 + apart), zeta)
    both = Machine(tool, stiff, 0.0, 1.5e9)
    one = Mode(1e7 / (1.0 + 1.0 / ratio) / omega**2, omega, zeta)
    alone = Machine(one, Mode(1e6, 10.0 * omega, 1.0), 0.0, 1.5e9)
    still = complex(-zeta, np.sqrt(1.0 - zeta**2)) * omega
    speeds, depths = np.linspace(1900.0, 23000.0, 40), np.linspace(2.5e-5, 5e-4, 20)[:, None]
    found = rightmost_roots(both, speeds, depths, seated=False)
    expected = rightmost_roots(alone, speeds, depths, seated=False)
    expected = np.where(expected.real > still.real, expected, still)
    assert (expected == still).any()
    assert (expected != still).any()
    assert found == pytest.approx(expected, rel=1e-6)
    first = leading_roots(both, 1900.0, 2.5e-5, seated=False, count=2)
    assert np.abs(first - still).min() < 1e-9 * omega


def test_roots_that_cannot_be_told_apart_are_a_sentence() -> None:
    """Three modes of one frequency: two of the roots are one."""
    three = Machine([Mode(0.05, 775.0, 0.05)] * 3, Mode(0.05, 650.0, 0.05))
    with pytest.raises(UnprovenError, match='change the frequency of one by') as told:
        leading_roots(three, 3000.0, 5e-4, seated=False)
    assert isinstance(told.value, ArithmeticError)


def test_an_undamped_machine_out_of_the_cut_neither_grows_nor_decays() -> None:
    machine = Machine(Mode(0.05, 700.0, 0.0), Mode(0.05, 650.0, 0.05))
    assert rightmost_root(machine, 3000.0, 0.0, seated=False) == pytest.approx(700j, abs=1e-9)


def test_arrays_broadcast_and_equal_single_roots() -> None:
    speeds, depths = np.array([2000.0, 5000.0, 9000.0]), np.array([[2e-4], [1e-3]])
    roots = rightmost_roots(Machine(), speeds, depths, seated=True)
    assert roots.shape == (2, 3)
    for (row, column), root in np.ndenumerate(roots):
        single = rightmost_root(Machine(), speeds[column], depths[row, 0], seated=True)
        assert root == pytest.approx(single, rel=1e-13)


@pytest.mark.parametrize('seed', range(3))
def test_leading_roots_solve_the_equation_and_start_with_the_rightmost(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(8):
        machine = random_machine(rng)
        rpm, depth = rng.uniform(700.0, 30000.0), 10 ** rng.uniform(-6, -2)
        roots = leading_roots(machine, rpm, depth, seated=False, count=7)
        assert roots.size == 7
        assert np.all(np.diff(roots.real) <= 0.0)
        assert roots[0] == pytest.approx(rightmost_root(machine, rpm, depth, seated=False))
        for root in roots.tolist():
            assert collocation.residual(machine, rpm, depth, root, seated=False) < 1e-10


def test_without_depth_there_are_no_more_roots_than_modes() -> None:
    roots = leading_roots(Machine(), 3000.0, 0.0, seated=False, count=5)
    assert roots.real == pytest.approx([-32.5, -38.75])


@pytest.mark.parametrize(
    ('rpm', 'depth', 'name'),
    [(0.0, 1e-3, 'spindle_speed_rpm'), (3000.0, -1e-3, 'depth_of_cut'), (np.nan, 0, 'spindle')],
)
def test_values_that_no_cut_can_have_are_refused(rpm: float, depth: float, name: str) -> None:
    with pytest.raises(ParameterError, match=name):
        rightmost_root(Machine(), rpm, depth, seated=False)


def test_a_text_is_refused_with_a_sentence() -> None:
    with pytest.raises(ParameterError, match='must be a finite number from 1 to 100000 rev/min'):
        rightmost_roots(Machine(), 'fast', 1e-3, seated=False)  # type: ignore[arg-type]  # a mistake
