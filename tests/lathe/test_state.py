"""A lathe's memory in a file: the same bits come back, anything else is refused in a sentence."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from lathe_chatter.errors import ParameterError, StateError
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.lathe.state import LatheState
from lathe_chatter.model import BearingContact, Cut, Machine, Mode
from lathe_chatter.model.machine import RIGID
from lathe_chatter.model.machine_and_sampling import LatheSetup

_MACHINE = Machine(Mode(0.04, 800.0, 0.03), Mode(0.06, 600.0, 0.04), cutting_coefficient=3e6)


def _some_state() -> LatheState:
    cut = Cut(3001.7, 1e-3, bearing_contact=BearingContact.GAP, speed_variation_amplitude=0.1)
    lathe = VirtualLathe(_MACHINE, cut, sample_rate=12e3, seed=3, displacement_limit=0.1)
    lathe.advance(4321)
    return lathe.snapshot()


def test_a_state_comes_back_from_its_file_bit_for_bit(tmp_path: Path) -> None:
    state = _some_state()
    state.save(tmp_path / 'state.npz')
    assert LatheState.load(tmp_path / 'state.npz') == state


def test_a_run_that_has_ended_stays_ended(tmp_path: Path) -> None:
    lathe = VirtualLathe(cut=Cut(3000.0, 1e-3), tool_leaves_cut=False, displacement_limit=1e-5)
    lathe.advance(20_000)
    assert lathe.guard
    lathe.snapshot().save(tmp_path / 'state.npz')
    again = VirtualLathe.continued(LatheState.load(tmp_path / 'state.npz'))
    assert again.guard == lathe.guard
    assert len(again.advance(10)) == 0


@pytest.mark.parametrize('content', [b'', b'nonsense', b'PK\x03\x04 nonsense'])
def test_what_is_no_saved_state_is_refused(content: bytes, tmp_path: Path) -> None:
    file = tmp_path / 'state.npz'
    file.write_bytes(content)
    with pytest.raises(StateError, match=r'state.npz is not the saved state of a lathe\.$'):
        LatheState.load(file)


@pytest.mark.parametrize('array', ['numbers', 'counts', 'nodes'])
def test_a_state_without_all_of_its_memory_is_refused(array: str, tmp_path: Path) -> None:
    file = tmp_path / 'state.npz'
    state = _some_state()
    state.save(file)
    with np.load(file) as saved:
        parts = dict(saved)
    parts[array] = parts[array][:-1]
    np.savez(file, **parts)
    with pytest.raises(StateError, match='but damaged'):
        LatheState.load(file)


def test_a_state_of_another_format_is_refused(tmp_path: Path) -> None:
    file = tmp_path / 'state.npz'
    _some_state().save(file)
    with np.load(file) as saved:
        parts = dict(saved)
    parts['words'] = np.array(str(parts['words']).replace('"format": 3', '"format": 99'))
    np.savez(file, **parts)
    with pytest.raises(StateError, match='format 99, and this version continues from format 3'):
        LatheState.load(file)


@pytest.mark.parametrize(
    ('options', 'sentence'),
    [
        ({'sample_rate': float('nan')}, 'sample_rate is nan Hz: .*from 10 to 1e'),
        ({'seed': 1.5}, 'seed is 1.5: it must be a whole number'),
        ({'seed': True}, 'seed is True: it must be a whole number'),
        ({'seed': -1}, 'seed is -1: '),
        ({'machine': 'lathe'}, "machine is 'lathe': it must be a Machine"),
        ({'tool_leaves_cut': 'no'}, "tool_leaves_cut is 'no': it must be True or False"),
    ],
)
def test_a_setup_that_makes_no_sense_is_refused(options: dict[str, object], sentence: str) -> None:
    with pytest.raises(ParameterError, match=sentence):
        LatheSetup(**options)  # type: ignore[arg-type]  # the point of the test


@pytest.mark.parametrize('column', [2, 4], ids=['tool', 'workpiece'])
def test_a_rigid_body_stands_still_where_the_other_starts_as_the_paper_has_it(column: int) -> None:
    """Its 2e12 N/m leave it what the force pushes it by: it had started with the paper's speed."""
    body, cut = (
        Mode(2.0, 2.0 * math.pi * 450.0, 0.03),
        Cut(depth_of_cut=1e-4, bearing_contact='none'),
    )
    bodies = (RIGID, body) if column == 2 else (body, RIGID)
    lathe = VirtualLathe(Machine(*bodies, cutting_coefficient=9e8), cut)
    samples = np.vstack([lathe.snapshot().motion(), lathe.advance(2000)[:, 2:6]])
    still, moving = (samples[:, k : k + 2] for k in (column - 2, 4 - column))
    force = 9e8 * 1e-4 * 5.0 * cut.feed
    assert np.abs(still[:, 0]).max() < force / 2e12
    assert moving[0] == pytest.approx([50e-9, 0.0025])
