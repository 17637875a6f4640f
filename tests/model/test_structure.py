"""Bodies with several modes: what a machine makes of them, and what is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lathe_chatter.errors import ParameterError
from lathe_chatter.model import Machine, Mode, Structure

_TOOL = [Mode(0.4, 2000.0, 0.03, chip=0.8, force=-0.3), Mode(1.2, 3100.0, 0.02)]
_WORKPIECE = [Mode(3.0, 700.0, 0.01, bearing=-0.5), Mode(5.0, 1300.0, 0.02, chip=0.4, bearing=2.0)]
_MACHINE = Machine(_TOOL, _WORKPIECE, bearing_stiffness=2e6)


def test_a_list_of_modes_is_a_structure_and_a_list_of_one_is_a_mode() -> None:
    assert _MACHINE.tool == Structure(tuple(_TOOL))
    assert Machine([Mode(0.05, 775.0, 0.05)]) == Machine()
    assert Machine().tool.modes == (Mode(0.05, 775.0, 0.05),)


def test_equal_parts_of_a_mode_move_like_the_whole() -> None:
    """Four modes of four times the mass and stiffness each: in parallel they are as compliant."""
    whole, parts = Mode(0.05, 650.0, 0.05), [Mode(0.2, 650.0, 0.05)] * 4
    for seated in (False, True):
        one = Machine(workpiece=whole).workpiece_stiffness(seated=seated)
        several = Machine(workpiece=parts).workpiece_stiffness(seated=seated)
        assert several == pytest.approx(one, rel=1e-14)


@pytest.mark.parametrize('seated', [False, True])
def test_the_static_stiffness_is_that_of_the_matrices(seated: bool) -> None:
    a, _, _ = _MACHINE.matrices(0.0, seated=seated)
    force = np.zeros(8)
    force[1::2] = [0.0, 0.0, *(mode.force / mode.mass for mode in _WORKPIECE)]
    rest = np.linalg.solve(a, -force)[0::2]
    moved = rest @ [0.0, 0.0, *(mode.chip for mode in _WORKPIECE)]
    assert _MACHINE.workpiece_stiffness(seated=seated) == pytest.approx(1.0 / moved, rel=1e-12)


def test_the_matrices_are_the_equations_of_motion() -> None:
    rng = np.random.default_rng(1)
    state, before = rng.normal(size=8), rng.normal(size=8)
    a, b, d = _MACHINE.matrices(1e-3, seated=True)
    modes = (*_TOOL, *_WORKPIECE)
    signs = (1.0, 1.0, -1.0, -1.0)
    q, then = state[0::2], before[0::2]
    gap = 0.3
    chip = sum(s * m.chip * (x - y) for s, m, x, y in zip(signs, modes, q, then, strict=True))
    at_bearing = sum(m.bearing * x for m, x in zip(_WORKPIECE, q[2:], strict=True)) - gap
    expected = []
    for sign, mode, x, v in zip(signs, modes, q, state[1::2], strict=True):
        push = -sign * mode.force * _MACHINE.cutting_stiffness(1e-3) * chip
        if sign < 0.0:
            push -= _MACHINE.bearing_stiffness * mode.bearing * at_bearing
        expected.append((push - mode.damping * v - mode.stiffness * x) / mode.mass)
    derivative = a @ state + b @ before + d * gap
    assert derivative[0::2] == pytest.approx(state[1::2])
    assert derivative[1::2] == pytest.approx(expected)


@pytest.mark.parametrize(
    ('tool', 'sentence'),
    [
        ([], r'tool is \[\]: it must be a Mode, or a list of Modes'),
        ([1.0], r'tool is \[1.0\]: it must be a Mode'),
        ([Mode(1.0, 100.0, 0.1)] * 16, 'the number of modes is 17: it must be at most 16'),
    ],
)
def test_what_is_no_body_is_refused(tool: Any, sentence: str) -> None:
    with pytest.raises(ParameterError, match=sentence):
        Machine(tool=tool)


@pytest.mark.parametrize('value', [float('nan'), '1', 1e9])
def test_a_participation_that_cannot_be_is_refused(value: Any) -> None:
    with pytest.raises(ParameterError, match=r'^force is .*: it must be a finite number from'):
        Mode(1.0, 100.0, 0.1, force=value)


@pytest.mark.parametrize('name', ['mass', 'natural_frequency', 'damping_ratio', 'damping'])
def test_what_one_mode_has_is_refused_of_several(name: str) -> None:
    with pytest.raises(
        ParameterError, match='the number of modes is 2: it must be 1, as only one'
    ):
        getattr(_MACHINE.tool, name)


def test_the_static_stiffness_of_a_structure_may_be_negative_but_never_silent() -> None:
    """A force that bends a body towards itself: 1/k = sum phi_C phi_F / k."""
    body = Structure((Mode(1.0, 100.0, 0.1, force=-1.0), Mode(1.0, 200.0, 0.1)))
    assert body.stiffness == pytest.approx(1.0 / (1.0 / 40000.0 - 1.0 / 10000.0))
