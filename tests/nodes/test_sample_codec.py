"""Blocks of samples as bytes, beside what ROS itself makes and understands of them."""

from __future__ import annotations

from array import array
from collections.abc import Callable

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Float64, Float64MultiArray, MultiArrayDimension, MultiArrayLayout

from lathe_chatter.array_types import Array
from lathe_chatter.errors import LayoutError
from lathe_chatter.samples import SAMPLE_COLUMNS
from lathe_chatter.samples.codec import SampleDecoder, encode_block, encode_number


def block(rows: int, width: int, seed: int = 0) -> Array:
    return np.random.default_rng(seed).standard_normal((rows, width))


def message_of(samples: Array, columns: tuple[str, ...] = SAMPLE_COLUMNS) -> Float64MultiArray:
    rows, width = samples.shape
    dim = [
        MultiArrayDimension(label='sample', size=rows, stride=rows * width),
        MultiArrayDimension(label=','.join(columns), size=width, stride=width),
    ]
    data = array('d', samples.tobytes())
    return Float64MultiArray(layout=MultiArrayLayout(dim=dim), data=data)


def test_ros_understands_what_is_encoded() -> None:
    for rows in (20, 20, 7, 0, 1000):  # not compared as bytes: ROS leaves padding as it was
        samples = block(rows, 8, seed=rows)
        message = deserialize_message(encode_block(samples), Float64MultiArray)
        assert message == message_of(samples)
    for value in (0.0, -1.5e-300, float('inf')):
        assert deserialize_message(encode_number(value), Float64) == Float64(data=value)


def test_what_ros_makes_is_decoded_whatever_came_before() -> None:
    decoder = SampleDecoder()
    names = tuple('abcdefgh')
    for seed, (rows, columns) in enumerate(
        [(20, SAMPLE_COLUMNS), (20, SAMPLE_COLUMNS), (20, names), (7, names), (0, names)]
    ):
        samples = block(rows, 8, seed=seed)
        for data in (serialize_message(message_of(samples, columns)), encode_block(samples)):
            back, named = decoder.decode(data)
            assert back.tobytes() == samples.tobytes()
            assert back.shape == samples.shape
            assert named in {columns, SAMPLE_COLUMNS}


@pytest.mark.parametrize('offset', [1, 2])
def test_an_offset_is_heeded(offset: int) -> None:
    decoder = SampleDecoder()
    columns = ('time', 'tool_velocity', 'temperature')
    for first in (1.0, 2.0):
        message = message_of(block(3, 3), columns)
        message.layout.data_offset = offset
        message.data[:0] = array('d', [first] * offset)
        back, named = decoder.decode(serialize_message(message))
        assert back.tobytes() == block(3, 3).tobytes()
        assert named == columns


def spoil(change: Callable[[Float64MultiArray], object]) -> Float64MultiArray:
    message = message_of(block(4, 8))
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
        SampleDecoder().decode(serialize_message(message))
