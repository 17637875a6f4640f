"""A sound alone: one line above all others is chatter, whenever it began; a louder cut is none."""

from __future__ import annotations

import numpy as np
import pytest

from lathe_chatter.array_types import Array
from lathe_chatter.detection import ChatterDetector, Estimate

RATE = 48_000


def heard(sound: Array) -> list[Estimate]:
    """Estimates every 20 ms."""
    time, detector = np.arange(len(sound)) / RATE, ChatterDetector(None)
    rows = np.column_stack([time, sound])
    return [
        detector.update(rows[k : k + 960], ('time', 'sound')) for k in range(0, len(rows), 960)
    ]


def shop(seconds: float, level: float, seed: int) -> Array:
    """A machine: lines of its drives, of one size, and noise."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds * RATE)) / RATE
    lines = sum(np.cos(2.0 * np.pi * hertz * time + hertz) for hertz in (120.0, 255.0, 540.0))
    result: Array = level * (0.3 * lines + rng.standard_normal(len(time)))
    return result


@pytest.mark.parametrize('hertz', [90.0, 420.0, 899.0, 3100.0])
@pytest.mark.parametrize('idle', [0.0, 3.0])
def test_a_line_above_all_is_flagged_at_its_frequency_and_its_end_is_noticed(
    hertz: float, idle: float
) -> None:
    """From the first sample on, or after a quiet time; flagged within 0.5 s, a slow one in 2.5."""
    time = np.arange(3 * RATE) / RATE
    tone = 2.0 * np.cos(2.0 * np.pi * hertz * time)
    sound = np.concatenate([shop(idle, 0.2, 1), shop(3.0, 0.5, 2) + tone, shop(2.0, 0.2, 3)])
    found = heard(sound)
    first = next(each for each in found if each.chatter)
    assert first.time > idle
    assert first.time - idle < (2.5 if hertz < 100.0 else 0.5)
    amid = found[int(50 * (idle + 2.5))]
    assert amid.frequency == pytest.approx(hertz, abs=1.0)
    assert np.isnan(amid.growth_rate)
    assert not any(each.chatter for each in found if each.time > idle + 4.0)


@pytest.mark.parametrize('seed', [4, 5])
def test_a_cut_that_is_louder_than_an_idle_machine_is_no_chatter(seed: int) -> None:
    sound = np.concatenate([shop(4.0, 0.1, seed), shop(4.0, 1.0, seed + 10), shop(2.0, 0.1, seed)])
    assert not any(each.chatter for each in heard(sound))
