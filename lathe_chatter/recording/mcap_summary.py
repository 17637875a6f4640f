"""What the end of an MCAP file says about it, if it is whole.

A file may be read while it is written. Whatever stands before the end of the data that a sound
summary has does not change any more: a reader that keeps to it has the file as it was then.
"""

from __future__ import annotations

import contextlib
import os
import struct
import time
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

from isal.isal_zlib import crc32
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import Channel, Header, Schema, Statistics
from mcap.writer import MCAP0_MAGIC

from lathe_chatter.recording.writer_lock import is_held

OUR_LIBRARY = 'lathe_chatter'
"""What our writer calls itself in its files."""
_FOOTER = struct.Struct('<BQQQI')
_AT_ONCE = 1 << 22
_HEAD = struct.Struct('<BQ')
_CHUNK_INDEX = struct.Struct('<QQQQI')
_CHANNEL_OFFSET = struct.Struct('<HQ')
_INDEX_HEAD = 15
"""Bytes of a message index before its entries, which have 16 each."""
_WANTED = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS)
_OTHER_INDEXES = (Opcode.METADATA_INDEX, Opcode.ATTACHMENT_INDEX)
_OFFSET_AND_LENGTH = struct.Struct('<QQ')
_DATA_END = struct.Struct('<BQI')
_BEGINNING = 256
"""Bytes that surely hold the header of a file of ours."""
_LOOK_AGAIN, _PATIENCE = 0.002, 10.0
"""s between two looks at the end of a file amid a commit, and after which it is called damaged."""


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
        data_end: Where the record stands that ended the data when this was read; None if not told.
        data_crc: Of the data before it; 0 where there is none.
        indexed_end: Where the last record ends that an index names.
    """

    start: int
    schemas: dict[int, Any] = field(default_factory=dict)
    channels: dict[int, Any] = field(default_factory=dict)
    statistics: Any = None
    chunks: list[ChunkPlace] = field(default_factory=list)
    data_end: int | None = None
    data_crc: int = 0
    indexed_end: int = 0

    @property
    def names_all(self) -> bool:
        """Whether all schemas and channels of the file are known to be repeated here."""
        counts = self.statistics
        return counts is not None and (
            (counts.schema_count, counts.channel_count) == (len(self.schemas), len(self.channels))
        )


def read_summary(file: Path) -> Summary | None:
    """The summary of a file, None if there is none that passes its CRC.

    Amid a commit of its writer there is none for a moment: the next look finds one.

    Raises:
        OSError: If the file cannot be read.
    """
    until = time.monotonic() + _PATIENCE
    written = True
    while written and time.monotonic() < until:
        written = is_held(file)  # before the look: what nobody writes any more stays as it is
        found = _look(file)
        if found is not None:
            return found
        if written:
            time.sleep(_LOOK_AGAIN)
    return None


def _look(file: Path) -> Summary | None:
    length = _FOOTER.size + len(MCAP0_MAGIC)
    with file.open('rb') as stream:
        size = os.fstat(stream.fileno()).st_size
        stream.seek(max(size - length, 0))
        end = stream.read(length)
        if len(end) < length:
            return None
        opcode, footer, start, _, crc = _FOOTER.unpack_from(end)
        if not end.endswith(MCAP0_MAGIC) or (opcode, footer) != (Opcode.FOOTER, 20):
            return None
        start = start or size - length  # a sound file may have no summary
        if not 0 < start <= size - length:
            return None
        before = min(_DATA_END.size, start)
        stream.seek(start - before)
        data = stream.read(before + size - length - start)
        stream.seek(0)
        begin = stream.read(_BEGINNING)
    if crc and crc32(end[: _FOOTER.size - 4], crc32(data[before:])) != crc:
        return None
    try:
        summary = _parsed(data[before:], start)
    except (struct.error, ValueError, EOFError):
        return None
    _find_data_end(summary, data[:before], begin)
    return summary


def _find_data_end(summary: Summary, record: bytes, begin: bytes) -> None:
    """Where the data end, by the record before the summary, and by what the file begins with."""
    if len(record) < _DATA_END.size:
        return
    opcode, length, crc = _DATA_END.unpack(record)
    if (opcode, length) != (Opcode.DATA_END, 4):
        return
    summary.data_end, summary.data_crc = summary.start - len(record), crc
    if not crc and _library(begin) == OUR_LIBRARY:
        # Amid a large commit: a copy of the summary before, behind what is being written.
        # Our writer has an index of all that it has written.
        _, header = _HEAD.unpack_from(begin, len(MCAP0_MAGIC))
        summary.data_end = max(len(MCAP0_MAGIC) + _HEAD.size + header, summary.indexed_end)


def _library(begin: bytes) -> str:
    """Who wrote a file that begins so; empty where that is not told."""
    with contextlib.suppress(struct.error, ValueError, EndOfFile):
        opcode, length = _HEAD.unpack_from(begin, len(MCAP0_MAGIC))
        content = begin[len(MCAP0_MAGIC) + _HEAD.size :][:length]
        if opcode == Opcode.HEADER:
            return str(Header.read(ReadDataStream(BytesIO(content))).library)
    return ''


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
            chunk = _chunk_place(data, place, length)
            summary.chunks.append(chunk)
            end = chunk.offset + chunk.length + chunk.index_length
            summary.indexed_end = max(summary.indexed_end, end)
        elif opcode in _OTHER_INDEXES:
            end = sum(_OFFSET_AND_LENGTH.unpack_from(data, place))
            summary.indexed_end = max(summary.indexed_end, end)
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
