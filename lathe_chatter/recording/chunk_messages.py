"""The messages of a chunk as arrays: no message is touched by itself."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from lathe_chatter.arrays import Integers
from lathe_chatter.recording.mcap_reader import Chunk

HEAD = np.dtype(
    [
        ('opcode', 'u1'),
        ('length', '<u8'),
        ('channel', '<u2'),
        ('sequence', '<u4'),
        ('log_time', '<u8'),
        ('publish_time', '<u8'),
    ]
)
_BEFORE = 9
"""Bytes of opcode and length, which the length does not count."""


class Messages(NamedTuple):
    """Messages within the records of a chunk.

    Attributes:
        records: The bytes that hold them all.
        heads: Of `HEAD`, (n,).
        starts: Where each payload begins (n,).
        others: Offsets of the records that are no messages: schemas and channels.
    """

    records: bytes
    heads: NDArray[Any]
    starts: Integers
    others: list[int]

    def of(self, channel: int) -> Messages:
        """Those of one channel."""
        mine = self.heads['channel'] == channel
        return self._replace(heads=self.heads[mine], starts=self.starts[mine])

    @property
    def sizes(self) -> Integers:
        """Of each payload, bytes (n,)."""
        return self.heads['length'].astype(np.int64) - (HEAD.itemsize - _BEFORE)

    def payload(self, place: int) -> bytes:
        """The bytes of one message."""
        start = int(self.starts[place])
        return self.records[start : start + int(self.sizes[place])]


def joined_messages(parts: Sequence[Messages]) -> Messages:
    """The messages of several chunks as if they were of one."""
    begins = np.cumsum([0, *(len(part.records) for part in parts[:-1])])
    return Messages(
        b''.join(part.records for part in parts),
        np.concatenate([part.heads for part in parts]),
        np.concatenate([part.starts + begin for part, begin in zip(parts, begins, strict=True)]),
        [],
    )


def messages_of(chunk: Chunk) -> Messages:
    """All messages of a chunk, in the order in which they were written.

    The indexes behind a chunk say where its messages are, but no CRC covers them: they are used
    where together with the other records they account for every byte, else the records are
    walked.

    Raises:
        ValueError: If the records do not follow each other; their CRC was right, so they were
            written that way.
    """
    found = _by_indexes(chunk)
    if found is None:
        offsets, others = _by_walking(chunk.records, 0, len(chunk.records))
        heads = _heads(chunk.records, offsets)
    else:
        offsets, heads, others = found
    return Messages(chunk.records, heads, offsets + HEAD.itemsize, others)


def _heads(records: bytes, offsets: Integers) -> NDArray[Any]:
    """The heads at any offsets, aligned or not."""
    if not len(offsets):
        return np.zeros(0, HEAD)
    every: NDArray[Any] = np.ndarray(
        (len(records) - HEAD.itemsize + 1,), HEAD, buffer=records, strides=(1,)
    )
    heads: NDArray[Any] = every[offsets]
    return heads


def _by_indexes(chunk: Chunk) -> tuple[Integers, NDArray[Any], list[int]] | None:
    """Offsets and heads of messages, and offsets of other records; None if they are not told."""
    if not chunk.indexes or any(len(index) % 16 for index in chunk.indexes.values()):
        return None
    pairs = np.frombuffer(b''.join(chunk.indexes.values()), '<u8')
    offsets = pairs[1::2].astype(np.int64)
    if len(chunk.indexes) > 1:  # that of one channel is in order
        offsets.sort()
    size = len(chunk.records)
    if not len(offsets) or offsets.min() < 0 or offsets.max() > size - HEAD.itemsize:
        return None
    heads = _heads(chunk.records, offsets)
    ends = offsets + heads['length'].astype(np.int64) + _BEFORE
    if not np.all(heads['opcode'] == Opcode.MESSAGE):
        return None
    # What lies between two messages, before the first and after the last.
    begins = np.concatenate((np.zeros(1, np.int64), ends))
    stops = np.concatenate((offsets, np.full(1, size)))
    others: list[int] = []
    for place in np.flatnonzero(begins != stops):
        try:
            between, more = _by_walking(chunk.records, int(begins[place]), int(stops[place]))
        except ValueError:
            return None
        if len(between):
            return None
        others += more
    return offsets, heads, others


def _by_walking(records: bytes, start: int, stop: int) -> tuple[Integers, list[int]]:
    """Offsets of messages and of other records from one place to another."""
    messages: list[int] = []
    others: list[int] = []
    while start < stop:
        if start + _BEFORE > stop:
            raise ValueError('The records of a chunk do not end where it does.')
        opcode, length = struct.unpack_from('<BQ', records, start)
        (messages if opcode == Opcode.MESSAGE else others).append(start)
        start += _BEFORE + length
    if start != stop:
        raise ValueError('The records of a chunk do not end where it does.')
    return np.array(messages, dtype=np.int64), others
