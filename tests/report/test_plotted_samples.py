"""Samples that pass by leave the extremes of all and whatever is asked for, with its gaps."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest
from support.histories import blocks_of

from lathe_chatter.array_types import Array
from lathe_chatter.recording.sample_blocks import SampleBlocks
from lathe_chatter.report.plotted_samples import RunSamples

RATE = 1000.0


def blocks(parts: Iterable[Array]) -> list[SampleBlocks]:
    return [blocks_of(dict(zip(('time', 'force'), part.T, strict=True))) for part in parts]


def signal(count: int, start: float = 0.0) -> Array:
    time = start + np.arange(1, count + 1) / RATE
    return np.column_stack((time, np.random.default_rng(3).normal(size=count)))


def test_the_extremes_are_those_of_all_samples() -> None:
    samples = signal(100_003)
    passed = RunSamples(lambda _spans: blocks(np.array_split(samples, 37)))
    assert (passed.count, passed.first, passed.last) == (100_003, 0.001, samples[-1, 0])
    assert not passed.gaps
    low, high = passed.extremes.of('force')
    assert 1000 < len(low) <= 4096
    assert (low.min(), high.max()) == (samples[:, 1].min(), samples[:, 1].max())
    edges = np.searchsorted(samples[:, 0], passed.extremes.times)
    assert np.array_equal(low, np.minimum.reduceat(samples[:, 1], edges))
    assert np.array_equal(high, np.maximum.reduceat(samples[:, 1], edges))


def test_a_short_signal_is_kept_as_it_is() -> None:
    samples = signal(500)
    passed = RunSamples(lambda _spans: blocks([samples]))
    assert passed.extremes.samples == 1
    assert np.array_equal(passed.extremes.of('force')[0], samples[:, 1])


@pytest.mark.parametrize('count', [400, 40_000])
def test_nothing_is_joined_over_a_gap(count: int) -> None:
    parts = [signal(count), signal(count, start=100.0), signal(count, start=50.0)]
    passed = RunSamples(lambda _spans: blocks(parts))
    ends = [part[-1, 0] for part in parts]
    assert passed.gaps == [(ends[0], 100.001)]
    assert passed.restarts == [(ends[1], 50.001)]
    times, low = passed.extremes.times, passed.extremes.of('force')[0]
    assert np.isnan(times).sum() == 2
    assert np.array_equal(np.isnan(times), np.isnan(low))
    # What is computed from a span begins after the last gap in it.
    (found,) = passed.between([(ends[0] - 0.1, 100.05)])
    assert np.array_equal(found['time'], parts[1][:50, 0])


def test_more_gaps_than_dots_do_not_fill_the_memory() -> None:
    parts = [signal(20, start=0.1 * k) for k in range(20_000)]
    passed = RunSamples(lambda _spans: blocks(parts))
    assert len(passed.gaps) == 19_999
    assert len(passed.extremes.low) <= 4096
    every = np.concatenate(parts)
    assert np.nanmax(passed.extremes.of('force')[1]) == every[:, 1].max()


def test_spans_are_every_sample_after_their_begin_up_to_their_end() -> None:
    samples = signal(10_000)
    passed = RunSamples(lambda _spans: blocks(np.array_split(samples, 11)))
    first, second = passed.between([(0.0, 0.25), (8.9985, 9.3)])
    assert np.array_equal(first['time'], samples[:250, 0])
    assert np.array_equal(second['force'], samples[8998:9300, 1])
