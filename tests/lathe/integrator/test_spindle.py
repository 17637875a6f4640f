"""The law of spindle speed against numerical integration and its own inverse."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from support.python_entry import with_entry

from lathe_chatter.lathe.integrator import spindle

sine_and_cosine, turned = with_entry(spindle.sine_and_cosine), with_entry(spindle.turned)
speed_and_slope = with_entry(spindle.speed_and_slope)
time_to_turn = with_entry(spindle.time_to_turn)

_LAWS = [  # base rev/s, slope rev/s2, amplitude, phase, frequency Hz
    (50.0, 0.0, 0.0, 0.0, 1.0),
    (50.0, 300.0, 0.0, 0.0, 1.0),
    (50.0, 0.0, 0.3, 0.2, 1.0),
    (50.0, 0.0, 0.5, 0.7, 1e-3),
    (1.0, 0.0, 0.5, 0.99, 1000.0),
    (500.0, -2e4, 0.5, 0.4, 97.0),
    (50.0, 1e4, 0.2, 0.1, 100.0),
]
_TIMES = [1e-9, 1e-4, 9.5e-4, 1.1e-3, 9e-3]
_EPSILON = 2.3e-16
_TRUNCATION = 0.3**10 / math.factorial(11)
"""Of the series of sin(z)/z that `turned` uses up to z = 0.3: 1.5e-13."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)


@pytest.mark.parametrize('law', _LAWS)
@pytest.mark.parametrize('time', _TIMES)
def test_the_turned_angle_is_the_integral_of_speed(
    law: tuple[float, float, float, float, float], time: float
) -> None:
    base, slope, amplitude, phase, frequency = law

    t = 0.5 * time * (1.0 + _NODES)
    swing = np.sin(2.0 * math.pi * (phase + frequency * t))
    speed = (base + slope * t) * (1.0 + amplitude * swing)
    exact = 0.5 * time * float(_WEIGHTS @ speed)
    assert turned(time, *law) == pytest.approx(exact, rel=1e-14 + _TRUNCATION)


@pytest.mark.parametrize('law', _LAWS)
def test_the_slope_is_the_derivative_of_speed(
    law: tuple[float, float, float, float, float],
) -> None:
    base, slope, amplitude, phase, frequency = law
    h = 1e-4 / frequency if amplitude else 1e-4
    after, _ = speed_and_slope(
        base + slope * h, slope, amplitude, phase + frequency * h, frequency
    )
    before, _ = speed_and_slope(
        base - slope * h, slope, amplitude, phase - frequency * h, frequency
    )
    _, found = speed_and_slope(base, slope, amplitude, phase, frequency)
    rounding = 4.0 * _EPSILON * base / h
    assert found == pytest.approx((after - before) / (2.0 * h), rel=1e-6, abs=rounding)


@pytest.mark.parametrize('law', _LAWS)
@pytest.mark.parametrize('time', _TIMES)
def test_time_to_turn_undoes_turned(
    law: tuple[float, float, float, float, float], time: float
) -> None:
    assert time_to_turn(turned(time, *law), *law) == pytest.approx(time, rel=1e-14, abs=1e-17)


@pytest.mark.parametrize('law', _LAWS)
def test_angles_add_up(law: tuple[float, float, float, float, float]) -> None:
    base, slope, amplitude, phase, frequency = law
    first, second = 4e-4, 7e-4
    later = (base + slope * first, slope, amplitude, phase + frequency * first, frequency)
    parts = turned(first, *law) + turned(second, *later)
    assert turned(first + second, *law) == pytest.approx(parts, rel=1e-14 + _TRUNCATION)


def test_the_series_and_the_closed_form_meet() -> None:
    """Where `turned` changes from one to the other, at z = pi f t = 0.3."""
    law = (50.0, 300.0, 0.5, 0.2, 100.0)
    border = 0.3 / (math.pi * 100.0)
    step = 1e-9
    below, above = turned(border - step, *law), turned(border + step, *law)
    speed, _ = speed_and_slope(50.0 + 300.0 * border, 300.0, 0.5, 0.2 + 100.0 * border, 100.0)
    assert above - below == pytest.approx(2.0 * step * speed, abs=_TRUNCATION * below)


def test_sine_and_cosine_of_turns_are_right_to_rounding() -> None:
    """Against 30 digits."""
    with mpmath.workdps(30):
        for turns in np.random.default_rng(4).uniform(-3.0, 3.0, 2000).tolist():
            angle = 2 * mpmath.pi * mpmath.mpf(turns)
            exact = mpmath.sin(angle), mpmath.cos(angle)
            for mine, right in zip(sine_and_cosine(turns), exact, strict=True):
                assert abs(mine - right) < 2.5e-16
