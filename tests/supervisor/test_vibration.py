"""What is said of vibration from the amplitudes that were seen."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from lathe_chatter.supervisor.vibration import VibrationHistory


def seen(amplitude: Callable[[float], float], seconds: float = 2.0) -> VibrationHistory:
    """Looked at fifty times a second."""
    vibration = VibrationHistory()
    for k in range(round(50.0 * seconds) + 1):
        vibration.note(0.02 * k, amplitude(0.02 * k))
    return vibration


def test_what_decays_dies_and_what_stays_does_not() -> None:
    assert seen(lambda time: math.exp(-0.5 * time)).dies(1.0, math.nan)
    assert not seen(lambda _time: 1.0).dies(1.0, math.nan)
    assert not seen(math.exp).dies(1.0, 1.0)


def test_what_has_fallen_since_a_move_dies_unless_it_grows() -> None:
    low = seen(lambda _time: 0.4)
    assert low.dies(1.0, math.nan)
    assert not low.dies(1.0, 0.5)


def test_a_limit_must_be_passed_for_long_and_not_by_what_falls() -> None:
    assert seen(lambda _time: 1.1).is_beyond(1.0)
    assert not seen(lambda _time: 0.9).is_beyond(1.0)
    assert not seen(lambda _time: 1.1, 0.1).is_beyond(1.0)
    assert not seen(lambda time: 100.0 * math.exp(-time)).is_beyond(1.0)


def test_it_stands_out_of_a_quiet_cut() -> None:
    vibration = VibrationHistory()
    for k in range(100):
        vibration.note(0.02 * k, 1.0)
        vibration.note_quiet()
    for k in range(100, 110):
        vibration.note(0.02 * k, 3.0)
    assert vibration.stands_out(2.0)
    assert not vibration.stands_out(4.0)


def test_chatter_is_steady_and_noise_is_not() -> None:
    assert seen(lambda time: 1.0 + 0.05 * math.sin(40.0 * time)).is_steady()
    rng = np.random.default_rng(1)
    state = rng.standard_normal(2)
    levels = []
    for _ in range(101):  # the envelope of a mode that decays by 2/s and is stirred by noise
        state = state * math.exp(-0.04) + 0.28 * rng.standard_normal(2)
        levels.append(float(np.hypot(*state)))
    assert not seen(lambda time: levels[round(time / 0.02)]).is_steady()
    assert not seen(lambda _time: 1.0, 0.5).is_steady()
    assert not seen(lambda _time: math.nan).is_steady()
