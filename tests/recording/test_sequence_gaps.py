"""Losses told by numbers alone, against losses that the test made itself."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lathe_chatter.recording.sequence_gaps import Loss, Numbering


def follow(numbers: list[int], publishers: int) -> int:
    numbering = Numbering()
    for k, number in enumerate(numbers):
        numbering.take(number, now=0.01 * k)
    numbering.settle(publishers, math.inf)
    return numbering.lost


def test_nothing_is_lost_where_every_number_follows() -> None:
    assert follow(list(range(1, 1000)), 1) == 0


def test_gaps_are_counted_message_by_message() -> None:
    came = np.random.default_rng(1).random(2001) > 0.1
    kept = [n for n in range(1, 2001) if n in (1, 2000) or came[n]]
    assert follow(kept, 1) == 2000 - len(kept)


def test_what_was_published_before_is_counted_apart() -> None:
    numbering = Numbering()
    for number in (50, 51, 52):
        numbering.take(number, now=0.0)
    numbering.settle(1, math.inf)
    assert (numbering.before, numbering.lost) == (49, 0)


def test_a_loss_says_between_which_messages_it_is() -> None:
    numbering = Numbering()
    for number, now in ((1, 0.1), (2, 0.2), (7, 0.7), (8, 0.8)):
        numbering.take(number, now)
    numbering.settle(1, math.inf)
    assert numbering.losses == [Loss(4, 0.2, 0.7)]


def test_publishers_that_take_turns_lose_nothing() -> None:
    publishers = iter(range(1, 400)), iter(range(70, 400)), iter(range(9, 400))
    turns = np.random.default_rng(2).integers(3, size=300)
    assert follow([next(publishers[turn]) for turn in turns], 3) == 0


def test_a_publisher_that_joins_before_the_graph_knows_it_is_no_loss() -> None:
    numbering = Numbering()
    for k in range(100):
        numbering.take(k + 1, now=0.01 * k)
        if k >= 50:
            numbering.take(k + 1000, now=0.01 * k)
        numbering.settle(1 if k < 90 else 2, now=0.01 * k)
    numbering.settle(2, math.inf)
    assert numbering.lost == 0


def test_a_publisher_that_was_started_again_is_no_loss() -> None:
    assert follow([*range(1, 100), *range(1, 50)], 1) == 0


def test_a_gap_after_a_publisher_that_took_the_place_of_another_is_found() -> None:
    """Also where the first messages of the new one were sent before it was heard."""
    assert follow([*range(1, 500), *range(30, 100), *range(150, 300)], 2) == 50


def test_a_gap_of_one_publisher_among_others_is_found() -> None:
    first = iter([*range(1, 50), *range(60, 150)])
    second = iter(range(1000, 1200))
    mixed = [number for pair in zip(first, second, strict=False) for number in pair]
    assert follow(mixed, 2) == 10


@pytest.mark.parametrize('seed', range(20))
def test_many_at_once_are_as_one_after_the_other(seed: int) -> None:
    generator = np.random.default_rng(seed)
    numbers: list[int] = []
    reached = [0, 40]  # of two publishers, with losses now and then
    for _ in range(30):
        who = int(generator.integers(2))
        reached[who] += int(generator.choice([0, 0, 0, 3]))
        count = int(generator.integers(1, 6))
        numbers += range(reached[who] + 1, reached[who] + count + 1)
        reached[who] += count
    times = np.arange(len(numbers)) * 0.5
    single, many = Numbering(), Numbering()
    for number, time in zip(numbers, times.tolist(), strict=True):
        single.take(number, time)
    for part in np.array_split(np.arange(len(numbers)), 7):
        many.take_many(np.array(numbers)[part], times[part])
    for each in (single, many):
        each.settle(2, math.inf)
    assert many.before == single.before
    assert many.losses == single.losses
