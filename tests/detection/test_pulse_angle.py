"""The spindle's angle from a pulse a turn, against the angle that made the pulses."""

from __future__ import annotations

import numpy as np
import pytest

from lathe_chatter.detection.pulse_angle import PulseAngle

RATE = 1e4
TIME = np.arange(60_000) / RATE


def test_the_angle_follows_a_spindle_that_drifts() -> None:
    """By 1 % about 50 rev/s: to 1 % of a turn, though a pulse is seen to 0.5 % of one only."""
    angle = np.cumsum(50.0 + 0.5 * np.sin(TIME)) / RATE
    pulse = (angle % 1.0 < 0.1).astype(float)
    found = PulseAngle().take(TIME, pulse)
    off = (found - angle)[20_000:]
    assert np.ptp(off) < 0.02
    assert np.diff(found)[20_000:].min() > 0.0


def test_the_size_of_the_batches_changes_no_angle() -> None:
    pulse = (TIME * 31.0 % 1.0 < 0.05) * 5.0 + 0.2
    whole, source = PulseAngle().take(TIME, pulse), PulseAngle()
    pieces = [source.take(TIME[k : k + 137], pulse[k : k + 137]) for k in range(0, 60_000, 137)]
    assert np.array_equal(whole, np.concatenate(pieces), equal_nan=True)


def test_before_two_pulses_nothing_is_known_and_without_more_the_spindle_stands() -> None:
    pulse = (TIME % 0.5 < 0.01) & (TIME < 2.1)
    found = PulseAngle().take(TIME, pulse.astype(float))
    assert np.isnan(found[:9_990]).all()  # the first sample is no rise, so 0.5 and 1.0 s are two
    assert np.isfinite(found[10_010:]).all()
    assert np.ptp(found[-20_000:]) == pytest.approx(0.0)


@pytest.mark.parametrize('size', [1, 20, 137, 60_000])
def test_a_sample_that_is_no_number_is_passed_over_whatever_its_batch(size: int) -> None:
    pulse = (TIME * 31.0 % 1.0 < 0.05) * 5.0 + 0.2
    whole = PulseAngle().take(TIME, pulse)
    time, source = TIME.copy(), PulseAngle()
    time[30_010], pulse[40_005], pulse[40_100] = np.nan, np.nan, np.inf
    known = np.isfinite(time) & np.isfinite(pulse)
    parts = [source.take(time[k : k + size], pulse[k : k + size]) for k in range(0, 60_000, size)]
    found = np.concatenate(parts)
    assert np.array_equal(found[known], whole[known], equal_nan=True)
    assert np.isnan(found[~known]).all()


def test_after_a_restart_the_spindle_turns_on_forwards() -> None:
    pulse = (TIME * 50.0 % 1.0 < 0.1).astype(float)
    source = PulseAngle()
    source.take(TIME, pulse)
    found = source.take(TIME, pulse)
    known = found[np.isfinite(found)]
    assert len(known) > 59_000
    assert np.diff(known[1000:]) == pytest.approx(50.0 / RATE, rel=0.05)
    assert np.diff(known).min() > 0.0
