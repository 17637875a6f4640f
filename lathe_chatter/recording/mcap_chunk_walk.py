"""An MCAP file chunk by chunk, whole or damaged: what is handed out has passed its CRC.

Records are walked one after the other, which needs no index and so works just as well on a file
without an end. Where the walk meets what cannot be a record it goes back to the last chunk that
was sound and looks for the next one from there, byte by byte.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import lz4.frame
import zstandard
from isal.isal_zlib import crc32
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from lathe_chatter.recording.mcap_summary import ChunkPlace

_HEAD = struct.Struct('<BQ')
_CHUNK = struct.Struct('<QQQII')
"""First and last log time, size and CRC of the records, length of the compression's name."""
_FIELDS_ROOM = _CHUNK.size + 64
"""Bytes that surely hold these and the name."""
_INDEX = struct.Struct('<HI')
_SIZES = {Opcode.DATA_END: 4, Opcode.FOOTER: 20}
"""Of the content of the records at the end; other records may have more than their fields."""
_SIGNS = (b'\x03\x00\x00\x00lz4', b'\x04\x00\x00\x00zstd')
"""What a compressed chunk has after its other fields, which makes it easy to find."""
_BEFORE_SIGN = _HEAD.size + _CHUNK.size - 4

_Fields = tuple[int, int, int, int, str, int, int]
"""First and last log time, size, CRC and compression of a chunk, where its data begin, and how
many bytes they are."""

Read = Callable[[int, int], memoryview]
"""Reads so many bytes from an offset of a file, fewer where it ends."""


class Chunk(NamedTuple):
    """A sound chunk.

    Attributes:
        offset: Where it begins in its file.
        first: Earliest log time, ns.
        last: Latest log time, ns.
        records: Uncompressed.
        indexes: Raw message indexes by channel, as far as they follow it.
        proven: Whether the records have passed a CRC; else their writer made none.
    """

    offset: int
    first: int
    last: int
    records: bytes
    indexes: dict[int, bytes]
    proven: bool = True


class ChunkHead(NamedTuple):
    """A chunk that is passed by: where it begins, and its earliest and latest log time, ns."""

    offset: int
    first: int
    last: int


class Plain(NamedTuple):
    """A record outside of chunks: its opcode, and its content with where that begins."""

    opcode: int
    offset: int
    content: bytes


class Damage(NamedTuple):
    """A part of a file that cannot be read.

    Attributes:
        file: Which.
        start: First byte.
        end: Byte after the last; equal to `start` where something is missing altogether.
        reason: What is wrong, as a phrase.
    """

    file: Path
    start: int
    end: int
    reason: str

    def __str__(self) -> str:
        """One sentence."""
        where = f', bytes {self.start} to {self.end}' if self.end else ''
        return f'{self.file.name}{where}: {self.reason}.'


class _BadChunkError(Exception):
    """A chunk that does not pass; the text is the phrase of a `Damage`."""


Found = Chunk | ChunkHead | Plain | Damage


def scan(file: Path, *, chunks: bool = True, end: int | None = None) -> Iterator[Found]:
    """Walk the data section of a file, to the record that ends it.

    Args:
        file: MCAP.
        chunks: Whether these are read, and not passed by.
        end: Where the data end, if that is known.

    Raises:
        OSError: If the file cannot be read.
    """
    descriptor = os.open(file, os.O_RDONLY)
    try:
        yield from _Walk(file, descriptor, chunks=chunks, end=end).run()
    finally:
        os.close(descriptor)


def record_at(file: Path, offset: int) -> Found:
    """The record at a place where `scan` has found one.

    Raises:
        OSError: If the file cannot be read.
    """
    descriptor = os.open(file, os.O_RDONLY)
    try:
        return _Walk(file, descriptor, chunks=True).record_at(offset)
    finally:
        os.close(descriptor)


def read_chunk(file: Path, read: Read, place: ChunkPlace) -> Chunk | Damage:
    """A chunk that an index names with its message indexes, or what is wrong with it.

    Args:
        file: Its name.
        read: Reads so many bytes from an offset of it, fewer where it ends.
        place: Where it is.
    """
    try:
        return _chunk_at(read, place)
    except _BadChunkError as error:
        return Damage(file, place.offset, place.offset + place.length, str(error))


def _chunk_at(read: Read, place: ChunkPlace) -> Chunk:
    whole = read(place.length + place.index_length, place.offset)
    data, indexes = whole[: place.length], whole[place.length :]
    if len(data) < place.length or len(data) < _HEAD.size + _CHUNK.size:
        raise _BadChunkError('a chunk of the index is cut off')
    opcode, length = _HEAD.unpack_from(data)
    if (opcode, length) != (Opcode.CHUNK, place.length - _HEAD.size):
        raise _BadChunkError('a chunk of the index is not there')
    fields = _fields(bytes(data[_HEAD.size : _HEAD.size + _FIELDS_ROOM]), length)
    if fields is None:
        raise _BadChunkError('the head of a chunk is damaged')
    first, last, size, crc, name, begin, stored = fields
    begin += _HEAD.size
    records = _decompressed(data[begin : begin + stored], name, size, crc)
    return Chunk(place.offset, first, last, records, _indexes_in(indexes), proven=crc != 0)


def _indexes_in(data: memoryview) -> dict[int, bytes]:
    """The message indexes behind a chunk by channel, as far as they can be read."""
    found: dict[int, bytes] = {}
    place = 0
    while place + _HEAD.size + _INDEX.size <= len(data):
        opcode, length = _HEAD.unpack_from(data, place)
        channel, size = _INDEX.unpack_from(data, place + _HEAD.size)
        end = place + _HEAD.size + length
        if opcode != Opcode.MESSAGE_INDEX or length < _INDEX.size + size or end > len(data):
            break
        begin = place + _HEAD.size + _INDEX.size
        found[channel] = bytes(data[begin : begin + size])
        place = end
    return found


class _Walk:
    def __init__(
        self, file: Path, descriptor: int, *, chunks: bool, end: int | None = None
    ) -> None:
        self._file = file
        self._descriptor = descriptor
        self._end = end
        self._size = os.fstat(descriptor).st_size if end is None else end
        self._chunks = chunks
        self._sound = 0  # up to here nothing is in doubt

    def run(self) -> Iterator[Found]:
        """Every record in order, and every damage where it is."""
        position = len(MCAP0_MAGIC)
        if self._read(0, position) != MCAP0_MAGIC:
            yield Damage(self._file, 0, position, 'this is not the beginning of an MCAP file')
        while position != self._end:
            found = self._head(position)
            if found is None and position >= self._size:
                yield Damage(self._file, self._size, self._size, 'the end of the file is missing')
                return
            if found is None:
                start, position = self._sound or position, self._next_chunk()
                yield Damage(self._file, start, position, 'what is here cannot be read')
                if position >= self._size:
                    return
                continue
            opcode, length = found
            if opcode == Opcode.FOOTER:
                return
            record, position = self._record(position, opcode, length)
            yield record
            if opcode == Opcode.DATA_END:
                return

    def record_at(self, position: int) -> Found:
        """The record at a place."""
        found = self._head(position)
        if found is None:
            return Damage(self._file, position, position, 'what is here cannot be read')
        return self._record(position, *found)[0]

    def _record(self, position: int, opcode: int, length: int) -> tuple[Found, int]:
        """What a record is, and where the next one begins."""
        end = position + _HEAD.size + length
        if opcode != Opcode.CHUNK:
            offset = position + _HEAD.size
            return Plain(opcode, offset, self._read(offset, length)), end
        try:
            chunk, end = self._chunk(position, length)
        except _BadChunkError as error:
            return Damage(self._file, position, end, str(error)), end
        self._sound = end
        return chunk, end

    def _read(self, offset: int, size: int) -> bytes:
        return os.pread(self._descriptor, size, offset)

    def _head(self, position: int) -> tuple[int, int] | None:
        """Opcode and length of the record at a place, or None where none can be."""
        head = self._read(position, _HEAD.size)
        if len(head) < _HEAD.size:
            return None
        opcode, length = _HEAD.unpack(head)
        possible = 0 < opcode <= Opcode.DATA_END or opcode >= 0x80  # private
        if not possible or position + _HEAD.size + length > self._size:
            return None
        if length != _SIZES.get(opcode, length):
            return None
        if opcode == Opcode.CHUNK and self._chunk_fields(position, length) is None:
            return None
        if opcode == Opcode.MESSAGE_INDEX:
            fields = self._read(position + _HEAD.size, _INDEX.size)
            if len(fields) < _INDEX.size or _INDEX.unpack(fields)[1] > length - _INDEX.size:
                return None
        return opcode, length

    def _chunk_fields(self, position: int, length: int) -> _Fields | None:
        return _fields(self._read(position + _HEAD.size, _FIELDS_ROOM), length)

    def _chunk(self, position: int, length: int) -> tuple[Chunk | ChunkHead, int]:
        """The chunk at a place with its indexes, or its head, and where they end.

        Raises:
            _BadChunkError: If its data are not what was written.
        """
        end = position + _HEAD.size + length
        fields = self._chunk_fields(position, length)
        if fields is None:
            raise _BadChunkError('the head of a chunk is damaged')
        first, last, size, crc, name, begin, stored = fields
        if not self._chunks:
            return ChunkHead(position, first, last), end
        data = self._read(position + _HEAD.size + begin, stored)
        records = _decompressed(data, name, size, crc)
        indexes: dict[int, bytes] = {}
        while (found := self._head(end)) is not None and found[0] == Opcode.MESSAGE_INDEX:
            content = self._read(end + _HEAD.size, found[1])
            channel, size = _INDEX.unpack_from(content)
            indexes[channel] = content[_INDEX.size : _INDEX.size + size]
            end += _HEAD.size + found[1]
        return Chunk(position, first, last, records, indexes, proven=crc != 0), end

    def _next_chunk(self) -> int:
        """Where the next possible chunk begins after what is sound, or the end of the file."""
        start = self._sound
        data = self._read(start, self._size - start)
        place = 0
        while True:
            signs = [p for p in (data.find(sign, place) for sign in _SIGNS) if p >= 0]
            if not signs:
                self._sound = self._size
                return self._size
            place = min(signs) + 1
            position = start + min(signs) - _BEFORE_SIGN
            if position >= start and self._data_opcode(position):
                self._sound = position + 1  # should it be bad too, the next search goes on
                return position

    def _data_opcode(self, position: int) -> bool:
        found = self._head(position)
        return found is not None and found[0] == Opcode.CHUNK


def _fields(head: bytes, length: int) -> _Fields | None:
    """The fields of a chunk before its data, and where that begins; None if they disagree.

    Args:
        head: Of its content, with all of the fields if they are what they should be.
        length: Of its content.
    """
    if len(head) < _CHUNK.size:
        return None
    first, last, size, crc, letters = _CHUNK.unpack_from(head)
    begin = _CHUNK.size + letters + 8
    if letters > 16 or begin > len(head):  # no name is so long
        return None
    (stored,) = struct.unpack_from('<Q', head, begin - 8)
    if begin + stored > length:
        return None
    name = head[_CHUNK.size : _CHUNK.size + letters].decode('ascii', 'replace')
    return first, last, size, crc, name, begin, stored


def _decompressed(data: bytes | memoryview, name: str, size: int, crc: int) -> bytes:
    """The records of a chunk.

    Raises:
        _BadChunkError: If there is no such compression, or the data are not what was written.
    """
    try:
        if name == 'lz4':
            records: bytes = lz4.frame.decompress(data)
        elif name == 'zstd':
            records = zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
        elif name == '':
            records = bytes(data)
        else:
            raise _BadChunkError(f'a chunk is compressed as {name!r}, which is not known')
    except (RuntimeError, zstandard.ZstdError, MemoryError):
        raise _BadChunkError('a chunk cannot be decompressed') from None
    if len(records) != size:
        raise _BadChunkError('a chunk has not its size')
    if crc and crc32(records) != crc:
        raise _BadChunkError('a chunk does not have its CRC')
    return records
