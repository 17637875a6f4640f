"""Blocks of samples that a node takes at once, and those that it must look at one by one."""

from __future__ import annotations

import numpy as np
from std_msgs.msg import Float64MultiArray
from support.node_bench import Bench

from lathe_chatter.array_types import Array
from lathe_chatter.errors import LatheChatterError
from lathe_chatter.nodes.sample_receiver import SampleBatch, SampleSubscription, join_blocks
from lathe_chatter.samples.codec import encode_block

COLUMNS = ('time', 'tool_displacement')


def block(first: int, count: int) -> Array:
    times = 1e-4 * np.arange(first, first + count)
    return np.column_stack([times, np.sin(times)])


def test_blocks_in_a_row_are_one() -> None:
    (fed,) = join_blocks([block(0, 20), block(20, 20), block(40, 1)], COLUMNS)
    assert fed.evenly
    assert np.array_equal(fed.samples, block(0, 41))


def test_blocks_with_a_gap_a_jump_back_or_no_times_stay_apart() -> None:
    for blocks in ([block(0, 20), block(40, 20)], [block(20, 20), block(0, 20)]):
        fed = [*join_blocks(blocks, COLUMNS)]
        assert [each.evenly for each in fed] == [False, False]
        assert all(each.samples is given for each, given in zip(fed, blocks, strict=True))
    (fed,) = join_blocks([block(0, 20)], ('angle', 'tool_displacement'))
    assert not fed.evenly


def test_no_blocks_are_nothing() -> None:
    assert not [*join_blocks([], COLUMNS)]


def test_what_is_no_block_is_complained_of_and_the_rest_taken(bench: Bench) -> None:
    complaints: list[LatheChatterError] = []
    taken: list[SampleBatch] = []
    feed = SampleSubscription(bench.node, complaints.append)
    publisher = bench.talk(Float64MultiArray, 'lathe/samples')
    publisher.publish(encode_block(block(0, 20), COLUMNS))
    publisher.publish(Float64MultiArray(data=[1.0, 2.0]))
    publisher.publish(encode_block(block(20, 20), COLUMNS))
    publisher.publish(encode_block(block(40, 20), ('time', 'workpiece_displacement')))

    def has_all() -> bool:
        taken.extend(feed.take())
        return sum(len(each.samples) for each in taken) == 60

    bench.spin_until(has_all)
    assert len(complaints) == 1
    assert 'dimensions' in str(complaints[0])
    assert {each.columns[1] for each in taken} == {'tool_displacement', 'workpiece_displacement'}
