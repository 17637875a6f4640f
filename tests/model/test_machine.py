"""The machine and the cut: the paper's matrices, from its equations, and what is refused."""

from __future__ import annotations

import pickle
from dataclasses import FrozenInstanceError
from typing import Any

import numpy as np
import pytest

from lathe_chatter.errors import ParameterError
from lathe_chatter.model import BearingContact, Cut, Machine, Mode, paper_initial_state

_MACHINE = Machine(Mode(0.05, 775.0, 0.05), Mode(0.08, 650.0, 0.03), bearing_stiffness=2e4)


def _forces(state: np.ndarray, before: np.ndarray, depth: float, rest: float) -> np.ndarray:
    """Equations (8a) and (8b) written out for the bearing engaged, as accelerations (2,)."""
    tool, workpiece = _MACHINE.tool, _MACHINE.workpiece
    force = 3.5e6 * depth * ((state[0] - state[2]) - (before[0] - before[2]))
    on_tool = -tool.damping * state[1] - tool.stiffness * state[0] - force
    on_workpiece = -workpiece.damping * state[3] - workpiece.stiffness * state[2] + force
    on_workpiece -= _MACHINE.bearing_stiffness * (state[2] - rest)
    return np.array([on_tool / tool.mass, on_workpiece / workpiece.mass])


def test_the_matrices_are_the_equations_of_motion() -> None:
    rng = np.random.default_rng(1)
    state, before = rng.normal(size=4), rng.normal(size=4)
    a, b, d = _MACHINE.matrices(1e-3, seated=True)
    derivative = a @ state + b @ before + d * 0.3
    assert derivative[[0, 2]] == pytest.approx(state[[1, 3]])
    assert derivative[[1, 3]] == pytest.approx(_forces(state, before, 1e-3, 0.3))


def test_without_bearing_or_cut_their_terms_vanish() -> None:
    a, b, d = _MACHINE.matrices(0.0, seated=False)
    assert not b.any()
    assert not d.any()
    assert not a[:2, 2:].any()
    assert not a[2:, :2].any()


def test_a_mode_has_the_frequency_and_damping_it_was_given() -> None:
    mode = Mode(0.05, 775.0, 0.05)
    pole = np.roots([mode.mass, mode.damping, mode.stiffness])[0]
    assert abs(pole) == pytest.approx(775.0)
    assert -pole.real / abs(pole) == pytest.approx(0.05)


def test_the_default_bearing_is_half_as_stiff_as_the_workpiece() -> None:
    machine = Machine(workpiece=Mode(0.1, 500.0, 0.0))
    assert machine.bearing_stiffness == 0.5 * machine.workpiece.stiffness
    assert machine.workpiece_stiffness(seated=True) == 1.5 * machine.workpiece.stiffness
    assert machine.workpiece_stiffness(seated=False) == machine.workpiece.stiffness


def test_delay_and_feed_are_those_of_a_turn() -> None:
    cut = Cut(spindle_speed_rpm=3000.0, feed_speed=0.0025)
    assert cut.delay == pytest.approx(0.02)
    assert cut.feed == pytest.approx(50e-6)
    assert paper_initial_state(cut) == pytest.approx([50e-9, 0.0025, 50e-9, 0.0025])


@pytest.mark.parametrize(
    ('changes', 'sentence'),
    [
        (
            {'spindle_speed_rpm': 0},
            'spindle_speed_rpm is 0 rev/min: it must be a finite number from 1 to 100000 rev/min.',
        ),
        (
            {'depth_of_cut': float('nan')},
            'depth_of_cut is nan m: it must be a finite number from 0 to 0.1 m.',
        ),
        (
            {'bearing_contact': 'loose'},
            "bearing_contact is 'loose': it must be one of none, gap, seated, both_sides.",
        ),
        (
            {'speed_variation_frequency': 0.0},
            (
                'speed_variation_frequency is 0.0 Hz: '
                'it must be a finite number above 0 and up to 1000 Hz.'
            ),
        ),
    ],
)
def test_a_cut_that_cannot_be_is_refused(changes: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ParameterError) as refusal:
        Cut(**changes)
    assert str(refusal.value) == sentence
    with pytest.raises(ParameterError):
        Cut().with_changes(**changes)


@pytest.mark.parametrize('mass', [-0.05, 0.0, float('inf'), '0.05', None])
def test_a_mass_that_cannot_be_is_refused(mass: Any) -> None:
    with pytest.raises(ParameterError, match=r'^mass is .*: .*from 1e-06 to 1e\+06 kg'):
        Mode(mass, 775.0, 0.05)


def test_an_unknown_field_is_refused_by_name() -> None:
    with pytest.raises(ParameterError, match=r"'speed'.*one of spindle_speed_rpm, depth_of_cut"):
        Cut().with_changes(speed=3000.0)


def test_a_changed_cut_is_another_value() -> None:
    cut = Cut()
    changed = cut.with_changes(bearing_contact='seated', depth_of_cut=1e-3)
    assert changed.bearing_contact is BearingContact.SEATED
    assert (cut.depth_of_cut, changed.depth_of_cut) == (0.0005, 0.001)
    assert cut == Cut()
    with pytest.raises(FrozenInstanceError):
        cut.depth_of_cut = 1e-3  # type: ignore[misc]  # the very thing that must fail


def test_values_survive_a_pickle() -> None:
    for value in (Cut(bearing_contact=BearingContact.SEATED), _MACHINE):
        assert pickle.loads(pickle.dumps(value)) == value  # noqa: S301 -- our own bytes
