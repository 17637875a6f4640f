"""The chunk of an MCAP file that messages are being added to."""

from __future__ import annotations

import struct
from array import array
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

import lz4.frame
import numpy as np
import zstandard
from isal.isal_zlib import crc32
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Chunk, ChunkIndex, McapRecord

MESSAGE_HEAD = struct.Struct('<BQHIQQ')
"""Opcode, length, channel, sequence, log time, publish time; the message follows."""
_HEAD_IN_LENGTH = MESSAGE_HEAD.size - 9  # a length does not count opcode and itself
_INDEX_HEAD = struct.Struct('<BQHI')


def record_bytes(record: McapRecord) -> bytes:
    """A record as it stands in a file."""
    builder = RecordBuilder()
    record.write(builder)
    data: bytes = builder.end()
    return data


@dataclass(frozen=True)
class ClosedChunk:
    """A chunk with its message indexes, ready for a file.

    Attributes:
        data: The bytes.
        index: What the summary of the file says about it, as bytes.
        first: Earliest log time, ns.
        last: Latest log time, ns.
        counts: Messages by channel.
    """

    data: bytes
    index: bytes
    first: int
    last: int
    counts: dict[int, int]


class Compression(str, Enum):
    """How chunks are compressed."""

    NONE = 'none'
    LZ4 = 'lz4'
    ZSTD = 'zstd'


_NAMES = {Compression.NONE: '', Compression.LZ4: 'lz4', Compression.ZSTD: 'zstd'}
"""As MCAP calls them."""


def _compressed(records: bytearray, compression: Compression) -> bytes:
    if compression is Compression.LZ4:
        packed: bytes = lz4.frame.compress(records)
        return packed
    if compression is Compression.ZSTD:
        return zstandard.ZstdCompressor(level=1).compress(bytes(records))
    return bytes(records)


class OpenChunk:
    """Collects messages, and what their channels are: any chunk can be read by itself.

    A message costs a packed head and two appends: this is the path that each one takes.

    Args:
        channels: The records of each channel and its schema, by number.

    Attributes:
        kept: Messages that later files of a run repeat: channel, publish time and content.
    """

    def __init__(self, channels: Mapping[int, bytes]) -> None:
        """Begin empty."""
        self._channels = channels
        self.kept: list[tuple[int, int, bytes]] = []
        self._records = bytearray()
        self._indexes: dict[int, array[int]] = {}

    @property
    def size(self) -> int:
        """Bytes so far, before compression."""
        return len(self._records)

    @property
    def has_messages(self) -> bool:
        """Whether there is anything to close for."""
        return bool(self._indexes)

    def add_message(
        self, channel: int, log_time: int, publish_time: int, sequence: int, data: bytes
    ) -> None:
        """Add a message to a channel."""
        index = self._indexes.get(channel)
        if index is None:
            index = self._indexes[channel] = array('Q')
            self._records += self._channels[channel]
        records = self._records
        index.append(log_time)
        index.append(len(records))
        records += MESSAGE_HEAD.pack(
            Opcode.MESSAGE,
            _HEAD_IN_LENGTH + len(data),
            channel,
            sequence & 0xFFFFFFFF,
            log_time,
            publish_time,
        )
        records += data

    def close(self, offset: int, compression: Compression) -> ClosedChunk:
        """The chunk as it stands at an offset of its file. It holds at least one message."""
        times = [np.frombuffer(index, np.uint64)[::2] for index in self._indexes.values()]
        first = int(min(each.min() for each in times))
        last = int(max(each.max() for each in times))
        compressed = _compressed(self._records, compression)
        chunk = record_bytes(
            Chunk(
                compression=_NAMES[compression],
                data=compressed,
                message_start_time=first,
                message_end_time=last,
                uncompressed_crc=crc32(self._records),
                uncompressed_size=len(self._records),
            )
        )
        parts = [chunk]
        offsets: dict[int, int] = {}
        end = offset + len(chunk)
        for channel, index in self._indexes.items():
            size = len(index) * index.itemsize
            head = _INDEX_HEAD.pack(Opcode.MESSAGE_INDEX, 6 + size, channel, size)
            # MCAP is little-endian, and so is every machine that ROS 2 supports.
            parts += [head, index.tobytes()]
            offsets[channel] = end
            end += len(head) + size
        entry = ChunkIndex(
            chunk_start_offset=offset,
            chunk_length=len(chunk),
            message_start_time=first,
            message_end_time=last,
            message_index_offsets=offsets,
            message_index_length=end - offset - len(chunk),
            compression=_NAMES[compression],
            compressed_size=len(compressed),
            uncompressed_size=len(self._records),
        )
        counts = {channel: len(index) // 2 for channel, index in self._indexes.items()}
        return ClosedChunk(b''.join(parts), record_bytes(entry), first, last, counts)
