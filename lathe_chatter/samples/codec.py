"""A block of samples as the bytes of a message, std_msgs/Float64MultiArray in CDR, and back.

Row-major: `dim[0]` counts the samples, `dim[1]` has the names of the columns as its label, joined
by commas. Nothing before the numbers changes from block to block of one lathe: it is made, or
understood, once: to have a message of ROS made and serialised costs as much as several ticks.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.errors import LayoutError
from lathe_chatter.samples.columns import SAMPLE_COLUMNS

SAMPLES_TYPE = 'std_msgs/msg/Float64MultiArray'
ENCAPSULATION = b'\x00\x01\x00\x00'
"""What CDR begins with, little-endian."""
_BYTE_ORDERS = {b'\x00\x00': '>', b'\x00\x01': '<'}
_NUMBERS = {order: np.dtype(f'{order}f8') for order in _BYTE_ORDERS.values()}
_NUMBER = _NUMBERS['<']
_DIMENSIONS = 2
_CUT_OFF = 'A message of samples is cut off or no Float64MultiArray.'


class BlockLayout(NamedTuple):
    """Where the numbers of a serialised block of samples are.

    Attributes:
        columns: Their names.
        rows: How many samples.
        start: Byte of the first number.
        order: Of the bytes of a number, '<' or '>'.
    """

    columns: tuple[str, ...]
    rows: int
    start: int
    order: str = '<'

    @property
    def size(self) -> int:
        """Bytes of the numbers."""
        return 8 * self.rows * len(self.columns)

    def numbers(self, data: bytes) -> Array:
        """The samples (n, k) of a block with this layout, read-only where nothing is converted."""
        width = len(self.columns)
        found = np.frombuffer(data, _NUMBERS[self.order], self.rows * width, self.start)
        numbers: Array = found.reshape(self.rows, width)
        return numbers if numbers.dtype.isnative else numbers.astype(float)


def block_layout(data: bytes) -> BlockLayout:
    """The layout of a serialised block.

    Raises:
        LayoutError: If it is no block of samples as the contract has them.
    """
    try:
        return _block_layout(data)
    except (struct.error, UnicodeDecodeError):
        raise LayoutError(_CUT_OFF) from None


def _block_layout(data: bytes) -> BlockLayout:
    order = _BYTE_ORDERS.get(bytes(data[:2]))
    if order is None:
        raise LayoutError('A message of samples is not CDR.')
    body = memoryview(data)[len(ENCAPSULATION) :]  # CDR aligns from here
    words = struct.Struct(f'{order}II')
    (dimensions,) = struct.unpack_from(f'{order}I', body)
    if dimensions != _DIMENSIONS:
        raise LayoutError(f'A block of samples has 2 dimensions, not {dimensions}.')
    place = 4
    labels: list[str] = []
    shape: list[tuple[int, int]] = []  # size and stride
    for _ in range(dimensions):
        (letters,) = struct.unpack_from(f'{order}I', body, place)
        place += 4
        if place + letters > len(body):
            raise LayoutError(_CUT_OFF)
        labels.append(bytes(body[place : place + letters]).rstrip(b'\x00').decode())
        place += letters + -letters % 4
        shape.append(words.unpack_from(body, place))
        place += words.size
    skipped, count = words.unpack_from(body, place)
    place += words.size
    place += -place % 8 if count else 0
    columns = tuple(name.strip() for name in labels[1].split(','))
    (rows, _), (width, stride) = shape
    if width != len(columns):
        raise LayoutError(f'The label {labels[1]!r} does not name {width} columns.')
    if stride != width or count != skipped + rows * width:
        raise LayoutError(
            f'{rows} samples of {width} columns after an offset of {skipped} '
            f'do not make {count} numbers.'
        )
    if place + 8 * count > len(body):
        raise LayoutError(_CUT_OFF)
    return BlockLayout(columns, rows, len(ENCAPSULATION) + place + 8 * skipped, order)


def encode_block(samples: Array, columns: Sequence[str] = SAMPLE_COLUMNS) -> bytes:
    """The message of a block of samples (n, k) with the names of its k columns.

    Raises:
        LayoutError: If names and columns do not match.
    """
    numbers = samples if samples.dtype is _NUMBER else samples.astype(_NUMBER)
    return _head(*samples.shape, tuple(columns)) + numbers.tobytes()


@lru_cache(maxsize=64)
def _head(rows: int, width: int, columns: tuple[str, ...]) -> bytes:
    """What stands before the numbers of a block."""
    if width != len(columns):
        raise LayoutError(f'{width} columns of samples have {len(columns)} names.')
    body = struct.pack('<I', _DIMENSIONS)
    for label, size, stride in (('sample', rows, rows * width), (','.join(columns), width, width)):
        text = label.encode() + b'\0'
        body += struct.pack('<I', len(text)) + text + bytes(-len(text) % 4)
        body += struct.pack('<II', size, stride)
    body += struct.pack('<II', 0, rows * width)
    return ENCAPSULATION + body + bytes(-len(body) % 8 if rows else 0)


def encode_number(value: float) -> bytes:
    """The message of a number, std_msgs/Float64."""
    return struct.pack('<4sd', ENCAPSULATION, value)


class SampleDecoder:
    """Blocks of samples from the messages of one topic, one after the other."""

    def __init__(self) -> None:
        """Begin with nothing known."""
        self._head = b''
        self._layout: BlockLayout | None = None

    def decode(self, data: bytes) -> tuple[Array, tuple[str, ...]]:
        """The samples (n, k) of a message, and the names of its k columns.

        Raises:
            LayoutError: If it is no block of samples.
        """
        layout = self._layout
        if layout is None or not data.startswith(self._head):
            layout = block_layout(data)
            self._layout, self._head = layout, data[: layout.start]
        elif len(data) < layout.start + layout.size:
            raise LayoutError(_CUT_OFF)
        return layout.numbers(data), layout.columns
