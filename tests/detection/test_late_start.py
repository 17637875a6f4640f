"""Who begins to listen in the middle of a cut says nothing of it before it can know."""

from __future__ import annotations

import math
from functools import lru_cache

import pytest

from lathe_chatter.array_types import Array
from lathe_chatter.detection import ChatterDetector
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import Cut, Machine, Mode
from lathe_chatter.model.machine_file import load_machine
from lathe_chatter.samples import SAMPLE_COLUMNS
from lathe_chatter.stability import rightmost_root

_TURN = 2.0 * math.pi
_SHOP = Machine(
    Mode(2.0, _TURN * 300.0, 0.03), Mode(20.0, _TURN * 120.0, 0.03), cutting_coefficient=1.5e9
)
_PAPER = Machine()
_BATCH = 100
_TOLD = ['machine', 'nothing', 'no angle']


@lru_cache
def _cut_for_long(machine: Machine, rpm: float, depth: float, noise: float) -> Array:
    """The samples from 12 s to 16 s of a cut."""
    cut = Cut(
        spindle_speed_rpm=rpm, depth_of_cut=depth, bearing_contact='none', force_noise=noise,
        feed_per_revolution=2e-4, feed_speed=2e-4 * rpm / 60.0,
    )  # fmt: skip
    lathe = VirtualLathe(machine, cut)
    lathe.advance(120_000)
    return lathe.advance(40_000)


def _states(machine: Machine, samples: Array, told: str) -> list[tuple[float, str]]:
    """Seconds since the start and the state, after each batch."""
    detector = ChatterDetector(machine if told == 'machine' else None)
    names = [name for name in SAMPLE_COLUMNS if told != 'no angle' or name != 'spindle_angle']
    kept = samples[:, [SAMPLE_COLUMNS.index(name) for name in names]]
    batches = [kept[k : k + _BATCH] for k in range(0, len(kept), _BATCH)]
    found = [detector.update(batch, names) for batch in batches]
    return [(each.time - samples[0, 0], each.state) for each in found]


@pytest.mark.parametrize('told', _TOLD)
@pytest.mark.parametrize('begin', [0, 3700])
@pytest.mark.parametrize(
    ('machine', 'rpm', 'depth', 'noise'),
    [
        (_SHOP, 1200.0, 0.35e-3, 0.0),
        (_SHOP, 1200.0, 0.35e-3, 0.01),
        (_PAPER, 3000.0, 1e-3, 0.0),
        (_PAPER, 10000.0, 1e-3, 4.5e-4),
    ],
)
def test_chatter_that_has_grown_before_is_never_called_stable(
    machine: Machine, rpm: float, depth: float, noise: float, begin: int, told: str
) -> None:
    assert rightmost_root(machine, rpm, depth, seated=False).real > 0.0
    samples = _cut_for_long(machine, rpm, depth, noise)[begin:]
    seen = [state for _, state in _states(machine, samples, told)]
    assert {*seen[: seen.index('chatter')]} <= {'unknown', 'watch'}


@pytest.mark.parametrize('told', _TOLD)
@pytest.mark.parametrize(
    ('machine', 'rpm', 'depth', 'noise'),
    [(_SHOP, 1200.0, 0.2e-3, 0.01), (_PAPER, 3000.0, 0.3e-3, 4.5e-4)],
)
def test_a_stable_cut_is_called_so_within_two_seconds(
    machine: Machine, rpm: float, depth: float, noise: float, told: str
) -> None:
    assert rightmost_root(machine, rpm, depth, seated=False).real < 0.0
    seen = _states(machine, _cut_for_long(machine, rpm, depth, noise), told)
    assert next(time for time, state in seen if state == 'stable') < 2.0
    assert {state for time, state in seen if time > 2.0} <= {'stable', 'watch'}


@pytest.mark.parametrize('told', [True, False])
@pytest.mark.parametrize(
    ('depth', 'noise', 'is_chatter'),
    [(1.2e-3, 0.05, True), (2e-3, 0.05, True), (0.2e-3, 0.05, False), (0.3e-3, 0.5, False)],
)
def test_chatter_that_never_repeats_itself_is_not_called_stable(
    depth: float, noise: float, is_chatter: bool, told: bool
) -> None:
    """Far beyond the limit, 0.326 mm, of a machine of several modes, where nothing is steady."""
    described = load_machine('chucked_shaft')
    cut = described.cut.with_changes(depth_of_cut=depth, force_noise=noise)
    lathe = VirtualLathe(described.machine, cut=cut)
    lathe.advance(100_000)
    detector = ChatterDetector(described.machine if told else None)
    seen = {detector.update(lathe.advance(_BATCH), lathe.columns).state for _ in range(800)}
    assert ('stable' in seen) is not is_chatter
    assert 'idle' not in seen
