"""The detector in service: what may happen to a cut and its sensors, by name.

Whether a cut is stable is told by its rightmost characteristic root.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from lathe_chatter.array_types import Array
from lathe_chatter.detection import ChatterDetector, Estimate
from lathe_chatter.errors import LayoutError
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import Cut, Machine, Mode
from lathe_chatter.samples import SAMPLE_COLUMNS
from lathe_chatter.stability import critical_depth, rightmost_root

_BATCH = 100
_HEAVY = Machine(
    Mode(1.2, 2.0 * np.pi * 450.0, 0.025),
    Mode(8.0, 2.0 * np.pi * 180.0, 0.04),
    cutting_coefficient=1.2e9,
)
"""As somebody told it who tried the package."""
_TOOL, _WORKPIECE = (
    SAMPLE_COLUMNS.index(f'{part}_displacement') for part in ('tool', 'workpiece')
)
_FORCE_NOISE, _SENSOR_NOISE = 4.5e-4, 1e-7
"""N/sqrt(Hz) and m, as in a workshop."""


def _cut(depth: float = 0.3e-3, **fields: Any) -> Cut:
    usual = {
        'spindle_speed_rpm': 3000.0,
        'bearing_contact': 'none',
        'force_noise': _FORCE_NOISE,
        'sensor_noise': _SENSOR_NOISE,
    }
    return Cut(depth_of_cut=depth, **{**usual, **fields})


def _limit(rpm: float = 3000.0, *, seated: bool = False) -> float:
    return critical_depth(Machine(), rpm, seated=seated)


def _watch(
    detector: ChatterDetector, samples: Array, columns: tuple[str, ...] = SAMPLE_COLUMNS
) -> list[Estimate]:
    return [
        detector.update(samples[start : start + _BATCH], columns)
        for start in range(0, len(samples), _BATCH)
    ]


def _seconds(lathe: VirtualLathe, duration: float) -> Array:
    return lathe.advance(round(duration * lathe.sample_rate))


def _play(
    steps: list[tuple[float, dict[str, Any]]], start: Cut | None = None, **settings: Any
) -> Array:
    """Samples of a lathe that is changed after each of some times, s."""
    lathe = VirtualLathe(cut=start or _cut(), **settings)
    blocks = []
    for duration, changes in steps:
        blocks.append(_seconds(lathe, duration))
        lathe.retune(lathe.cut.with_changes(**changes))
    return np.concatenate([*blocks, _seconds(lathe, 2.0)])


def _flagged(estimates: list[Estimate]) -> bool:
    return any(estimate.chatter for estimate in estimates)


_STABLE: dict[str, Callable[[], Array]] = {
    'speed steps': lambda: _play([(2.0, {'spindle_speed_rpm': 3600.0}), (2.0, {})]),
    'speed ramps': lambda: _play(
        [(2.0, {'spindle_speed_rpm': 9000.0}), (3.0, {'spindle_speed_rpm': 3000.0}), (3.0, {})],
        spindle_acceleration=3000.0,
    ),
    'speed variation': lambda: _play(
        [(2.0, {'speed_variation_amplitude': 0.1, 'speed_variation_frequency': 1.0}), (2.0, {})]
    ),
    'depth steps': lambda: _play(
        [(2.0, {'depth_of_cut': 0.9 * _limit()}), (2.0, {'depth_of_cut': 0.1e-3}), (1.0, {})]
    ),
    'clearance changes': lambda: _play(
        [(2.0, {'bearing_clearance': 2e-6}), (2.0, {'bearing_clearance': 8e-6})],
        _cut(0.2e-3, bearing_contact='gap'),
    ),
    'contact changes': lambda: _play(
        [(2.0, {'bearing_contact': 'seated'}), (2.0, {'bearing_contact': 'none'})]
    ),
    'feed changes': lambda: _play([(2.0, {'feed_speed': 0.01}), (2.0, {'feed_speed': 0.001})]),
    'tool out of cut and back': lambda: _play(
        [(2.0, {'feed_speed': 0.0}), (0.5, {'depth_of_cut': 0.0}), (1.0, {'depth_of_cut': 3e-4})]
    ),
    'runout and unbalance': lambda: _play([(2.0, {'runout': 2e-5}), (2.0, {})]),
    'sensor noise': lambda: _play([(2.0, {}), (2.0, {})], _cut(sensor_noise=2e-6)),
    'no noise at all': lambda: _play([(2.0, {})], _cut(force_noise=0.0, sensor_noise=0.0)),
}


@pytest.mark.parametrize('story', _STABLE.values(), ids=_STABLE)
def test_what_a_stable_cut_goes_through_is_no_chatter(story: Callable[[], Array]) -> None:
    """Every cut on the way is stable by its root."""
    seen = _watch(ChatterDetector(), story())
    assert not _flagged(seen)
    assert all(np.isfinite(estimate.time) for estimate in seen[1:])


def test_a_knock_that_dies_out_is_no_chatter() -> None:
    """The energy jumps as no growth explains."""
    lathe, detector, seen = VirtualLathe(cut=_cut(0.5 * _limit())), ChatterDetector(), []
    for impulse in (0.0, 1e-4, -1e-3, 1e-3):
        lathe.knock(impulse)
        seen += _watch(detector, _seconds(lathe, 2.0))
    assert not _flagged(seen)


def test_ramps_are_not_judged() -> None:
    """While the speed changes the state is unknown; later it is stable."""
    lathe = VirtualLathe(cut=_cut(), spindle_acceleration=3000.0)
    detector = ChatterDetector()
    assert _watch(detector, _seconds(lathe, 3.0))[-1].state == 'stable'
    lathe.retune(lathe.cut.with_changes(spindle_speed_rpm=6000.0))
    assert _watch(detector, _seconds(lathe, 0.5))[-1].state == 'unknown'
    assert _watch(detector, _seconds(lathe, 4.0))[-1].state == 'stable'


def test_a_machine_at_rest_or_without_a_cut_is_idle() -> None:
    """Nothing is cut: no state of a cut is said."""
    seen = _watch(ChatterDetector(), _seconds(VirtualLathe(cut=_cut(0.0, force_noise=0.0)), 3.0))
    assert seen[-1].state == 'idle'
    still = np.zeros((20_000, 8))
    still[:, 0] = np.arange(1, 20_001) / 1e4
    still[:, 2:6] = 1e-7 * np.random.default_rng(0).standard_normal((20_000, 4))
    assert _watch(ChatterDetector(), still)[-1].state == 'idle'


@pytest.mark.parametrize('rate', [3e-7, 1e-6, 1e-5])
@pytest.mark.parametrize('machine', [Machine(), None])
def test_a_sensor_that_drifts_through_zero_makes_no_cut_idle(
    rate: float, machine: Machine | None
) -> None:
    """The tool is pushed aside by -1.9 um, which the drift takes away; what is cut, is cut."""
    samples = _seconds(VirtualLathe(cut=_cut()), 3.0 + 3e-6 / rate)
    samples[:, _TOOL] += rate * np.maximum(samples[:, 0] - 3.0, 0.0)
    assert 'idle' not in {each.state for each in _watch(ChatterDetector(machine), samples)}


@pytest.mark.parametrize('change', [{'depth_of_cut': 0.0}, {'feed_speed': 0.0}])
def test_a_noisy_cut_that_ends_is_idle(change: dict[str, float]) -> None:
    samples = _play([(6.0, change)])
    assert _watch(ChatterDetector(), samples)[-1].state == 'idle'


def test_vibration_that_is_the_spindles_own_is_forced() -> None:
    """A runout large enough to be told, of a stable cut: once per turn it repeats."""
    seen = _watch(ChatterDetector(), _seconds(VirtualLathe(cut=_cut(runout=1e-4)), 4.0))
    assert seen[-1].state == 'forced'
    assert seen[-1].once_per_turn < 0.2
    assert not _flagged(seen)


def _chatter(duration: float = 3.0, **fields: Any) -> Array:
    """A cut that chatters from the start."""
    return _seconds(VirtualLathe(cut=_cut(1.5 * _limit(), **fields)), duration)


def _quantised(samples: Array) -> Array:
    samples[:, [_TOOL, _WORKPIECE]] = np.round(samples[:, [_TOOL, _WORKPIECE]] / 1e-6) * 1e-6
    return samples


def _clipped(samples: Array) -> Array:
    for column in (_TOOL, _WORKPIECE):
        middle = np.median(samples[:, column])
        samples[:, column] = np.clip(samples[:, column], middle - 1e-5, middle + 1e-5)
    return samples


def _with_gaps(samples: Array) -> Array:
    kept = np.ones(len(samples), bool)
    for start in range(3000, len(samples), 5000):
        kept[start : start + 200] = False
    return samples[kept]


_SENSORS: dict[str, Callable[[Array], Array]] = {
    'quantised': _quantised,
    'clipped': _clipped,
    'lost batches': _with_gaps,
    'as it is': lambda samples: samples,
}


@pytest.mark.parametrize('sensor', _SENSORS.values(), ids=_SENSORS)
def test_chatter_is_seen_through_poor_sensors(sensor: Callable[[Array], Array]) -> None:
    """And the same sensor raises no alarm in a stable cut."""
    assert _flagged(_watch(ChatterDetector(), sensor(_chatter())))
    stable = _seconds(VirtualLathe(cut=_cut()), 5.0)
    assert not _flagged(_watch(ChatterDetector(), sensor(stable)))


def test_saturated_chatter_from_the_first_sample_is_said() -> None:
    """A monitor that is started late has never seen the cut stable."""
    samples = _chatter(6.0)
    detector = ChatterDetector()
    seen = _watch(detector, samples[40_000:])
    assert seen[-1].chatter
    assert seen[-1].state == 'chatter'


def test_the_alarm_is_latched_and_clears_once_the_chatter_has_died_out() -> None:
    """It stays while the amplitude no longer grows, and goes when it is gone."""
    lathe, detector = VirtualLathe(cut=_cut(1.5 * _limit())), ChatterDetector()
    seen = _watch(detector, _seconds(lathe, 8.0))
    first = next(place for place, estimate in enumerate(seen) if estimate.chatter)
    assert all(estimate.chatter for estimate in seen[first:])
    lathe.retune(lathe.cut.with_changes(depth_of_cut=0.2e-3))
    after = _watch(detector, _seconds(lathe, 4.0))
    assert not after[-1].chatter
    assert after[-1].state == 'stable'


def test_time_that_jumps_back_begins_anew() -> None:
    """After a reset of the lathe the same samples give the same decisions."""
    samples = _chatter(2.0)
    detector = ChatterDetector()
    once = _watch(detector, samples)
    assert once[-1].chatter
    again = _watch(detector, samples)
    assert not again[0].chatter
    assert repr(again[-1]) == repr(once[-1])


def test_a_sample_that_is_no_number_counts_as_lost() -> None:
    """Neither an exception nor an alarm; later samples are judged as ever."""
    samples = _seconds(VirtualLathe(cut=_cut()), 4.0)
    samples[12_345, _TOOL] = np.nan
    samples[23_456, _WORKPIECE] = np.inf
    seen = _watch(ChatterDetector(), samples)
    assert not _flagged(seen)
    assert seen[-1].state == 'stable'


@pytest.mark.parametrize('before', [1, 20, 32, 33])
def test_a_gap_after_the_first_few_samples_is_survived(before: int) -> None:
    """A stretch too short to know its sample rate by is forgotten."""
    lathe, detector = VirtualLathe(cut=_cut()), ChatterDetector()
    detector.update(lathe.advance(before), SAMPLE_COLUMNS)
    lathe.advance(20)
    assert _watch(detector, _seconds(lathe, 3.0))[-1].state == 'stable'


@pytest.mark.parametrize('begin', [0, 5, 32])
def test_displacements_that_are_no_numbers_at_first_are_survived(begin: int) -> None:
    """Sensors that begin late, or fail while the sample rate is not known yet."""
    samples = _seconds(VirtualLathe(cut=_cut()), 3.0)
    samples[begin : begin + 50, [_TOOL, _WORKPIECE]] = np.nan
    assert _watch(ChatterDetector(), samples)[-1].state == 'stable'


def test_two_lathes_on_one_topic_are_no_exception() -> None:
    """Blocks of both come in turn, some backwards, some without numbers."""
    rng = np.random.default_rng(0)
    lathes, detector = [VirtualLathe(cut=_cut(1e-3)) for _ in range(2)], ChatterDetector()
    for _ in range(400):
        samples = lathes[rng.integers(0, 2)].advance(int(rng.integers(0, 200)))
        if rng.random() < 0.1:
            samples = samples[::-1].copy()
        if rng.random() < 0.05:
            samples[:] = np.nan
        detector.update(samples, SAMPLE_COLUMNS)


def _without(*dropped: str) -> tuple[list[int], tuple[str, ...]]:
    kept = [place for place, name in enumerate(SAMPLE_COLUMNS) if name not in dropped]
    return kept, tuple(SAMPLE_COLUMNS[place] for place in kept)


_LESS: dict[str, tuple[tuple[str, ...], bool]] = {
    'FULL': ((), True),
    'NO_MACHINE': ((), False),
    'ONE_SENSOR': (('workpiece_displacement', 'workpiece_velocity'), True),
    'NO_SPINDLE': (('spindle_angle', 'workpiece_displacement', 'workpiece_velocity'), False),
}


@pytest.mark.parametrize('mode', _LESS)
def test_it_works_with_less_and_says_so(mode: str) -> None:
    """One sensor, no machine, no spindle: chatter is flagged, a stable cut is not."""
    dropped, knows = _LESS[mode]
    kept, columns = _without(*dropped)
    machine = Machine() if knows else None

    def judged(depths: tuple[float, ...]) -> Iterator[list[Estimate]]:
        lathe, detector = VirtualLathe(cut=_cut(depths[0])), ChatterDetector(machine)
        for depth in depths:
            lathe.retune(lathe.cut.with_changes(depth_of_cut=depth))
            yield _watch(detector, _seconds(lathe, 4.0)[:, kept], columns)

    stable, shaken = judged((0.5 * _limit(), 1.5 * _limit()))
    assert not _flagged(stable)
    assert shaken[-1].chatter
    assert shaken[-1].mode.name == mode
    root = rightmost_root(Machine(), 3000.0, 1.5 * _limit(), seated=False)
    first = next(estimate for estimate in shaken if estimate.chatter)
    assert first.frequency == pytest.approx(root.imag / (2.0 * np.pi), abs=8.0)


def test_a_sensor_that_is_dead_is_done_without() -> None:
    """nan from the start is as good as no column."""
    samples = _chatter(3.0)
    samples[:, _WORKPIECE] = np.nan
    seen = _watch(ChatterDetector(), samples)
    assert seen[-1].chatter
    assert seen[-1].mode.name == 'ONE_SENSOR'


@pytest.mark.parametrize('columns', [('time', 'spindle_angle'), ('tool_displacement',)])
def test_samples_in_which_nothing_can_be_seen_are_refused(columns: tuple[str, ...]) -> None:
    """One sentence that says what is lacking."""
    with pytest.raises(LayoutError, match='have no column'):
        ChatterDetector().update(np.zeros((10, len(columns))), columns)


def test_what_is_identified_agrees_with_the_cut() -> None:
    """C w, the workpiece's stiffness, growth and frequency, before the tool leaves the cut."""
    for seated in (False, True):
        contact = 'seated' if seated else 'none'
        depth = 1.2 * _limit(seated=seated)
        lathe = VirtualLathe(cut=_cut(0.5 * depth, bearing_contact=contact))
        detector = ChatterDetector()
        _watch(detector, _seconds(lathe, 3.0))
        lathe.retune(lathe.cut.with_changes(depth_of_cut=depth))
        seen = _watch(detector, _seconds(lathe, 2.0))
        first = next(place for place, estimate in enumerate(seen) if estimate.chatter)
        known, machine = seen[first + 10], Machine()
        root = rightmost_root(machine, 3000.0, depth, seated=seated)
        assert abs(known.growth_rate - root.real) < max(1.0, 4.0 * known.growth_rate_error)
        assert known.frequency == pytest.approx(root.imag / (2.0 * np.pi), abs=0.5)
        assert known.cutting_stiffness == pytest.approx(machine.cutting_stiffness(depth), rel=0.05)
        assert known.workpiece_stiffness == pytest.approx(
            machine.workpiece_stiffness(seated=seated), rel=0.03
        )
        assert known.bearing_engaged is seated
        assert known.waves_per_revolution == pytest.approx(known.frequency / 50.0)
        assert known.doubling_time == pytest.approx(np.log(2.0) / known.growth_rate)


@pytest.mark.parametrize('begins', [1.0, 4.172, 5.64, 7.59, 10.734])
def test_who_joins_a_cut_that_has_settled_hears_no_chatter_in_its_roundings(begins: float) -> None:
    lathe = VirtualLathe()
    lathe.advance(round(begins * 1e4))
    detector = ChatterDetector()
    for _ in range(300):
        estimate = detector.update(lathe.advance(100), SAMPLE_COLUMNS)
        assert not estimate.chatter
    assert estimate.state == 'stable'


@pytest.mark.parametrize('told', [True, False])
@pytest.mark.parametrize(
    ('machine', 'cut', 'depth'),
    [
        (Machine(), _cut(0.5e-3, force_noise=0.0, sensor_noise=0.0), 0.62e-3),
        (
            _HEAVY,
            _cut(0.3e-3, spindle_speed_rpm=2466.0, force_noise=0.0, sensor_noise=0.0),
            0.2e-3,
        ),
        (
            _HEAVY,
            _cut(0.3e-3, spindle_speed_rpm=1500.0, force_noise=0.0, sensor_noise=0.0),
            0.2e-3,
        ),
    ],
)
def test_another_depth_of_a_cut_without_noise_is_no_chatter_and_its_roundings_no_fault(
    machine: Machine, cut: Cut, depth: float, told: bool
) -> None:
    # What is left of it after some seconds are roundings, against which a step is a giant.
    assert rightmost_root(machine, cut.spindle_speed_rpm, depth, seated=False).real < 0.0
    detector = ChatterDetector(machine if told else None)
    for begins in (3.0, 3.004, 3.01):
        detector.reset()
        lathe = VirtualLathe(machine, cut)
        seen = _watch(detector, lathe.advance(round(begins * 1e4)))
        lathe.retune(cut.with_changes(depth_of_cut=depth))
        seen += _watch(detector, lathe.advance(50_000))
        assert not any(estimate.chatter for estimate in seen)
        assert not any(estimate.faults for estimate in seen)


@pytest.mark.parametrize('told', [True, False])
@pytest.mark.parametrize(
    ('before', 'after'), [(3641.0, 3700.0), (3641.0, 3300.0), (3300.0, 3641.0)]
)
def test_another_speed_of_a_cut_without_noise_is_no_chatter(
    before: float, after: float, told: bool
) -> None:
    cut = Cut(spindle_speed_rpm=before, depth_of_cut=0.65e-3)
    for seated in (False, True):
        assert rightmost_root(Machine(), after, cut.depth_of_cut, seated=seated).real < 0.0
    detector, lathe = ChatterDetector(Machine() if told else None), VirtualLathe(cut=cut)
    seen = _watch(detector, lathe.advance(100_000))
    lathe.retune(cut.with_changes(spindle_speed_rpm=after))
    seen += _watch(detector, lathe.advance(40_000))
    assert not any(estimate.chatter for estimate in seen)
    assert not any('not fit' in estimate.machine_fit for estimate in seen)


def test_a_cutting_coefficient_that_cannot_be_there_costs_no_advice() -> None:
    """A depth of 0.35 m would follow: only C w is needed for a speed, and that is heard."""
    detector = ChatterDetector(Machine(cutting_coefficient=1e4))
    samples = VirtualLathe(cut=Cut(depth_of_cut=0.001, bearing_contact='none')).advance(20_000)
    estimate = detector.update(samples, SAMPLE_COLUMNS)
    assert estimate.chatter
    speed = estimate.recommended_speed_rpm
    assert rightmost_root(Machine(), speed, 0.001, seated=False).real < 0.0


@pytest.mark.parametrize('part', [0.5, 0.8])
def test_the_margin_is_that_of_the_critical_depth(part: float) -> None:
    lathe = VirtualLathe(cut=_cut(part * _limit()))
    seen = _watch(ChatterDetector(), _seconds(lathe, 12.0))
    assert seen[-1].margin == pytest.approx(1.0 / part - 1.0, abs=4.0 * seen[-1].margin_error)
    assert seen[-1].margin_error < 0.3 / part


_BROKEN: dict[str, Callable[[Array], object]] = {
    'is not a number': lambda signal: signal.fill(np.nan),
    'stands still': lambda signal: signal.fill(signal[0]),
}


@pytest.mark.parametrize(
    'column', ['tool_displacement', 'workpiece_displacement', 'spindle_angle']
)
@pytest.mark.parametrize('fault', _BROKEN)
def test_a_sensor_that_dies_amid_chatter_ends_no_alarm(fault: str, column: str) -> None:
    samples = _chatter(5.0)
    _BROKEN[fault](samples[30_000:40_000, SAMPLE_COLUMNS.index(column)])
    detector = ChatterDetector()
    before = _watch(detector, samples[:30_000])[-1]
    assert before.chatter
    amid = _watch(detector, samples[30_000:40_000])
    after = _watch(detector, samples[40_000:])
    assert all(estimate.chatter and estimate.state == 'chatter' for estimate in amid + after)
    assert {e.recommended_speed_rpm for e in amid + after} == {before.recommended_speed_rpm}
    assert amid[50].faults == (f'{column} {fault}',)
    assert after[-1].faults == ()
    assert after[-1].mode == before.mode


_NEARLY_DEAD: dict[str, Callable[[Array], Array]] = {
    'its amplifier': lambda signal: np.random.default_rng(1).normal(signal[0], 1e-7, len(signal)),
    'a thousandth': lambda signal: signal[0] + 1e-3 * (signal - signal[0]),
    'a toggling bit': lambda signal: signal[0] + 1e-9 * (np.arange(10_000) % 2),
}


@pytest.mark.parametrize('machine', [Machine(), None], ids=['told', 'not told'])
@pytest.mark.parametrize('column', [_TOOL, _WORKPIECE])
@pytest.mark.parametrize('left', _NEARLY_DEAD.values(), ids=_NEARLY_DEAD)
def test_a_sensor_that_has_almost_died_ends_no_alarm(
    left: Callable[[Array], Array], column: int, machine: Machine | None
) -> None:
    """Tool and workpiece still move against each other."""
    samples = _chatter(5.0)
    samples[30_000:40_000, column] = left(samples[30_000:40_000, column])
    detector = ChatterDetector(machine)
    assert _watch(detector, samples[:30_000])[-1].chatter
    assert all(estimate.chatter for estimate in _watch(detector, samples[30_000:]))


@pytest.mark.parametrize('limits', [(-1e-5, 1e-5), (-1e-5, np.inf), (-np.inf, 1e-5)])
def test_a_sensor_that_is_cut_off_is_named(limits: tuple[float, float]) -> None:
    samples = _chatter(5.0)
    tool = samples[:, _TOOL]
    samples[:, _TOOL] = np.clip(tool, *(np.median(tool) + limit for limit in limits))
    last = _watch(ChatterDetector(), samples)[-1]
    assert last.chatter
    assert f'{SAMPLE_COLUMNS[_TOOL]} is cut off at a limit of its range' in last.faults


@pytest.mark.parametrize('machine', [Machine(), None], ids=['told', 'not told'])
def test_a_spindle_that_turns_backwards_is_one_that_turns(machine: Machine | None) -> None:
    """Or whose encoder counts down; nobody tells which way it will be."""
    forwards, backwards = ChatterDetector(machine), ChatterDetector(machine)
    samples = _chatter(3.0)
    expected = _watch(forwards, samples)[-1]
    samples[:, SAMPLE_COLUMNS.index('spindle_angle')] *= -1.0
    seen = _watch(backwards, samples)
    assert seen[-1].chatter
    assert seen[-1].spindle_speed_rpm == pytest.approx(3000.0, rel=1e-3)
    assert seen[-1].frequency == pytest.approx(expected.frequency, rel=1e-3)
    assert 'idle' not in {estimate.state for estimate in seen[20:]}


def test_after_it_was_stopped_and_reversed_the_spindle_turns_again() -> None:
    stable, angle = _seconds(VirtualLathe(cut=_cut()), 3.0), SAMPLE_COLUMNS.index('spindle_angle')
    stands, back = stable[:10_000].copy(), stable.copy()
    stands[:, angle] = stable[-1, angle]
    back[:, angle] = stands[-1, angle] - back[:, angle]
    samples = np.concatenate([stable, stands, back])
    samples[:, 0] = np.arange(len(samples)) / 10_000.0
    seen = _watch(ChatterDetector(), samples)
    assert not _flagged(seen)
    assert seen[-1].state == 'stable'


def test_an_alarm_ends_within_a_second_of_a_long_cut_and_the_state_is_idle() -> None:
    cut = _cut(1.5 * _limit(), force_noise=0.0)
    lathe, detector = VirtualLathe(cut=cut), ChatterDetector()
    assert _watch(detector, _seconds(lathe, 12.0))[-1].chatter
    lathe.retune(lathe.cut.with_changes(depth_of_cut=0.0, feed_speed=0.0))
    seen = _watch(detector, _seconds(lathe, 3.0))
    assert not seen[100].chatter
    assert seen[-1].state == 'idle'


def test_a_knock_amid_chatter_ends_no_alarm() -> None:
    lathe, detector = VirtualLathe(cut=_cut(1.5 * _limit())), ChatterDetector()
    _watch(detector, _seconds(lathe, 3.0))
    lathe.knock(0.02)
    assert all(estimate.chatter for estimate in _watch(detector, _seconds(lathe, 3.0)))
