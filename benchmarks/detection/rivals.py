"""What others would do, for comparison: raw RMS, permutation entropy, once-per-turn variance."""

from __future__ import annotations

import itertools

import numpy as np
from simulator import RATE

from lathe_chatter.array_types import Array

HOP = 100
"""Samples from one value to the next."""
_RMS, _ENTROPY, _TURNS = 500, 3000, 8
_ORDER, _THIN = 4, 10


def raw_rms(samples: Array) -> Array:
    """RMS of the tool's displacement over 50 ms, m (hops,)."""
    tool = samples[:, 2] - np.median(samples[:, 2])
    sums = np.concatenate(([0.0], np.cumsum(tool**2)))
    ends = np.arange(HOP, len(samples) + 1, HOP)
    begins = np.maximum(ends - _RMS, 0)
    rms: Array = np.sqrt((sums[ends] - sums[begins]) / (ends - begins))
    return rms


def permutation_entropy(samples: Array) -> Array:
    """1 - normalised permutation entropy of order 4 of the tool at 1 kHz, over 0.3 s (hops,)."""
    thin = samples[: len(samples) // _THIN * _THIN, 2].reshape(-1, _THIN).mean(axis=1)
    windows = np.lib.stride_tricks.sliding_window_view(thin, _ORDER)
    code = (np.argsort(windows, axis=1) * _ORDER ** np.arange(_ORDER)).sum(axis=1)
    length = _ENTROPY // _THIN
    ends = np.arange(HOP // _THIN, len(thin) + 1, HOP // _THIN)
    last = np.maximum(ends - _ORDER + 1, 0)
    first = np.maximum(last - length, 0)
    entropy = np.zeros(len(ends))
    for order in itertools.permutations(range(_ORDER)):
        number = sum(place * _ORDER**k for k, place in enumerate(order))
        sums = np.concatenate(([0.0], np.cumsum(code == number)))
        share = (sums[last] - sums[first]) / np.maximum(last - first, 1)
        entropy -= share * np.log(np.where(share > 0.0, share, 1.0))
    result: Array = 1.0 - entropy / np.log(24.0)
    return np.where(last >= length, result, 0.0)


def once_per_turn(samples: Array) -> Array:
    """Variance at one spindle angle over 8 turns, over that of all samples (hops,)."""
    angle, relative = samples[:, 1], samples[:, 2] - samples[:, 3]
    marks = np.arange(1.0, np.floor(angle[-1]))
    at = np.interp(marks, angle, relative)
    times = np.interp(marks, angle, np.arange(1, len(angle) + 1))
    ends = np.arange(HOP, len(samples) + 1, HOP)
    last = np.searchsorted(times, ends, side='right')
    result = np.zeros(len(ends))
    good = last >= _TURNS + 1
    spread = _rolling_variance(at, last[good], last[good] - _TURNS)
    begin = times[last[good] - _TURNS - 1].astype(np.int64)
    whole = _rolling_variance(relative, ends[good], begin)
    with np.errstate(over='ignore'):  # what grows without bound, and is flagged long before
        result[good] = spread / np.maximum(whole, 1e-300)
    return result


def _rolling_variance(values: Array, ends: Array, begins: Array) -> Array:
    """Variance of values[begin:end] for arrays of both."""
    centred = values - values.mean()
    sums = np.concatenate(([0.0], np.cumsum(centred)))
    squares = np.concatenate(([0.0], np.cumsum(centred**2)))
    count = ends - begins
    mean = (sums[ends] - sums[begins]) / count
    variance: Array = (squares[ends] - squares[begins]) / count - mean**2
    return variance


RIVALS = {
    'raw RMS': raw_rms,
    'permutation entropy': permutation_entropy,
    'once-per-turn variance': once_per_turn,
}
assert RATE == 1e4  # noqa: S101 -- the lengths above are in samples of this rate
