"""The random numbers: their distribution, and that nothing but their counter decides them.

The bounds are five standard errors of the statistic for the size of the sample; with fixed
seeds the outcome is fixed too.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from numba import njit
from scipy import stats

from lathe_chatter.array_types import Array
from lathe_chatter.lathe.integrator import random_numbers

_COUNT = 200_000
_SIGMAS = 5.0


@njit
def _numbers(seed: int, stream: int, first: int, count: int) -> Array:
    numbers = np.empty(count)
    for k in range(count):
        numbers[k] = random_numbers.standard_normal(seed, stream, first + k)
    return numbers


@pytest.mark.parametrize('seed', [0, 1, 2**31 - 1])
@pytest.mark.parametrize(
    'stream', [random_numbers.FORCE_STREAM, random_numbers.WORKPIECE_SENSOR_STREAM]
)
def test_moments_are_those_of_a_standard_normal(seed: int, stream: int) -> None:
    x = _numbers(seed, stream, 0, _COUNT)
    error = _SIGMAS / math.sqrt(_COUNT)
    assert abs(x.mean()) < error
    assert abs((x**2).mean() - 1.0) < error * math.sqrt(2.0)
    assert abs((x**3).mean()) < error * math.sqrt(15.0)
    assert abs((x**4).mean() - 3.0) < error * math.sqrt(96.0)


def test_the_distribution_is_normal() -> None:
    """Kolmogorov's statistic, below the level that one good sample in 10^6 would pass."""
    distance = stats.kstest(_numbers(7, 0, 0, _COUNT), 'norm').statistic
    assert distance < stats.kstwo.isf(1e-6, _COUNT)


@pytest.mark.parametrize('lag', [1, 2, 3, 17])
def test_successive_numbers_are_uncorrelated(lag: int) -> None:
    x = _numbers(3, 0, 0, _COUNT)
    bound = _SIGMAS / math.sqrt(_COUNT)
    assert abs((x[lag:] * x[:-lag]).mean()) < bound
    assert abs(((x[lag:] ** 2 - 1.0) * (x[:-lag] ** 2 - 1.0)).mean()) < 2.0 * bound


@pytest.mark.parametrize('other', [(0, 1), (0, 2), (1, 0), (2, 1)])
def test_seeds_and_streams_are_uncorrelated(other: tuple[int, int]) -> None:
    mine, theirs = _numbers(0, 0, 0, _COUNT), _numbers(*other, 0, _COUNT)
    assert abs((mine * theirs).mean()) < _SIGMAS / math.sqrt(_COUNT)


def test_a_number_depends_on_its_counter_alone() -> None:
    whole = _numbers(5, 1, 0, 100)
    parts = np.concatenate([_numbers(5, 1, 0, 33), _numbers(5, 1, 33, 67)])
    assert np.array_equal(whole, parts)
    assert whole[42] == random_numbers.standard_normal(5, 1, 42)


@pytest.mark.parametrize('counter', [0, 2**31, 2**40, 10**15])
def test_no_counter_is_too_large(counter: int) -> None:
    x = _numbers(0, 0, counter, 1000)
    assert np.isfinite(x).all()
    assert len(np.unique(x)) == 1000
