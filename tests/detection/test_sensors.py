"""Other sensors than displacement: what is claimed with them, and what is not."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lathe_chatter.detection import ChatterDetector, Estimate
from lathe_chatter.detection.estimate import Mode
from lathe_chatter.detection.sensors_to_displacement import MotionFilter, sensors_among
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import Cut
from lathe_chatter.stability import rightmost_root

STABLE = Cut(depth_of_cut=0.0005, bearing_contact='none', force_noise=5e-4)
UNSTABLE = STABLE.with_changes(depth_of_cut=0.0008)
ROOT = rightmost_root(VirtualLathe().machine, 3000.0, 0.0008, seated=False)


def judged(*kinds: str, seed: int = 0) -> tuple[list[Estimate], Estimate]:
    """Estimates of 3 s of a stable cut, and that of 0.1 s after the flag of the onset then."""
    lathe = VirtualLathe(cut=STABLE, seed=seed, accelerometers=True)
    detector, found = ChatterDetector(lathe.machine), []
    for block in range(600):
        if block == 300:
            lathe.retune(UNSTABLE)
        samples = lathe.advance(100)
        columns = {name: samples[:, k] for k, name in enumerate(lathe.columns)}
        mixture = columns['tool_acceleration'] + 0.6 * columns['workpiece_acceleration']
        columns['sound'] = 1e-3 * mixture
        names = ['time', 'spindle_angle', *kinds]
        found.append(detector.update(np.column_stack([columns[n] for n in names]), names))
    flag = next(k for k in range(300, 600) if found[k].chatter)
    return found[:300], found[flag + 10]


@pytest.mark.parametrize('kind', ['velocity', 'acceleration'])
@pytest.mark.parametrize('seed', [11, 12])
def test_from_two_bodies_motion_the_cut_is_identified(kind: str, seed: int) -> None:
    before, flag = judged(f'tool_{kind}', f'workpiece_{kind}', seed=seed)
    assert not any(each.chatter for each in before)
    assert flag.mode is Mode.FULL
    assert flag.frequency == pytest.approx(ROOT.imag / 2 / np.pi, abs=1.0)
    assert flag.growth_rate == pytest.approx(ROOT.real, abs=4 * flag.growth_rate_error)
    advised = flag.recommended_speed_rpm
    assert rightmost_root(VirtualLathe().machine, advised, 0.0008, seated=False).real < 0.0


def test_sensors_of_two_kinds_are_made_comparable() -> None:
    before, flag = judged('tool_displacement', 'workpiece_acceleration', seed=13)
    assert not any(each.chatter for each in before)
    assert flag.frequency == pytest.approx(ROOT.imag / 2 / np.pi, abs=1.0)


def test_of_a_sound_no_growth_and_no_amplitude_is_claimed() -> None:
    before, flag = judged('sound', seed=14)
    assert not any(each.chatter for each in before)
    assert flag.mode is Mode.MIXTURE
    assert flag.frequency == pytest.approx(ROOT.imag / 2 / np.pi, abs=1.0)
    assert math.isnan(flag.growth_rate)
    assert math.isnan(flag.growth_rate_error)
    assert math.isnan(flag.amplitude)


def test_a_sample_rate_too_low_for_the_machine_is_said() -> None:
    lathe = VirtualLathe(cut=UNSTABLE)
    samples = lathe.advance(30_000)[::50]  # 200 Hz, for a machine of 103 to 180 Hz
    estimate = ChatterDetector(lathe.machine).update(samples, lathe.columns)
    assert estimate.mode is Mode.TOO_SLOW
    assert estimate.state == 'unknown'
    assert math.isnan(estimate.frequency)


@pytest.mark.parametrize(
    ('order', 'factor'), [(0, 1.0), (1, 2j * np.pi * 130), (2, -((2 * np.pi * 130) ** 2))]
)
def test_a_filtered_signal_is_the_displacement(order: int, factor: complex) -> None:
    """At 130 Hz, sampled with 20 kHz: what was differentiated comes back, alike for all."""
    time = np.arange(20_000) / 2e4
    signals = np.column_stack([(factor * np.exp(2j * np.pi * 130 * time)).real] * 2)
    reference = np.column_stack([np.cos(2 * np.pi * 130 * time)] * 2)
    MotionFilter((order, order), 2e4).apply(signals)
    MotionFilter((0, 0), 2e4).apply(reference)
    late = slice(10_000, None)
    assert signals[late] == pytest.approx(reference[late], abs=2e-3)


def test_the_better_sensor_of_a_body_is_taken() -> None:
    names = ('time', 'tool_acceleration', 'tool_displacement', 'workpiece_velocity', 'sound')
    found = sensors_among(names)
    assert found is not None
    assert (found.tool, found.workpiece) == ('tool_displacement', 'workpiece_velocity')
    assert found.orders == (0, 1)
    assert sensors_among(('time', 'temperature')) is None
