"""The messages of a chunk as arrays: no message is touched by itself."""

from __future__ import annotations

import struct
from typing import Any, NamedTuple

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from lathe_chatter.array_types import Integers
from lathe_chatter.recording.mcap_chunk_walk import Chunk

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

    def of(self, *channels: int) -> Messages:
        """Those of some channels."""
        mine = np.isin(self.heads['channel'], channels)
        return self._replace(heads=self.heads[mine], starts=self.starts[mine])

    @property
    def sizes(self) -> Integers:
        """Of each payload, bytes (n,)."""
        return self.heads['length'].astype(np.int64) - (HEAD.itemsize - _BEFORE)

    def payload(self, place: int) -> bytes:
        """The bytes of one message."""
        start = int(self.starts[place])
        return self.records[start : start + int(self.sizes[place])]


def messages_of(chunk: Chunk) -> Messages:
    """All messages of a chunk, in the order in which they were written.

    The indexes behind a chunk say where its messages are, but no CRC covers them: they are used
    where together with the other records they account for every byte, else the records are
    walked.

    Raises:
        ValueError: If the records do not follow each other; their CRC was right, so they were
            written that way.
    """
    return _by_indexes(chunk) or _by_walking(chunk.records, 0, len(chunk.records))


def heads_at(records: bytes, offsets: Integers) -> NDArray[Any] | None:
    """The heads of messages at increasing offsets; None if not at each is another message."""
    if not len(offsets):
        return np.zeros(0, HEAD)
    if offsets[0] < 0 or offsets[-1] > len(records) - HEAD.itemsize:
        return None
    if (offsets[1:] < offsets[:-1]).any():
        return None
    every: NDArray[Any] = np.ndarray(
        (len(records) - HEAD.itemsize + 1,), HEAD, buffer=records, strides=(1,)
    )
    heads: NDArray[Any] = every[offsets]
    lengths = heads['length'].astype(np.int64)
    ends = offsets + (lengths + _BEFORE)
    if (
        lengths.min() < HEAD.itemsize - _BEFORE
        or (ends[:-1] > offsets[1:]).any()
        or ends[-1] > len(records)
    ):
        return None
    return heads if (heads['opcode'] == Opcode.MESSAGE).all() else None


def _by_indexes(chunk: Chunk) -> Messages | None:
    """By the message indexes; None if they do not lead to everything that is there."""
    if not chunk.indexes or any(len(index) % 16 for index in chunk.indexes.values()):
        return None
    offsets = np.frombuffer(b''.join(chunk.indexes.values()), '<u8')[1::2].astype(np.int64)
    if len(chunk.indexes) > 1:  # that of one channel is in order
        offsets.sort()
    heads = heads_at(chunk.records, offsets)
    if heads is None:
        return None
    # What lies between two messages, before the first and after the last.
    ends = offsets + (heads['length'].astype(np.int64) + _BEFORE)
    begins = np.concatenate((np.zeros(1, np.int64), ends))
    stops = np.concatenate((offsets, np.full(1, len(chunk.records))))
    others: list[int] = []
    for place in np.flatnonzero(begins != stops):
        try:
            between = _by_walking(chunk.records, int(begins[place]), int(stops[place]))
        except ValueError:
            return None
        if len(between.heads):
            return None
        others += between.others
    return Messages(chunk.records, heads, offsets + HEAD.itemsize, others)


def _by_walking(records: bytes, start: int, stop: int) -> Messages:
    """The messages from one place to another, from record to record."""
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
    offsets = np.array(messages, dtype=np.int64)
    heads = heads_at(records, offsets)
    if heads is None:
        raise ValueError('A message of a chunk is shorter than its head.')
    return Messages(records, heads, offsets + HEAD.itemsize, others)
