"""Figures in a cut that was knocked, or has just been cured of chatter, are right or unknown."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from lathe_chatter.array_types import Array
from lathe_chatter.detection import ChatterDetector, Estimate
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import Cut, Machine
from lathe_chatter.stability import critical_depth, rightmost_root

_RPM, _DEPTH = 3648.0, 0.001
_KNOCK = 0.05
"""N s: the tool leaves the cut for tenths of a second."""


def _lathe(depth: float = _DEPTH, rpm: float = _RPM, noise: float = 2e-4) -> VirtualLathe:
    cut = Cut(
        spindle_speed_rpm=rpm,
        depth_of_cut=depth,
        bearing_contact='none',
        force_noise=noise,
        sensor_noise=1e-7,
    )
    return VirtualLathe(cut=cut, seed=1)


def _listen(detector: ChatterDetector, lathe: VirtualLathe, seconds: float) -> list[Estimate]:
    blocks = round(50 * seconds)
    return [detector.update(lathe.advance(200), lathe.columns) for _ in range(blocks)]


def _cured(detector: ChatterDetector, lathe: VirtualLathe, rpm: float = _RPM) -> None:
    """Let it chatter for two seconds, and the flag clear after a change of speed."""
    while not _listen(detector, lathe, 0.02)[-1].chatter:
        pass
    _listen(detector, lathe, 2.0)
    lathe.retune(lathe.cut.with_changes(spindle_speed_rpm=rpm))
    while _listen(detector, lathe, 0.02)[-1].chatter:
        pass


@pytest.mark.parametrize('noise', [1e-5, 2e-4, 4.5e-4])
def test_knocks_in_a_stable_cut_are_no_chatter(noise: float) -> None:
    assert rightmost_root(Machine(), _RPM, _DEPTH, seated=False).real < -5.0
    lathe, detector = _lathe(noise=noise), ChatterDetector()
    seen = _listen(detector, lathe, 3.0)
    for pause in (2.0, 4.0, 1.5, 3.0, 5.0):
        lathe.knock(_KNOCK)
        seen += _listen(detector, lathe, pause)
    assert not any(estimate.chatter for estimate in seen)


def test_knocks_after_a_cure_correct_no_frequency() -> None:
    """The machine was told to the last digit."""
    lathe, detector = _lathe(rpm=3000.0), ChatterDetector()
    _cured(detector, lathe)
    seen, rng = [], np.random.default_rng(1)
    while lathe.time < 24.0:
        lathe.knock(_KNOCK * rng.choice([-1.0, 1.0], p=[0.3, 0.7]))
        seen += _listen(detector, lathe, 0.02 * round(50.0 * (0.3 + rng.exponential(0.7))))
    assert {estimate.machine_fit for estimate in seen} == {''}
    assert not any(math.isfinite(estimate.tool_frequency) for estimate in seen)


@pytest.mark.parametrize(('kind', 'depth'), [('speed', _DEPTH), ('depth', 0.0006)])
def test_the_margin_after_a_cure_is_that_of_the_cut(kind: str, depth: float) -> None:
    """Of a machine that has been believed before, so that nothing counts amid the chatter."""
    lathe, detector = _lathe(depth=0.0003, rpm=3000.0, noise=1e-3), ChatterDetector()
    _listen(detector, lathe, 12.0)
    lathe.retune(lathe.cut.with_changes(depth_of_cut=_DEPTH))
    _cured(detector, lathe)
    if kind == 'depth':
        lathe.retune(lathe.cut.with_changes(depth_of_cut=depth))
    true = critical_depth(Machine(), _RPM, seated=False) / depth - 1.0
    known = [each for each in _listen(detector, lathe, 10.0) if math.isfinite(each.margin)]
    assert known
    assert all(abs(each.margin - true) < 4.0 * each.margin_error for each in known)
    assert known[-1].margin == pytest.approx(true, rel=0.3)


def test_a_cut_without_noise_has_no_margin_once_it_has_settled() -> None:
    """The shipped scenario, and then a deeper cut: its jump alone moved anything."""
    cut = Cut(spindle_speed_rpm=3000.0, depth_of_cut=0.00062, bearing_clearance=5e-6)
    lathe, detector = VirtualLathe(cut=cut), ChatterDetector()
    _cured(detector, lathe, rpm=3633.0)
    _listen(detector, lathe, 8.0)
    lathe.retune(lathe.cut.with_changes(depth_of_cut=_DEPTH))
    seen = _listen(detector, lathe, 6.0)
    assert seen[-1].state == 'stable'
    assert all(each.margin > -0.9 for each in seen if math.isfinite(each.margin))
    assert math.isnan(seen[-1].margin)


def _in_band(signal: Array) -> Array:
    band = butter(4, [60.0, 600.0], 'bandpass', fs=10_000.0, output='sos')
    found: Array = sosfiltfilt(band, signal)
    return found


@pytest.mark.parametrize('rpm', [2500.0, 3300.0, 3648.0, 6500.0, 8000.0])
def test_the_amplitude_of_a_vibration_that_almost_repeats_each_turn_is_its_own(rpm: float) -> None:
    """Noise in a stable cut at speeds where a turn has nearly a whole number of vibrations."""
    depth = 0.6 * critical_depth(Machine(), rpm, seated=False)
    lathe, detector = _lathe(depth, rpm, 4.5e-4), ChatterDetector()
    told, signal = [], []
    for _ in range(400):
        block = lathe.advance(200)
        signal.append(block[:, 2])
        told.append(detector.update(block, lathe.columns).amplitude)
    vibration = _in_band(np.concatenate(signal))
    blocks = vibration.reshape(400, 200)[100:]
    rms = np.sqrt(np.mean(blocks**2))
    amplitudes = np.array(told[100:])
    known = np.isfinite(amplitudes)
    assert known.mean() > 0.8
    told_rms = math.sqrt(np.mean(amplitudes[known] ** 2) / 2.0)
    assert told_rms == pytest.approx(rms, rel=0.25)
