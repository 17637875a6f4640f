"""Blocks of samples straight from serialised messages (std_msgs/Float64MultiArray, CDR)."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lathe_chatter.arrays import Array, Integers
from lathe_chatter.errors import LayoutError
from lathe_chatter.recording.chunk_messages import Messages

SAMPLES_TYPE = 'std_msgs/msg/Float64MultiArray'
_LITTLE_ENDIAN = b'\x00\x01'
_ENCAPSULATION = 4
_DIMENSIONS = 2


class Layout(NamedTuple):
    """Where the numbers of a serialised block of samples are.

    Attributes:
        columns: Their names.
        rows: How many samples.
        start: Byte of the first number.
    """

    columns: tuple[str, ...]
    rows: int
    start: int

    @property
    def size(self) -> int:
        """Bytes of the numbers."""
        return 8 * self.rows * len(self.columns)


class Blocks(NamedTuple):
    """Blocks of samples that follow each other.

    Attributes:
        columns: Names.
        samples: Of all blocks (n, k).
        rows: Samples in each block (blocks,).
        log_times: When each was received, ns (blocks,).
        publish_times: When each was published, ns (blocks,).
    """

    columns: tuple[str, ...]
    samples: Array
    rows: Integers
    log_times: Integers
    publish_times: Integers


def layout_of(data: bytes) -> Layout:
    """The layout of a serialised block.

    Raises:
        LayoutError: If it is no block of samples as the contract has them.
    """
    try:
        return _layout_of(data)
    except (struct.error, UnicodeDecodeError):
        raise LayoutError('A message of samples is cut off or no Float64MultiArray.') from None


def _layout_of(data: bytes) -> Layout:
    if data[:2] != _LITTLE_ENDIAN:
        raise LayoutError('A message of samples is not little-endian CDR.')
    body = memoryview(data)[_ENCAPSULATION:]
    (dimensions,) = struct.unpack_from('<I', body)
    if dimensions != _DIMENSIONS:
        raise LayoutError(f'A message of samples has {dimensions} dimensions and not 2.')
    place = 4
    names: list[str] = []
    sizes: list[int] = []
    for _ in range(dimensions):
        (letters,) = struct.unpack_from('<I', body, place)
        place += 4
        if place + letters > len(body):
            raise LayoutError('A message of samples is cut off or no Float64MultiArray.')
        names.append(bytes(body[place : place + letters]).rstrip(b'\x00').decode())
        place += letters + -letters % 4
        sizes.append(struct.unpack_from('<II', body, place)[0])
        place += 8
    skipped, count = struct.unpack_from('<II', body, place)
    place += 8
    place += -place % 8
    columns = tuple(names[1].split(','))
    if skipped or sizes[1] != len(columns) or count != sizes[0] * sizes[1]:
        raise LayoutError('A message of samples has other sizes than its layout says.')
    if place + 8 * count > len(body):
        raise LayoutError('A message of samples is cut off or no Float64MultiArray.')
    return Layout(columns, sizes[0], _ENCAPSULATION + place)


def blocks_of(messages: Messages) -> Iterator[Blocks]:
    """The blocks in messages of one channel: as few arrays as their layouts allow.

    Raises:
        LayoutError: If a message is no block of samples.
    """
    begun = 0
    while begun < len(messages.heads):
        layout = layout_of(messages.payload(begun))
        count = _alike(messages, begun, layout)
        chosen = slice(begun, begun + count)
        numbers = _cut_out(messages.records, messages.starts[chosen] + layout.start, layout.size)
        yield Blocks(
            layout.columns,
            numbers.view('<f8').reshape(-1, len(layout.columns)),
            np.full(count, layout.rows),
            messages.heads['log_time'][chosen].astype(np.int64),
            messages.heads['publish_time'][chosen].astype(np.int64),
        )
        begun += count


def _alike(messages: Messages, begun: int, layout: Layout) -> int:
    """How many messages from one on have its size and its very head."""
    sizes = messages.sizes[begun:]
    other = np.flatnonzero(sizes != sizes[0])
    count = int(other[0]) if len(other) else len(sizes)
    starts = messages.starts[begun : begun + count]
    heads = _cut_out(messages.records, starts, layout.start).reshape(count, -1)
    different = np.flatnonzero((heads != heads[0]).any(axis=1))
    return int(different[0]) if len(different) else count


def _cut_out(records: bytes, starts: Integers, size: int) -> NDArray[np.uint8]:
    """The bytes of equal pieces that begin anywhere, joined."""
    if size == 0:
        return np.zeros(0, np.uint8)
    every: NDArray[Any] = np.ndarray(
        (len(records) - size + 1,), f'V{size}', buffer=records, strides=(1,)
    )
    return np.ascontiguousarray(every[starts]).view(np.uint8)
