"""Many lathes in one call: each must cut bit for bit as it does alone."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import nullcontext
from functools import partial
from typing import Any

import numpy as np
import pytest

from lathe_chatter.array_types import Array
from lathe_chatter.errors import ParameterError
from lathe_chatter.executors import Processes
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.lathe.many_lathes import LatheSweep
from lathe_chatter.model import Cut
from lathe_chatter.samples import SAMPLE_COLUMNS

_PER_TURN = 50


def _lathe(cut: Cut, per_turn: int = _PER_TURN, **options: Any) -> VirtualLathe:
    rate = per_turn * cut.spindle_speed_rpm / 60.0
    return VirtualLathe(cut=cut, sample_rate=rate, **options)


def _assorted() -> list[VirtualLathe]:
    """Lathes that are quiet, that touch, that leave the cut, that are noisy, that end."""
    quiet = [Cut(speed, 0.2e-3) for speed in np.linspace(2900.0, 3100.0, 11)]
    gaps = [Cut(3000.0, 0.5e-3, clearance) for clearance in (0.2e-6, 2e-6, 5e-5)]
    knocked = [_lathe(cut) for cut in gaps]
    for lathe in knocked:
        lathe.knock(1e-3)
    return [
        *(_lathe(cut) for cut in quiet),
        *(_lathe(cut) for cut in gaps),
        *knocked,
        _lathe(Cut(3000.0, 1.2e-3)),
        _lathe(Cut(3000.0, 1.2e-3), tool_leaves_cut=False),
        _lathe(Cut(3000.0, 1.2e-3), tool_leaves_cut=False, displacement_limit=1e-3),
        _lathe(Cut(3000.0, 0.3e-3, force_noise=0.01, runout=1e-6), seed=5),
        _lathe(Cut(3000.0, 0.3e-3, sensor_noise=1e-7), seed=6),
        _lathe(Cut(3000.0, 0.3e-3, speed_variation_amplitude=0.1, speed_variation_frequency=2.0)),
        _lathe(Cut(1200.0, 0.3e-3, bearing_contact='seated')),
        VirtualLathe(cut=Cut(3017.3, 0.3e-3)),
    ]


def _alone(lathes: list[VirtualLathe], samples: int) -> list[Array]:
    """The same lathes one by one."""
    return [VirtualLathe.continued(lathe.snapshot()).advance(samples) for lathe in lathes]


@pytest.mark.parametrize('kind', [partial(ThreadPoolExecutor, 1), partial(Processes, 2), None])
def test_each_lathe_cuts_as_it_does_alone(kind: Callable[[], Executor] | None) -> None:
    """Bit for bit, in whatever parts it is asked for, and whoever does it."""
    lathes, total = _assorted(), 40 * _PER_TURN
    sweep = LatheSweep(lathes)
    rng = np.random.default_rng(1)
    parts: list[Array] = []
    with kind() if kind else nullcontext() as executor:
        while (left := total - sum(map(len, parts))) > 0:
            parts.append(sweep.advance(min(left, int(rng.integers(0, 400))), executor=executor))
    samples = np.concatenate(parts)
    assert samples.shape == (total, len(lathes), len(SAMPLE_COLUMNS))
    assert np.isfinite(samples).all()
    for place, expected in enumerate(_alone(lathes, total)):
        assert samples[: len(expected), place].tobytes() == expected.tobytes(), place


def test_lathes_go_on_alone_where_the_sweep_left_them() -> None:
    """What is taken out of a sweep continues bit for bit; the sweep does too."""
    lathes = _assorted()
    sweep = LatheSweep(lathes)
    sweep.advance(12 * _PER_TURN + 7)
    taken = sweep.lathes()
    after = sweep.advance(3 * _PER_TURN)
    for place, (lathe, first) in enumerate(zip(taken, lathes, strict=True)):
        assert lathe.guard or lathe.samples_taken == 12 * _PER_TURN + 7
        expected = VirtualLathe.continued(first.snapshot())
        expected.advance(12 * _PER_TURN + 7)
        assert lathe.snapshot() == expected.snapshot()
        onward = lathe.advance(3 * _PER_TURN)
        assert onward.tobytes() == expected.advance(3 * _PER_TURN).tobytes(), place
        assert after[: len(onward), place].tobytes() == onward.tobytes(), place


def test_several_steps_a_sample_and_samples_of_any_number() -> None:
    """An event in the middle of a sample is no obstacle, nor is a turn of one sample."""
    cuts = [Cut(600.0, depth, 1e-6) for depth in (0.1e-3, 0.4e-3, 0.8e-3)]
    for per_turn in (1, 7):
        lathes = [_lathe(cut, per_turn) for cut in cuts]
        samples = LatheSweep(lathes).advance(30 * per_turn)
        for place, expected in enumerate(_alone(lathes, 30 * per_turn)):
            assert samples[:, place].tobytes() == expected.tobytes(), (per_turn, place)


def test_a_lathe_that_its_guard_ended_stands_still() -> None:
    """No inf, no nan: its last sample, with its time, is repeated in every later call."""
    doomed = _lathe(Cut(3000.0, 1.5e-3), tool_leaves_cut=False, displacement_limit=1e-4)
    calm = _lathe(Cut(3000.0, 0.1e-3), tool_leaves_cut=False)
    sweep = LatheSweep([doomed, calm])
    samples = np.concatenate([sweep.advance(100 * _PER_TURN), sweep.advance(3)])
    (expected,) = _alone([doomed], 100 * _PER_TURN)
    assert 0 < len(expected) < 100 * _PER_TURN
    assert (samples[len(expected) :, 0] == expected[-1]).all()
    assert 'displacement passed' in sweep.lathes()[0].guard
    assert not sweep.lathes()[1].guard


def test_columns_are_those_asked_for() -> None:
    """Any of them, in any order."""
    lathes = _assorted()
    wanted = ['cutting_force', 'time', 'tool_displacement']
    places = [SAMPLE_COLUMNS.index(name) for name in wanted]
    some = LatheSweep(lathes).advance(20 * _PER_TURN, columns=wanted)
    every = LatheSweep(lathes).advance(20 * _PER_TURN)
    assert np.array_equal(some, every[:, :, places])


def test_many_events_and_a_growing_surface() -> None:
    """Chatter with contact and loss of cut: more nodes and events than there was room for."""
    lathes = [_lathe(Cut(3000.0, w, 5e-6), 100) for w in (1e-3, 1.3e-3, 1.6e-3)]
    samples = LatheSweep(lathes).advance(60 * 100)
    for place, expected in enumerate(_alone(lathes, 60 * 100)):
        assert samples[:, place].tobytes() == expected.tobytes(), place


@pytest.mark.parametrize(
    ('call', 'words'),
    [
        (lambda: LatheSweep([]), 'at least one VirtualLathe'),
        (lambda: LatheSweep([3]), 'lathes is 3'),
        (lambda: _sweep().advance(1, columns='time'), 'a list of some of time'),
        (lambda: _sweep().advance(-1), 'samples'),
        (lambda: _sweep().advance(1.5), 'samples'),
        (lambda: _sweep().advance(1, columns=['tool_position']), 'tool_displacement'),
    ],
)
def test_what_is_refused(call: Any, words: str) -> None:
    """One sentence that names the field and what is allowed."""
    with pytest.raises(ParameterError, match=words):
        call()


def _sweep() -> LatheSweep:
    return LatheSweep([_lathe(Cut())])
