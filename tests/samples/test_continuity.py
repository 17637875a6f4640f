"""Lost samples, proven from the times in the payload."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lathe_chatter.array_types import Array
from lathe_chatter.errors import LayoutError
from lathe_chatter.samples.continuity import BlockOrder, Continuity, follow_evenly, times_of

RATE = 1e4


def times(first: int, count: int) -> Array:
    return np.arange(first, first + count) / RATE


@pytest.mark.parametrize('start', [0, 36_000_000_000])
@pytest.mark.parametrize('size', [1, 20, 1000])
def test_blocks_that_follow_each_other_are_contiguous_after_any_time(
    start: int, size: int
) -> None:
    heard = Continuity()
    orders = [heard.join(times(start + k * size, size)) for k in range(1, 50)]
    expected = [BlockOrder.FIRST] + [BlockOrder.CONTIGUOUS] * 48
    assert orders[2 if size == 1 else 0 :] == expected[2 if size == 1 else 0 :]
    assert (heard.samples, heard.lost) == (49 * size, 0)


def test_every_lost_sample_is_counted() -> None:
    random = np.random.default_rng(4)
    heard = Continuity()
    heard.join(times(0, 20))
    next_sample, lost = 20, 0
    for missing in random.integers(0, 5, 200).tolist():
        order = heard.join(times(next_sample + missing, 20))
        assert order is (BlockOrder.GAP if missing else BlockOrder.CONTIGUOUS)
        next_sample += missing + 20
        lost += missing
    assert heard.lost == lost
    assert heard.samples == 201 * 20


def test_time_that_goes_back_is_another_run() -> None:
    heard = Continuity()
    heard.join(times(5000, 20))
    assert heard.join(times(1, 20)) is BlockOrder.RESTART
    assert heard.join(times(21, 20)) is BlockOrder.CONTIGUOUS
    assert (heard.lost, heard.restarts) == (0, 1)


def test_a_block_that_comes_twice_is_no_loss() -> None:
    heard = Continuity()
    heard.join(times(0, 20))
    assert heard.join(times(0, 20)) is BlockOrder.RESTART
    assert heard.lost == 0


@pytest.mark.parametrize(
    ('given', 'even'),
    [
        ([], True),
        ([2.0], True),
        ([math.nan], False),
        ([0.1, 0.2, 0.3], True),
        ([0.1, 0.2, 0.4], False),  # one is missing
        ([0.1, 0.2, 0.2], False),
        ([0.3, 0.2, 0.1], False),
        ([0.1, math.nan, 0.3], False),
        ([0.1, 0.2, math.inf], False),
    ],
)
def test_times_follow_evenly_or_not(given: list[float], even: bool) -> None:
    assert follow_evenly(np.array(given)) is even


@pytest.mark.parametrize('given', [[0.1, math.nan], [0.1, math.inf], [0.2, 0.1], [0.1, 0.1]])
def test_times_that_are_none_are_refused(given: list[float]) -> None:
    samples = np.array([[0.0, time] for time in given])
    with pytest.raises(LayoutError, match='not finite, or do not increase'):
        times_of(samples, ('tool_displacement', 'time'))


def test_samples_without_times_are_refused() -> None:
    with pytest.raises(LayoutError, match='no column time, only tool_displacement'):
        times_of(np.zeros((3, 1)), ('tool_displacement',))


def test_samples_of_another_lathe_are_not_missing() -> None:
    heard = Continuity()
    heard.join(times(0, 100))
    assert heard.join(times(300, 100), lambda: True) is BlockOrder.RESTART
    assert heard.join(times(400, 100), lambda: True) is BlockOrder.CONTIGUOUS
    assert heard.join(times(700, 100), lambda: False) is BlockOrder.GAP
    assert (heard.restarts, heard.gaps, heard.lost) == (1, 1, 200)
