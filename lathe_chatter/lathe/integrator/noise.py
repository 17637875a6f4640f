"""Random numbers that are a function of (seed, stream, counter) and of nothing else.

A generator with a hidden state would make the noise depend on how a run was cut into calls.
Here sample k of a stream is always the same number: ticks do not matter, a restored run goes on
as if nothing had happened, and nothing has to be saved.
"""

from __future__ import annotations

import math

import numpy as np

from lathe_chatter.compiled import compiled

FORCE_STREAM = 0
TOOL_SENSOR_STREAM = 1
WORKPIECE_SENSOR_STREAM = 2
_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)
_S11, _S27, _S30, _S31 = np.uint64(11), np.uint64(27), np.uint64(30), np.uint64(31)


@compiled(borrows=True)
def _mixed(word: np.uint64) -> np.uint64:
    """The finaliser of SplitMix64 (Steele, Lea and Flood, OOPSLA 2014)."""
    word = (word ^ (word >> _S30)) * _MIX_1
    word = (word ^ (word >> _S27)) * _MIX_2
    return word ^ (word >> _S31)


@compiled(borrows=True)
def standard_normal(seed: int, stream: int, counter: int) -> float:
    """A standard normal number by Box and Muller from two hashed words."""
    key = _mixed(np.uint64(seed) * _GOLDEN + np.uint64(stream))
    place = key + np.uint64(2 * counter) * _GOLDEN
    first = np.float64(_mixed(place + _GOLDEN) >> _S11) + 1.0
    second = np.float64(_mixed(place + _GOLDEN + _GOLDEN) >> _S11)
    radius = math.sqrt(-2.0 * math.log(first * 2.0**-53))
    return radius * math.cos(2.0 * math.pi * second * 2.0**-53)
