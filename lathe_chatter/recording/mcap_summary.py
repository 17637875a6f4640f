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
_DATA_END = struct.Struct('<BQI')
_AT_ONCE = 1 << 22
_HEAD = struct.Struct('<BQ')
_CHUNK_INDEX = struct.Struct('<16xQQI')
_CHANNEL_OFFSET = struct.Struct('<HQ')
_INDEX_HEAD = 15
"""Bytes of a message index before its entries, which have 16 each."""
_WANTED = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS)


class ChunkPlace(NamedTuple):
    """Where a chunk is in its file.

    Attributes:
        offset: Of its first byte.
        length: Bytes.
        size: Of its records before compression, bytes.
        index_length: Bytes of the message indexes, which follow it.
        indexes: Where each of them is in the file, as pairs of channel and offset ('<HQ').
    """

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
        start: Where it begins in the file.
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


def body_is_sound(file: Path, summary: Summary) -> bool:
    """Whether everything before the summary has its CRC; true where its writer made none.

    Raises:
        OSError: If the file cannot be read.
    """
    with file.open('rb') as stream:
        left = summary.start - _DATA_END.size
        crc = 0
        while left > 0:
            data = stream.read(min(left, _AT_ONCE))
            crc = crc32(data, crc)
            left -= len(data)
        end = stream.read(_DATA_END.size)
    if left < 0 or len(end) < _DATA_END.size:
        return False
    opcode, length, expected = _DATA_END.unpack(end)
    return (opcode, length) == (Opcode.DATA_END, 4) and expected in (0, crc)


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
    """What a chunk index says; the fields of the specification that are not named are not used."""
    offset, size, letters = _CHUNK_INDEX.unpack_from(data, place)
    begin = place + _CHUNK_INDEX.size
    indexes = data[begin : begin + letters]
    (index_length,) = struct.unpack_from('<Q', data, begin + letters)
    (uncompressed,) = struct.unpack_from('<Q', data, place + length - 8)
    if len(indexes) % _CHANNEL_OFFSET.size:
        raise ValueError('A chunk index has half an entry.')
    return ChunkPlace(offset, size, uncompressed, index_length, indexes)


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
