"""Blocks of samples and their messages, there and back through the bytes that DDS carries."""

from __future__ import annotations

import struct
from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Float64, Float64MultiArray

from lathe_chatter.arrays import Array
from lathe_chatter.errors import LayoutError
from lathe_chatter.nodes.messages import (
    BlockReader,
    Wire,
    joint_states,
    nanoseconds,
    samples_from_message,
    samples_to_message,
    time_message,
)
from lathe_chatter.samples import SAMPLE_COLUMNS


def block(rows: int, width: int, seed: int = 0) -> Array:
    return np.random.default_rng(seed).standard_normal((rows, width))


@pytest.mark.parametrize('rows', [0, 1, 20, 1000])
def test_a_block_survives_the_wire_bit_for_bit(rows: int) -> None:
    samples = block(rows, 8)
    wire = serialize_message(samples_to_message(samples))
    back, columns = samples_from_message(deserialize_message(wire, Float64MultiArray))
    assert columns == SAMPLE_COLUMNS
    assert back.shape == (rows, 8)
    assert back.tobytes() == samples.tobytes()


def test_ready_made_bytes_are_the_message() -> None:
    wire = Wire()
    for rows in (20, 20, 7, 0, 1000):  # not compared as bytes: padding is left as it was found
        samples = block(rows, 8, seed=rows)
        message = deserialize_message(wire.block(samples), Float64MultiArray)
        assert message == samples_to_message(samples)
    for value in (0.0, -1.5e-300, float('inf')):
        assert deserialize_message(wire.number(value), Float64) == Float64(data=value)


def test_a_reader_takes_every_block_for_what_it_is() -> None:
    reader, wire = BlockReader(), Wire()
    names = tuple('abcdefgh')
    for seed, (rows, columns) in enumerate(
        [(20, SAMPLE_COLUMNS), (20, SAMPLE_COLUMNS), (20, names), (7, names), (20, names)]
    ):
        samples = block(rows, 8, seed=seed)
        message = samples_to_message(samples, columns)
        back, named = reader.read(serialize_message(message))
        assert named == columns
        assert back.tobytes() == samples.tobytes()
        again, named = reader.read(wire.block(samples))
        assert named == SAMPLE_COLUMNS
        assert again.tobytes() == samples.tobytes()


def test_a_reader_heeds_the_offset_and_the_order_of_bytes() -> None:
    reader = BlockReader()
    for first in (1.0, 2.0):
        message = samples_to_message(block(3, 8))
        message.layout.data_offset = 1
        message.data.insert(0, first)
        back, _ = reader.read(serialize_message(message))
        assert back.tobytes() == block(3, 8).tobytes()
    # The other order: bytes of a machine whose numbers have their large end first.
    foreign = swapped(serialize_message(samples_to_message(block(3, 8))))
    for _ in range(2):
        back, _ = reader.read(foreign)
        assert back.tolist() == block(3, 8).tolist()


def swapped(data: bytes) -> bytes:
    """A serialised block of 3 x 8 doubles in the other order of bytes."""
    numbers = np.frombuffer(data[-3 * 8 * 8 :], '<f8').astype('>f8').tobytes()
    label = data.index(b'cutting_force') + len(b'cutting_force') + 1
    start = data.index(b'time,') - 4
    text = data[start + 4 : label]

    def words(*values: int) -> bytes:
        return struct.pack(f'>{len(values)}I', *values)

    body = words(2, 7) + b'sample\0\0' + words(3, 24) + words(len(text)) + text
    body += b'\0' * (-len(body) % 4) + words(8, 8) + words(0, 24)
    body += b'\0' * (-len(body) % 8)
    return b'\0\0\0\0' + body + numbers


def test_the_layout_is_that_of_the_contract() -> None:
    layout = samples_to_message(block(20, 8)).layout
    assert layout.data_offset == 0
    assert [(d.label, d.size, d.stride) for d in layout.dim] == [
        ('sample', 20, 160),
        (
            (
                'time,spindle_angle,tool_displacement,tool_velocity,workpiece_displacement,'
                'workpiece_velocity,chip_thickness,cutting_force'
            ),
            8,
            8,
        ),
    ]


def test_a_view_of_other_memory_is_stored_row_by_row() -> None:
    samples = block(40, 16)[::2, ::2]
    message = samples_to_message(samples)
    assert message.data.tolist() == samples.ravel().tolist()


def test_other_columns_and_an_offset_are_read() -> None:
    samples = block(5, 3)
    message = samples_to_message(samples, ('time', 'tool_velocity', 'temperature'))
    message.data = message.data[:2] + message.data
    message.layout.data_offset = 2
    back, columns = samples_from_message(message)
    assert columns == ('time', 'tool_velocity', 'temperature')
    np.testing.assert_array_equal(back, samples)


def spoil(change: Callable[[Float64MultiArray], object]) -> Float64MultiArray:
    message = samples_to_message(block(4, 8))
    change(message)
    return message


@pytest.mark.parametrize(
    'message',
    [
        Float64MultiArray(),
        spoil(lambda m: m.layout.dim.pop()),
        spoil(lambda m: m.data.pop()),
        spoil(lambda m: setattr(m.layout.dim[0], 'size', 5)),
        spoil(lambda m: setattr(m.layout.dim[1], 'label', 'time')),
        spoil(lambda m: setattr(m.layout.dim[1], 'stride', 9)),
        spoil(lambda m: setattr(m.layout, 'data_offset', 1)),
    ],
)
def test_a_layout_that_does_not_fit_is_refused(message: Float64MultiArray) -> None:
    with pytest.raises(LayoutError):
        samples_from_message(message)


def test_names_and_columns_must_match() -> None:
    with pytest.raises(LayoutError, match='8 columns of samples have 2 names'):
        samples_to_message(block(3, 8), ('a', 'b'))


@pytest.mark.parametrize('rate', [1e4, 12_345.678, 3.0, 44_100.0])
@pytest.mark.parametrize('count', [0, 1, 7, 10**6 + 1, 3 * 10**12 + 1])
def test_simulated_time_is_the_nearest_whole_nanosecond(count: int, rate: float) -> None:
    exact = Fraction(count) * 10**9 / Fraction(rate)
    assert abs(nanoseconds(count, rate) - exact) <= Fraction(1, 2)


def test_a_stamp_splits_at_the_second() -> None:
    stamp = time_message(12_000_000_003)
    assert (stamp.sec, stamp.nanosec) == (12, 3)


def test_the_joints_carry_opposite_forces() -> None:
    sample = np.arange(8.0)
    message = joint_states(sample, 1_500_000_000)
    assert message.name == ['tool', 'workpiece']
    assert message.position.tolist() == [2.0, 4.0]
    assert message.velocity.tolist() == [3.0, 5.0]
    assert message.effort.tolist() == [-7.0, 7.0]
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (1, 500_000_000)
