"""VirtualLathe as its users meet it: ticks, changes, snapshots, the guard, memory, refusals."""

from __future__ import annotations

import itertools
import math
import pickle
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lathe_chatter.array_types import Array
from lathe_chatter.errors import ParameterError, StateError
from lathe_chatter.lathe import EventKind, VirtualLathe
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.lathe.integrator import surface
from lathe_chatter.model import BearingContact, Cut, Machine, Mode

_NOISY = Cut(3017.0, 0.8e-3, force_noise=0.05, sensor_noise=1e-7, runout=2e-6)
_SETTINGS: dict[str, dict[str, Any]] = {
    'chatter': {'cut': Cut(3000.0, 1e-3)},
    'linear': {'cut': Cut(3000.0, 1e-3, 1e-6), 'tool_leaves_cut': False},
    'noise': {'cut': _NOISY, 'seed': 11},
    'variation': {
        'cut': Cut(2900.0, 0.9e-3, speed_variation_amplitude=0.3, speed_variation_frequency=7.0)
    },
    'ramps': {'cut': Cut(3000.0, 1e-3), 'spindle_acceleration': 5e4},
    'many steps a sample': {'cut': Cut(180.0, 1e-3), 'sample_rate': 1000.0},
    'few samples': {'cut': Cut(3000.0, 1e-3), 'sample_rate': 100.0},
}
_ALL_SETTINGS = pytest.mark.parametrize('settings', _SETTINGS.values(), ids=_SETTINGS)

_CHANGES: list[Callable[[VirtualLathe], None]] = [
    lambda lathe: lathe.knock(2e-3),
    lambda lathe: lathe.retune(lathe.cut.with_changes(depth_of_cut=0.4e-3)),
    lambda lathe: lathe.retune(lathe.cut.with_changes(spindle_speed_rpm=7777.0)),
    lambda lathe: lathe.retune(lathe.cut.with_changes(bearing_contact='seated')),
    lambda lathe: lathe.knock(-1e-3),
    lambda lathe: lathe.retune(lathe.cut.with_changes(feed_speed=0.01, depth_of_cut=1.2e-3)),
    lambda lathe: lathe.retune(lathe.cut.with_changes(bearing_contact='gap')),
    lambda lathe: lathe.retune(lathe.cut.with_changes(spindle_speed_rpm=1800.0)),
    lambda lathe: lathe.retune(lathe.cut.with_changes(bearing_clearance=1e-6)),
]


def _play(lathe: VirtualLathe, samples: int, rng: np.random.Generator | None) -> Array:
    """Advance with all changes at fixed samples, in random parts or change by change."""
    instants = np.linspace(0, samples, len(_CHANGES) + 2).astype(int)[1:-1]
    blocks = []
    for until, change in zip([*instants, samples], [*_CHANGES, lambda _: None], strict=True):
        while lathe.samples_taken < until:
            left = until - lathe.samples_taken
            part = left if rng is None else min(left, int(rng.geometric(0.03)) - 1)
            blocks.append(lathe.advance(part))
        change(lathe)
    return np.concatenate(blocks)


@_ALL_SETTINGS
@pytest.mark.parametrize('seed', [0, 1, 2])
def test_ticks_do_not_matter(settings: dict[str, Any], seed: int) -> None:
    whole, parted = VirtualLathe(**settings), VirtualLathe(**settings)
    expected = _play(whole, 3000, None)
    found = _play(parted, 3000, np.random.default_rng(seed))
    assert len(expected) == 3000
    assert found.tobytes() == expected.tobytes()
    assert parted.snapshot() == whole.snapshot()


@_ALL_SETTINGS
@pytest.mark.parametrize('when', [0, 1, 13, 192, 1111])
def test_a_restored_lathe_goes_on_bit_for_bit(settings: dict[str, Any], when: int) -> None:
    lathe, other = VirtualLathe(**settings), VirtualLathe(**settings)
    lathe.advance(when)
    saved = lathe.snapshot()
    expected = lathe.advance(400)
    end = lathe.snapshot()
    for machine in (lathe, other):
        machine.restore(saved)
        assert machine.samples_taken == when
        assert machine.advance(400).tobytes() == expected.tobytes()
        assert machine.snapshot() == end


@_ALL_SETTINGS
def test_a_lathe_goes_to_another_process_small_and_goes_on_there(settings: dict[str, Any]) -> None:
    """With its events, and without the room that it keeps for more surface."""
    lathe = VirtualLathe(**settings)
    lathe.advance(3000)
    sent = pickle.dumps(lathe)
    state = lathe.snapshot()
    needed = len(pickle.dumps(state)) + state.constants.flat.nbytes + 24 * len(lathe.events)
    assert len(sent) < needed + 8000
    there = pickle.loads(sent)  # noqa: S301 -- ours
    assert there.events == lathe.events
    assert there.snapshot() == state
    assert there.advance(3000).tobytes() == lathe.advance(3000).tobytes()
    assert there.snapshot() == lathe.snapshot()


def test_a_snapshot_is_a_value_of_its_own() -> None:
    lathe = VirtualLathe()
    lathe.advance(100)
    saved = lathe.snapshot()
    assert saved == lathe.snapshot()
    lathe.advance(1)
    assert saved != lathe.snapshot()
    lathe.restore(saved)
    lathe.knock(1e-9)
    assert saved != lathe.snapshot()
    assert saved != 'a snapshot'


_CONTINUE = """
import sys
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.lathe.state import LatheState
lathe = VirtualLathe.continued(LatheState.load(sys.argv[1]))
sys.stdout.buffer.write(lathe.advance(500).tobytes())
"""


def test_a_saved_state_goes_on_bit_for_bit_in_another_process(tmp_path: Path) -> None:
    lathe = VirtualLathe(cut=_NOISY, seed=5, spindle_acceleration=2e4)
    lathe.advance(777)
    lathe.retune(_NOISY.with_changes(spindle_speed_rpm=5000.0))
    lathe.advance(10)
    file = tmp_path / 'state.npz'
    lathe.snapshot().save(file)
    done = subprocess.run(
        [sys.executable, '-c', _CONTINUE, str(file)], capture_output=True, check=True
    )
    assert done.stdout == lathe.advance(500).tobytes()


def test_a_lathe_of_another_setup_is_not_restored() -> None:
    saved = VirtualLathe(seed=5, sample_rate=2e4).snapshot()
    with pytest.raises(StateError, match='differs from this one in its sample_rate and seed'):
        VirtualLathe().restore(saved)


def test_samples_follow_each_other_in_time_and_angle() -> None:
    lathe = VirtualLathe(cut=Cut(3000.0, 1e-3), sample_rate=8000.0)
    samples = np.concatenate([lathe.advance(n) for n in (0, 1, 799, 4000)])
    assert np.array_equal(samples[:, 0], np.arange(1, 4801) / 8000.0)
    assert samples[:, 1] == pytest.approx(50.0 * samples[:, 0], rel=1e-13)
    assert (lathe.time, lathe.samples_taken) == (0.6, 4800)
    assert lathe.spindle_angle == samples[-1, 1]


def test_events_are_those_of_the_last_call_in_order_and_alternating() -> None:
    lathe = VirtualLathe(cut=Cut(3000.0, 1e-3))
    before, seen = 0.0, []
    for _ in range(200):
        lathe.advance(17)
        assert all(before <= event.time <= lathe.time for event in lathe.events)
        before = lathe.time
        seen += lathe.events
    times = [event.time for event in seen]
    assert times == sorted(times)
    bearing = [event.kind for event in seen if event.kind <= EventKind.BEARING_RELEASES]
    chip = [event.kind for event in seen if event.kind >= EventKind.TOOL_LEAVES_CUT]
    for kinds in (bearing, chip):
        assert len(kinds) > 20
        assert all(a != b for a, b in itertools.pairwise(kinds))
    whole = VirtualLathe(cut=Cut(3000.0, 1e-3))
    whole.advance(200 * 17)
    assert whole.events == seen


def test_a_retune_to_the_same_cut_changes_nothing() -> None:
    lathe, told = VirtualLathe(), VirtualLathe()
    told.advance(100)
    told.retune(Cut())
    told.advance(100)
    lathe.advance(200)
    assert told.snapshot() == lathe.snapshot()


def test_the_guard_ends_a_run_before_a_number_loses_meaning() -> None:
    lathe = VirtualLathe(cut=Cut(3000.0, 1e-3), tool_leaves_cut=False, displacement_limit=1e-3)
    samples = lathe.advance(100_000)
    assert 0 < len(samples) == lathe.samples_taken < 100_000
    assert np.abs(samples[:, [2, 4]]).max() <= 1e-3
    when = (len(samples) + 1) / 1e4
    assert lathe.guard == (
        f'The run ended at {when:.4f} s: a displacement passed 0.001 m, '
        'beyond which this machine has no meaning.'
    )
    assert lathe.advance(10).shape == (0, 8)
    other = VirtualLathe(cut=Cut(3000.0, 1e-3), tool_leaves_cut=False, displacement_limit=1e-3)
    other.restore(lathe.snapshot())
    assert other.guard == lathe.guard
    assert other.advance(10).shape == (0, 8)


@pytest.mark.parametrize('coefficient', [3.5e6, 1e9])
@pytest.mark.parametrize('rate', [10.0, 1e3, 1e5])
def test_no_sample_is_ever_without_a_value(coefficient: float, rate: float) -> None:
    """Growth by hundreds of decades within a sample ends in the guard and not in nan."""
    machine = Machine(cutting_coefficient=coefficient)
    lathe = VirtualLathe(
        machine, Cut(3000.0, 1e-2), tool_leaves_cut=False, sample_rate=rate,
        displacement_limit=1e12,
    )  # fmt: skip
    samples = lathe.advance(20)
    assert np.isfinite(samples).all()
    assert bool(lathe.guard) == (len(samples) < 20)
    assert lathe.guard or coefficient < 1e9 or rate > 10.0


@pytest.mark.parametrize(
    ('cut', 'rate'),
    [
        (Cut(3000.0, 1e-3), 1e4),
        (Cut(300.0, 1e-3), 1e4),
        (_NOISY, 1e4),
        (Cut(3017.0, 1e-3, feed_speed=0.0, force_noise=1.0), 1e3),
        (Cut(3000.0, 0.7e-3, speed_variation_amplitude=0.5, speed_variation_frequency=7.0), 1e4),
        (Cut(3000.0, 1e-3), 100.0),
    ],
    ids=['chatter', 'slow', 'noise', 'noise without feed', 'variation', 'many steps a sample'],
)
def test_memory_does_not_grow_with_the_run(cut: Cut, rate: float) -> None:
    """The surface held late in a run of 20 s is no larger than that held in its first seconds."""
    lathe = VirtualLathe(cut=cut, sample_rate=rate)
    sizes = []
    for _ in range(40):
        lathe.advance(round(0.5 * rate))
        sizes.append(lathe.snapshot().nodes.shape[1])
    assert max(sizes[20:]) <= 1.5 * max(sizes[2:8])


def _jumping(lathe: VirtualLathe, k: int) -> Cut:
    return lathe.cut.with_changes(spindle_speed_rpm=60.0 if k % 2 else 30000.0)


def _flipping(lathe: VirtualLathe, k: int) -> Cut:
    return lathe.cut.with_changes(bearing_contact=('seated', 'gap', 'none')[k % 3])


def _anything(_: VirtualLathe, k: int) -> Cut:
    rng = np.random.default_rng(k)
    return Cut(
        60.0 * 500.0 ** rng.random(), 1e-3 * rng.random(), 1e-5 * rng.random(),
        list(BearingContact)[rng.integers(3)], 0.1 * rng.random() ** 4,
        force_noise=rng.random(), speed_variation_amplitude=0.5 * rng.random(),
        speed_variation_frequency=100.0 * rng.random() + 1e-3,
    )  # fmt: skip


def test_memory_does_not_grow_with_changes_of_speed() -> None:
    """As a controller makes them, some a turn; and no bit depends on what was forgotten when."""
    lathe = VirtualLathe(cut=Cut(3000.0, 0.6e-3))
    other = VirtualLathe(cut=Cut(3000.0, 0.6e-3))
    for k in range(300):
        cut = lathe.cut.with_changes(spindle_speed_rpm=2500.0 + 100.0 * (k % 11))
        lathe.retune(cut)
        other = VirtualLathe.continued(other.snapshot())  # which forgets everything that it can
        other.retune(cut)
        assert lathe.advance(150).tobytes() == other.advance(150).tobytes()
    assert lathe.snapshot().nodes.shape[1] <= lathe._state.nodes.shape[1] < 2500


@pytest.mark.parametrize('change', [_jumping, _flipping, _anything])
@pytest.mark.parametrize('samples', [1, 10, 100])
@pytest.mark.parametrize('acceleration', [0.0, 1e6])
def test_rough_handling(
    change: Callable[[VirtualLathe, int], Cut], samples: int, acceleration: float
) -> None:
    """A change every few samples: finite, complete, repeatable."""
    runs = []
    for _ in range(2):
        lathe = VirtualLathe(cut=Cut(3000.0, 1e-3), spindle_acceleration=acceleration)
        blocks = []
        for k in range(150):
            blocks.append(lathe.advance(samples))
            lathe.retune(change(lathe, k))
        runs.append(np.concatenate(blocks))
    assert runs[0].tobytes() == runs[1].tobytes()
    assert runs[0].shape == (150 * samples, 8)
    assert np.isfinite(runs[0]).all()
    assert (np.diff(runs[0][:, 1]) > 0.0).all()


_EXTREMES = {
    'slowest': ({}, {'spindle_speed_rpm': 60.0}),
    'fastest': ({}, {'spindle_speed_rpm': 30000.0}),
    'no clearance': ({}, {'bearing_clearance': 0.0}),
    'no depth': ({}, {'depth_of_cut': 0.0}),
    'no feed': ({}, {'feed_speed': 0.0}),
    'deepest': ({}, {'depth_of_cut': 1e-2}),
    'undamped': ({'tool': Mode(0.05, 775.0, 0.0)}, {}),
    'overdamped': ({'tool': Mode(0.05, 775.0, 1.0)}, {}),
    'soft': ({'tool': Mode(0.05, 1e-3, 0.05)}, {}),
    'stiff': ({'tool': Mode(0.05, 1e5, 0.05)}, {}),
    'heavy': ({'workpiece': Mode(1e4, 650.0, 0.05)}, {}),
    'no bearing stiffness': ({'bearing_stiffness': 0.0}, {}),
    'a wall for a bearing': ({'bearing_stiffness': 1e9}, {}),
}


@pytest.mark.parametrize('rate', [10.0, 1e4, 1e6])
@pytest.mark.parametrize(('machine', 'cut'), _EXTREMES.values(), ids=_EXTREMES)
def test_extreme_machines_and_cuts(
    machine: dict[str, Any], cut: dict[str, Any], rate: float
) -> None:
    """The samples are finite and complete, or the guard says why not."""
    lathe = VirtualLathe(Machine(**machine), Cut(**{'depth_of_cut': 1e-3} | cut), sample_rate=rate)
    samples = lathe.advance(50)
    assert np.isfinite(samples).all()
    assert (len(samples) == 50) != bool(lathe.guard)
    assert (samples[:, 6] >= 0.0).all()


@pytest.mark.parametrize(
    ('settings', 'sentence'),
    [
        (
            {'sample_rate': 1.0},
            'sample_rate is 1.0 Hz: it must be a finite number from 10 to 1e+06 Hz.',
        ),
        ({'sample_rate': math.nan}, 'sample_rate is nan Hz: '),
        ({'seed': -1}, 'seed is -1: '),
        ({'seed': 0.5}, 'seed is 0.5: '),
        ({'spindle_acceleration': -1.0}, 'spindle_acceleration is -1.0 rev/min per s: '),
        ({'displacement_limit': 0.0}, 'displacement_limit is 0.0 m: '),
        ({'initial_state': (0.0, 0.0, 0.0)}, r'initial_state is \(0.0, 0.0, 0.0\): .*four'),
        ({'initial_state': 0.0}, 'initial_state is 0.0: .*four'),
        ({'initial_state': (0.0, math.inf, 0.0, 0.0)}, 'initial_state is inf'),
    ],
)
def test_a_wrong_setting_is_refused(settings: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ParameterError, match='^' + sentence.replace('+', r'\+')):
        VirtualLathe(**settings)


def test_a_mass_too_small_for_any_step_is_refused() -> None:
    """1e-20 kg in this cut would need 10^12 steps per second."""
    with pytest.raises(ParameterError):
        VirtualLathe(Machine(tool=Mode(1e-20, 775.0, 0.05)), Cut(3000.0, 1e-3))


@pytest.mark.parametrize('impulse', [math.nan, math.inf, 1e7, '1'])
def test_a_wrong_knock_is_refused_and_does_nothing(impulse: Any) -> None:
    lathe = VirtualLathe()
    before = lathe.snapshot()
    with pytest.raises(ParameterError, match=r'^impulse is .*: it must be .* N s'):
        lathe.knock(impulse)
    assert lathe.snapshot() == before


@pytest.mark.parametrize('samples', [-1, 1.5, '3'])
def test_a_wrong_number_of_samples_is_refused(samples: Any) -> None:
    with pytest.raises(ParameterError, match=r'^samples is .*: it must be a whole number'):
        VirtualLathe().advance(samples)


@pytest.mark.parametrize(
    ('call', 'words'),
    [
        (lambda: Machine(tool=5), 'tool is 5: it must be a Mode'),  # type: ignore[arg-type]
        (lambda: VirtualLathe(machine=3), 'machine is 3: it must be a Machine'),  # type: ignore[arg-type]
        (lambda: VirtualLathe(cut={}), 'it must be a Cut'),  # type: ignore[arg-type]
        (lambda: VirtualLathe().retune(None), 'cut is None: it must be a Cut'),  # type: ignore[arg-type]
        (lambda: VirtualLathe().advance(samples=True), 'samples is True'),
        (lambda: VirtualLathe().advance(2.0), 'samples is 2.0'),  # type: ignore[arg-type]
    ],
)
def test_what_is_of_another_kind_is_refused(call: Callable[[], Any], words: str) -> None:
    with pytest.raises(ParameterError, match=words):
        call()


def test_two_corners_of_the_surface_at_one_place_are_met_one_after_the_other() -> None:
    """An event less than a millionth of a step before the grid leaves a second node there.

    A lathe once stood still at such a pair for ever (force_noise 0.05, after 774 s).
    """
    lathe = VirtualLathe(cut=Cut(depth_of_cut=0.001, bearing_contact='none'))
    lathe.advance(8000)  # the tool leaves the cut in every vibration by now
    state = lathe.snapshot()
    pointer, head = (int(state.counts[k]) for k in (layout.POINTER, layout.HEAD))
    corners = [
        k
        for k in range(pointer + 2, head - 1)
        if state.nodes[surface.ORDER, k] <= surface.LAST_ORDER
    ]
    assert corners
    doubled = state.copy()
    place = corners[0]
    nodes = np.insert(state.nodes, place + 1, state.nodes[:, place], axis=1)
    nodes[surface.SLOPE_AFTER, place] = nodes[surface.SLOPE_BEFORE, place]
    nodes[surface.CURVATURE_AFTER, place] = nodes[surface.CURVATURE_BEFORE, place]
    nodes[surface.SLOPE_BEFORE, place + 1] = nodes[surface.SLOPE_AFTER, place]
    nodes[surface.CURVATURE_BEFORE, place + 1] = nodes[surface.CURVATURE_AFTER, place]
    doubled.nodes = nodes
    doubled.counts[layout.HEAD] += 1
    went_on = VirtualLathe.continued(doubled).advance(400)
    usual = VirtualLathe.continued(state).advance(400)
    assert went_on == pytest.approx(usual, rel=1e-6, abs=1e-12)


def test_a_long_cut_answers_a_signal() -> None:
    samples = 5_000_000

    def interrupt(_number: int, _frame: object) -> None:
        raise KeyboardInterrupt

    lathe = VirtualLathe()
    lathe.advance(10)
    before = signal.signal(signal.SIGALRM, interrupt)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.02)
        with pytest.raises(KeyboardInterrupt):
            lathe.advance(samples)
    finally:
        signal.signal(signal.SIGALRM, before)
    assert 10 < lathe.samples_taken < samples
    # What it has cut by then it has cut as ever.
    whole = VirtualLathe()
    whole.advance(lathe.samples_taken)
    assert (lathe.advance(1000) == whole.advance(1000)).all()
