"""Samples of several lathes on one topic are told from losses and restarts of one."""

from __future__ import annotations

import numpy as np
import pytest

from lathe_chatter.array_types import Array
from lathe_chatter.samples.continuity import BlockOrder
from lathe_chatter.samples.mixed_streams import MixedContinuity

RATE = 1e4


def times(first: int, count: int = 20) -> Array:
    return np.arange(first, first + count) / RATE


def counts(heard: MixedContinuity) -> tuple[int, int, int]:
    return heard.lost, heard.gaps, heard.restarts


@pytest.mark.parametrize('ahead', [0, 7, 1_676_400])
@pytest.mark.parametrize('lathes', [2, 3])
@pytest.mark.parametrize('by_block', [True, False])
def test_lathes_that_send_at_once_lose_nothing_and_start_once(
    by_block: bool, lathes: int, ahead: int
) -> None:
    heard = MixedContinuity(remember=True)
    blocks = [times(1 + 20 * k + ahead * lathe) for k in range(200) for lathe in range(lathes)]
    if by_block:
        for block in blocks:
            heard.join(block)
    else:
        heard.follow(np.concatenate(blocks))
    assert counts(heard) == (0, 0, 0)
    assert (heard.gap_places, heard.restart_places) == ([], [])
    assert heard.mixed > 190
    assert heard.samples == 20 * len(blocks)


def test_what_is_lost_before_and_after_others_send_is_counted() -> None:
    heard = MixedContinuity(remember=True)
    heard.join(times(1))
    heard.join(times(61))  # 40 are missing
    for k in range(50):
        heard.join(times(90_001 + 20 * k))
        heard.join(times(81 + 20 * k))
    assert heard.join(times(81 + 20 * 51)) is BlockOrder.GAP  # 20 are missing
    assert heard.join(times(1)) is BlockOrder.RESTART
    assert counts(heard) == (60, 2, 1)
    assert heard.gap_places == [(0.0020, 0.0061), (0.1080, 0.1101)]
    assert heard.restart_places == [(0.1120, 0.0001)]
    assert (heard.mixed_from, heard.mixed_until) == (0.0081, 0.1061)


def test_a_lathe_that_is_reset_again_and_again_is_one() -> None:
    heard = MixedContinuity()
    for reset in range(1, 30):
        for k in range(reset):
            heard.join(times(1 + 20 * k))
    assert (heard.mixed, heard.restarts) == (0, 28)
