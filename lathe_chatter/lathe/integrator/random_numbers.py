"""Random numbers that are a function of (seed, stream, counter) and of nothing else.

A generator with a hidden state would make the noise depend on how a run was cut into calls.
Here sample k of a stream is always the same number: ticks do not matter, a restored run goes on
as if nothing had happened, and nothing has to be saved.
"""

from __future__ import annotations

import math

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.compiled import compiled

FORCE_STREAM = 0
TOOL_SENSOR_STREAM = 1
WORKPIECE_SENSOR_STREAM = 2
CUTTING_FORCE_STREAM = 3
TOOL_ACCELEROMETER_STREAM = 4
WORKPIECE_ACCELEROMETER_STREAM = 5
_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)
_S11, _S27, _S30, _S31 = np.uint64(11), np.uint64(27), np.uint64(30), np.uint64(31)

_LAYERS = 128
_LAYER_OF = np.uint64(_LAYERS - 1)
_TAIL = 3.442619855899
"""Where the tail begins; each layer has the area `_AREA` (Doornik, Ziggurat, 2005)."""
_AREA = 9.91256303526217e-3


def _layers() -> tuple[Array, Array]:
    """The right edge of each layer, and which part of it lies wholly below the bell."""
    edges = np.zeros(_LAYERS + 1)
    height = math.exp(-0.5 * _TAIL * _TAIL)
    edges[0], edges[1] = _AREA / height, _TAIL
    for k in range(2, _LAYERS):
        edges[k] = math.sqrt(-2.0 * math.log(_AREA / edges[k - 1] + height))
        height = math.exp(-0.5 * edges[k] * edges[k])
    return edges, np.append(edges[1:] / edges[:-1], 0.0)


_EDGES, _INSIDE = _layers()


@compiled(inline=True, borrows=True, inner=True)
def _mixed(word: np.uint64) -> np.uint64:
    """The finaliser of SplitMix64 (Steele, Lea and Flood, OOPSLA 2014)."""
    word = (word ^ (word >> _S30)) * _MIX_1
    word = (word ^ (word >> _S27)) * _MIX_2
    return word ^ (word >> _S31)


@compiled(inline=True, borrows=True, inner=True)
def stream_key(seed: int, stream: int) -> np.uint64:
    """Where the numbers of a stream begin."""
    return _mixed(np.uint64(seed) * _GOLDEN + np.uint64(stream))


@compiled(inline=True, borrows=True, inner=True)
def _uniform(word: np.uint64) -> float:
    """In (0, 1), from the upper bits of a word."""
    return (np.float64(word >> _S11) + 0.5) * 2.0**-53


@compiled(borrows=True, inner=True)
def _unlikely(word: np.uint64) -> float:
    """What one word in a hundred needs: the edge of a layer, or the tail."""
    while True:
        layer = np.int64(word & _LAYER_OF)
        place = 2.0 * _uniform(word) - 1.0
        if abs(place) < _INSIDE[layer]:
            return float(place * _EDGES[layer])
        word = _mixed(word + _GOLDEN)
        if layer == 0:
            while True:
                x = -math.log(_uniform(word)) / _TAIL
                word = _mixed(word + _GOLDEN)
                if -2.0 * math.log(_uniform(word)) >= x * x:
                    return math.copysign(_TAIL + x, place)
                word = _mixed(word + _GOLDEN)
        x = place * _EDGES[layer]
        low = math.exp(-0.5 * (_EDGES[layer] * _EDGES[layer] - x * x))
        high = math.exp(-0.5 * (_EDGES[layer + 1] * _EDGES[layer + 1] - x * x))
        if low + _uniform(word) * (high - low) < 1.0:
            return float(x)
        word = _mixed(word + _GOLDEN)


@compiled(inline=True, borrows=True, inner=True)
def normal(key: np.uint64, counter: int) -> float:
    """A standard normal number by Marsaglia and Tsang's ziggurat from one hashed word."""
    word = _mixed(key + np.uint64(counter) * _GOLDEN)
    layer = np.int64(word & _LAYER_OF)
    place = 2.0 * _uniform(word) - 1.0
    if abs(place) < _INSIDE[layer]:
        return float(place * _EDGES[layer])
    return _unlikely(word)


@compiled(borrows=True)
def standard_normal(seed: int, stream: int, counter: int) -> float:
    """Number `counter` of a stream."""
    return normal(stream_key(seed, stream), counter)
