"""Without a machine: what quick bands hear of a slow mode that noise makes swell."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from lathe_chatter.array_types import Array
from lathe_chatter.detection import ChatterDetector, Estimate

_RATE, _TURNS, _SLOW, _QUICK, _DECAY = 1e4, 50.0, 124.0, 1700.0, 6.0
_SIZE = 2e-6
_COLUMNS = 'time', 'spindle_angle', 'tool_displacement'
_TIMES = np.arange(1, 30 * round(_RATE) + 1) / _RATE


def _swelling() -> Array:
    """A mode of effective value 2 um that dies down at 6 1/s, driven by noise, and a sensor's."""
    rng = np.random.default_rng(5)
    noise = rng.normal(size=_TIMES.size) + 1j * rng.normal(size=_TIMES.size)
    pole = np.exp((-_DECAY + 2j * np.pi * _SLOW) / _RATE)
    mode = lfilter([1.0], [1.0, -pole], noise).real
    return np.asarray(_SIZE * mode / mode.std() + rng.normal(0.0, 1e-8, _TIMES.size))


def _watched(tool: Array) -> list[Estimate]:
    detector, samples = ChatterDetector(None), np.stack([_TIMES, _TURNS * _TIMES, tool], axis=1)
    return [detector.update(batch, _COLUMNS) for batch in np.array_split(samples, 1500)]


def test_a_slow_mode_that_swells_is_no_chatter_of_a_quick_band() -> None:
    """It is heard there, beyond the flanks of the resonators, against a baseline of 0.5 s."""
    seen = _watched(_swelling())
    assert not any(estimate.chatter for estimate in seen)
    assert 'chatter' not in {estimate.state for estimate in seen}


def test_chatter_of_a_quick_band_beside_it_is_flagged_while_it_grows() -> None:
    growing = 1e-9 * np.exp(20.0 * np.clip(_TIMES - 20.0, 0.0, 0.5))
    seen = _watched(_swelling() + growing * np.sin(2.0 * np.pi * _QUICK * _TIMES))
    flagged = next(estimate for estimate in seen if estimate.chatter)
    assert flagged.frequency == pytest.approx(_QUICK, rel=0.02)
    assert 20.0 < flagged.time < 20.5
