"""Spectra and sections against signals whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest

from lathe_chatter.report.run_excerpts import once_per_turn, spectrum

TIME = np.arange(20_000) / 1e4


@pytest.mark.parametrize('frequency', [50.0, 133.7, 410.25])
def test_the_peak_is_the_amplitude_at_the_frequency(frequency: float) -> None:
    found = spectrum(TIME, 7.0 + 3e-6 * np.sin(2.0 * np.pi * frequency * TIME + 0.4))
    assert found.peak == pytest.approx(frequency, abs=0.02)
    # Between two lines a Hann window shows at least 85 % of the amplitude.
    assert 0.84 * 3e-6 < found.amplitude.max() <= 3e-6 * (1.0 + 1e-6)


def test_a_constant_has_no_spectrum_and_a_short_signal_none_at_all() -> None:
    assert spectrum(TIME, np.full(TIME.size, 0.1)).amplitude.max() < 1e-15
    assert spectrum(TIME[:5], TIME[:5]).frequency.size == 0


def test_a_section_takes_what_stands_between_the_samples() -> None:
    errors = []
    for rate in (1e3, 1e4):
        time = np.arange(round(2.0 * rate)) / rate
        angle = 47.3 * time + 0.2 * np.sin(3.0 * time)
        omega = 850.0
        section = once_per_turn(time, angle, np.sin(omega * time), omega * np.cos(omega * time))
        whole = np.arange(1, int(angle[-1]) + 1)
        at = np.interp(whole, angle, time)
        for _ in range(5):
            at -= (47.3 * at + 0.2 * np.sin(3.0 * at) - whole) / (47.3 + 0.6 * np.cos(3.0 * at))
        assert section.displacement.size == whole.size
        errors.append(np.abs(section.displacement - np.sin(omega * at)).max())
    # (omega h)^4 / 384 bounds the cubic; the rest is the angle, taken to rise evenly.
    assert errors[0] < 0.85**4 / 384.0 + 1e-3
    assert errors[1] < 1e-2 * errors[0]


def test_what_repeats_with_the_spindle_is_a_point() -> None:
    angle = 50.0 * TIME + 0.123
    phase = 2.0 * np.pi * angle
    rate = 2.0 * np.pi * 50.0
    section = once_per_turn(TIME, angle, np.sin(2.0 * phase), 2.0 * rate * np.cos(2.0 * phase))
    assert section.displacement.size == 100
    assert np.abs(section.displacement).max() < 1e-6
    assert section.velocity == pytest.approx(np.full(100, 2.0 * rate), rel=1e-6)


def test_noise_of_a_displacement_is_no_velocity() -> None:
    """0.05 um at 20 kHz over one step are 1 mm/s; the velocity that was measured is none."""
    time = np.arange(40_000) / 2e4
    angle, still = 50.0 * time + 0.123, np.full(time.size, 1e-9)
    noise = np.random.default_rng(5).normal(0.0, 5e-8, time.size)
    section = once_per_turn(time, angle, 2e-6 + noise, still)
    assert section.velocity == pytest.approx(still[: section.velocity.size], rel=1e-9)
    assert np.abs(section.displacement - 2e-6).max() < 3e-7
    few = once_per_turn(time[:1], angle[:1], still[:1], still[:1])
    assert few.velocity.size == few.displacement.size == 0
    two = once_per_turn(time[:2], np.array([0.9, 1.1]), still[:2], np.array([1.0, 3.0]))
    assert two.velocity == pytest.approx([2.0])
