"""The references agree with closed forms, with each other and with themselves refined."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import mpmath
import numpy as np
import pytest
from support.reference import dop853, taylor
from support.reference.roots import first_root, horner
from support.reference.solution import event_error, relative_error

from lathe_chatter.array_types import Array
from lathe_chatter.model import BearingContact, Cut, Machine, Mode, paper_initial_state

_RATE = 1e4
_MACHINE = Machine()
_LAWS = pytest.mark.parametrize('law', ['linear', 'total'])
_SOLVERS = pytest.mark.parametrize(
    ('solve', 'allowed'), [(taylor.solve, 4e-15), (dop853.solve, 2e-11)], ids=['taylor', 'dop853']
)

_CONTACTS = pytest.mark.parametrize(
    ('rpm', 'contact', 'clearance'),
    [
        (3000.0, 'none', 5e-6),
        (3000.0, 'gap', 5e-6),
        (10000.0, 'gap', 5e-6),
        (10000.0, 'seated', 60e-6),
    ],
)


def _cut(rpm: float, contact: str, clearance: float = 5e-6, depth: float = 1e-3) -> Cut:
    return Cut(rpm, depth, clearance, BearingContact(contact))


def _free_decay(mode: Mode, stiffness: float, rest: float, start: Array, t: Array) -> Array:
    """x(t) of m x'' + c x' + k (x - rest) = 0."""
    zeta_omega = mode.damping / (2.0 * mode.mass)
    omega = np.sqrt(stiffness / mode.mass - zeta_omega**2)
    x, v = start[0] - rest, start[1]
    swing = x * np.cos(omega * t) + (v + zeta_omega * x) / omega * np.sin(omega * t)
    return rest + np.exp(-zeta_omega * t) * swing


@_SOLVERS
@_LAWS
@pytest.mark.parametrize('contact', ['none', 'seated'])
def test_without_depth_each_mode_decays_freely(
    solve: Any, allowed: float, law: str, contact: str
) -> None:
    cut = _cut(3000.0, contact, depth=0.0)
    states = solve(_MACHINE, cut, 0.05, tool_leaves_cut=law == 'total').states
    t = np.arange(1, len(states) + 1) / _RATE
    start = paper_initial_state(cut)
    seated = contact == 'seated'
    stiffness = _MACHINE.workpiece_stiffness(seated=seated)
    rest = cut.bearing_clearance * _MACHINE.bearing_stiffness / stiffness if seated else 0.0
    tool = _free_decay(_MACHINE.tool, _MACHINE.tool.stiffness, 0.0, start[:2], t)
    workpiece = _free_decay(_MACHINE.workpiece, stiffness, rest, start[2:], t)
    assert np.abs(states[:, 0] - tool).max() <= allowed * np.abs(tool).max()
    assert np.abs(states[:, 2] - workpiece).max() <= allowed * np.abs(workpiece).max()


def test_first_turn_is_the_matrix_exponential_to_thirty_digits() -> None:
    cut = _cut(3000.0, 'none')
    run = taylor.solve(_MACHINE, cut, 0.02, sample_rate=1000.0, tool_leaves_cut=False)
    with mpmath.workdps(50):
        exact = [mpmath.mpf(Fraction(number)) for number in paper_initial_state(cut).tolist()]
        propagator = mpmath.expm(_exact_matrix(cut) / 1000)
        state = mpmath.matrix(exact)
        for row in run.fixed:
            state = propagator * state
            size = max(abs(number) for number in state)
            for mine, theirs in zip(row, state, strict=True):
                assert abs(mpmath.mpf(mine) / 2**run.bits - theirs) < size * mpmath.mpf('1e-30')


def _exact_matrix(cut: Cut) -> Any:
    """`Machine.matrices` without its rounding, of the tool in the cut and no bearing."""
    rows = []
    for i, mode in enumerate((_MACHINE.tool, _MACHINE.workpiece)):
        omega, zeta = mpmath.mpf(mode.natural_frequency), mpmath.mpf(mode.damping_ratio)
        force = mpmath.mpf(_MACHINE.cutting_coefficient) * mpmath.mpf(cut.depth_of_cut)
        force *= (-1) ** i / mpmath.mpf(mode.mass)
        row = [-force, 0, force, 0]
        row[2 * i] -= omega**2
        row[2 * i + 1] -= 2 * zeta * omega
        rows += [[0, 1, 0, 0] if i == 0 else [0, 0, 0, 1], row]
    return mpmath.matrix(rows)


@_LAWS
@_CONTACTS
def test_the_references_agree(rpm: float, contact: str, clearance: float, law: str) -> None:
    cut = _cut(rpm, contact, clearance)
    exact = taylor.solve(_MACHINE, cut, 0.25, tool_leaves_cut=law == 'total')
    double = dop853.solve(_MACHINE, cut, 0.25, tool_leaves_cut=law == 'total')
    assert relative_error(double.states, exact.states, _RATE) < 1e-10
    assert event_error(double.events, exact.events) < 1e-13
    if contact == 'gap':
        assert any(event.kind == 'bearing' for event in exact.events)
    if law == 'total':
        assert any(event.kind == 'chip' for event in exact.events)


@_LAWS
@_CONTACTS
def test_taylor_has_thirty_digits(rpm: float, contact: str, clearance: float, law: str) -> None:
    cut = _cut(rpm, contact, clearance)
    run = taylor.solve(_MACHINE, cut, 0.2, sample_rate=2e3, tool_leaves_cut=law == 'total')
    fine = taylor.solve(
        _MACHINE, cut, 0.2, sample_rate=2e3, tool_leaves_cut=law == 'total',
        piece=2.9e-4, degree=30, bits=208,
    )  # fmt: skip
    assert event_error(run.events, fine.events) < 1e-16
    for mine, theirs in zip(run.event_times, fine.event_times, strict=True):
        assert abs(mine - theirs) < Fraction(1, 10**32)
    amplitude = np.zeros(4)
    for mine, theirs in zip(run.fixed, fine.fixed, strict=True):
        for i, (a, b) in enumerate(zip(mine, theirs, strict=True)):
            amplitude[i] = max(amplitude[i], abs(a) / 2**run.bits)
            difference = abs(a - (b >> (fine.bits - run.bits))) / 2**run.bits
            assert difference < 1e-30 * amplitude[i]


def test_taylor_reproduces_the_growth_of_the_papers_fast_case() -> None:
    """3000 rpm, 1 mm, no bearing: +13.652715 +- 847.585268j 1/s (reproduction.md)."""
    run = taylor.solve(_MACHINE, _cut(3000.0, 'none'), 1.0, tool_leaves_cut=False)
    x, v = run.states[-4000:, 0], run.states[-4000:, 1]
    # a(t) = x' - conj(lambda) x of a lone mode turns and grows with exp(lambda t) exactly
    root = 13.652715 + 847.585268j
    a = v - np.conj(root) * x
    measured = np.log(np.abs(a[-1] / a[0])) / (3999 / _RATE)
    assert measured == pytest.approx(root.real, abs=2e-4)


@pytest.mark.parametrize('separation', [1e-2, 1e-5])
def test_two_crossings_close_together_are_found(separation: float) -> None:
    centre = 0.377
    a, b = centre - separation / 2, centre + separation / 2
    polynomial = [a * b, -(a + b), 1.0]
    assert first_root(polynomial, 1.0) == pytest.approx(a, abs=1e-9)


def test_a_near_miss_is_no_crossing_and_a_graze_is_refused() -> None:
    assert first_root([0.25 + 1e-9, -1.0, 1.0], 1.0) is None
    assert horner([0.25, -1.0, 1.0], 0.5) == 0.0
    with pytest.raises(ArithmeticError, match='graze'):
        first_root([0.25, -1.0, 1.0], 1.0)
