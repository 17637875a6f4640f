"""What the end of an MCAP file says about it, if it is whole."""

from __future__ import annotations

import os
import struct
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

from isal.isal_zlib import crc32
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Schema, Statistics
from mcap.writer import MCAP0_MAGIC

_FOOTER = struct.Struct('<BQQQI')
_AT_ONCE = 1 << 22
_HEAD = struct.Struct('<BQ')
_CHUNK_INDEX = struct.Struct('<QQQQI')
_CHANNEL_OFFSET = struct.Struct('<HQ')
_INDEX_HEAD = 15
"""Bytes of a message index before its entries, which have 16 each."""
_WANTED = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS)


class ChunkPlace(NamedTuple):
    """Where a chunk is in its file.

    Attributes:
        first: Earliest log time, ns.
        last: Latest log time, ns.
        offset: Of its first byte.
        length: Bytes.
        size: Of its records before compression, bytes.
        index_length: Bytes of the message indexes, which follow it.
        indexes: Where each of them is in the file, as pairs of channel and offset ('<HQ').
    """

    first: int
    last: int
    offset: int
    length: int
    size: int
    index_length: int
    indexes: bytes

    def index_size(self, channel: int) -> int:
        """Bytes that the entries of a channel in its message index have; -1 if it is not told."""
        places = [*_CHANNEL_OFFSET.iter_unpack(self.indexes)]
        end = self.offset + self.length + self.index_length
        begin = next((offset for number, offset in places if number == channel), end)
        after = min((offset for _, offset in places if offset > begin), default=end)
        size = after - begin - _INDEX_HEAD if after > begin else 0
        return -1 if not places or size % 16 else size


@dataclass
class Summary:
    """Schemas and channels by number, and the statistics.

    Attributes:
        start: Where it begins in the file; where the footer does, if there is none.
        schemas: By number.
        channels: By number.
        statistics: None where the writer made none.
        chunks: In order, as far as its writer indexed them.
    """

    start: int
    schemas: dict[int, Any] = field(default_factory=dict)
    channels: dict[int, Any] = field(default_factory=dict)
    statistics: Any = None
    chunks: list[ChunkPlace] = field(default_factory=list)

    @property
    def names_all(self) -> bool:
        """Whether all schemas and channels of the file are known to be repeated here."""
        counts = self.statistics
        return counts is not None and (
            (counts.schema_count, counts.channel_count) == (len(self.schemas), len(self.channels))
        )


def read_summary(file: Path) -> Summary | None:
    """The summary of a file, None if there is none that passes its CRC.

    Raises:
        OSError: If the file cannot be read.
    """
    length = _FOOTER.size + len(MCAP0_MAGIC)
    with file.open('rb') as stream:
        size = os.fstat(stream.fileno()).st_size
        if size < length:
            return None
        stream.seek(size - length)
        end = stream.read(length)
        opcode, footer, start, _, crc = _FOOTER.unpack_from(end)
        if not end.endswith(MCAP0_MAGIC) or (opcode, footer) != (Opcode.FOOTER, 20):
            return None
        start = start or size - length  # a sound file may have no summary
        if not 0 < start <= size - length:
            return None
        stream.seek(start)
        data = stream.read(size - length - start)
    if crc and crc32(end[: _FOOTER.size - 4], crc32(data)) != crc:
        return None
    try:
        return _parsed(data, start)
    except (struct.error, ValueError, EOFError):
        return None


def body_is_sound(file: Path, size: int, expected: int) -> bool:
    """Whether what a file begins with has its CRC.

    Args:
        file: Which.
        size: Bytes before the end of the data.
        expected: What the end of the data says.

    Raises:
        OSError: If the file cannot be read.
    """
    with file.open('rb') as stream:
        crc = 0
        while size > 0:
            data = stream.read(min(size, _AT_ONCE))
            if not data:
                return False
            crc = crc32(data, crc)
            size -= len(data)
    return crc == expected


def _parsed(data: bytes, start: int) -> Summary:
    summary = Summary(start)
    place = 0
    while place < len(data):
        opcode, length = _HEAD.unpack_from(data, place)
        place += _HEAD.size
        if opcode == Opcode.CHUNK_INDEX:
            summary.chunks.append(_chunk_place(data, place, length))
        elif opcode in _WANTED:
            add_record(summary, opcode, data[place : place + length])
        place += length
    return summary


def _chunk_place(data: bytes, place: int, length: int) -> ChunkPlace:
    """What a chunk index says; what it says of the compression is not used."""
    first, last, offset, size, letters = _CHUNK_INDEX.unpack_from(data, place)
    begin = place + _CHUNK_INDEX.size
    indexes = data[begin : begin + letters]
    index_length, name = struct.unpack_from('<QI', data, begin + letters)
    (uncompressed,) = struct.unpack_from('<8xQ', data, begin + letters + 12 + name)
    if len(indexes) % _CHANNEL_OFFSET.size or begin + letters + 28 + name > place + length:
        raise ValueError('A chunk index does not end where it should.')
    return ChunkPlace(first, last, offset, size, uncompressed, index_length, indexes)


def add_record(summary: Summary, opcode: int, content: bytes) -> None:
    """Add what a record says, wherever in the file it stands.

    Raises:
        ValueError: If its content is not of its kind.
    """
    stream = ReadDataStream(BytesIO(content))
    if opcode == Opcode.SCHEMA:
        schema = Schema.read(stream)
        summary.schemas[schema.id] = schema
    elif opcode == Opcode.CHANNEL:
        channel = Channel.read(stream)
        summary.channels[channel.id] = channel
    elif opcode == Opcode.STATISTICS:
        summary.statistics = Statistics.read(stream)
