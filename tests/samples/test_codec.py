"""Blocks of samples as bytes, without ROS."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from support.recorded import block as by_rosbags

from lathe_chatter.array_types import Array
from lathe_chatter.errors import LayoutError
from lathe_chatter.samples.codec import SampleDecoder, encode_block


def block(rows: int, width: int = 8) -> Array:
    return np.random.default_rng(rows).standard_normal((rows, width))


@pytest.mark.parametrize('rows', [1, 20, 1000])
def test_the_bytes_are_those_of_rosbags(rows: int) -> None:
    assert encode_block(block(rows)) == by_rosbags(block(rows))


def test_a_view_of_other_memory_is_stored_row_by_row() -> None:
    samples = block(40, 16)[::2, ::2]
    assert SampleDecoder().decode(encode_block(samples))[0].tolist() == samples.tolist()


def test_names_and_columns_must_match() -> None:
    with pytest.raises(LayoutError, match='8 columns of samples have 2 names'):
        encode_block(block(3), ('a', 'b'))


@pytest.mark.parametrize('kept', [0, 3, 30, 200, -1])
def test_a_message_that_is_cut_off_is_refused(kept: int) -> None:
    data = encode_block(block(3))
    decoder = SampleDecoder()
    decoder.decode(data)
    with pytest.raises(LayoutError):
        decoder.decode(data[:kept])


def test_the_other_order_of_bytes_is_understood() -> None:
    decoder = SampleDecoder()
    foreign = swapped(encode_block(block(3)))
    for _ in range(2):
        assert decoder.decode(foreign)[0].tolist() == block(3).tolist()


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
