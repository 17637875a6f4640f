"""An MCAP file that is complete on disk after every commit.

MCAP ends in a summary (index, statistics) and a footer; a file without them opens in no indexed
reader. A commit therefore writes the new chunk *and* a fresh summary and footer in one call, over
the summary that the commit before it left. The new bytes are always more than those they
replace, so there is no moment between calls at which the file lacks an end: kill -9 loses what
came since the last commit and nothing else.

A large commit takes milliseconds, a small one too where the machine is busy, in the middle of
which a kill may strike: the system leaves off between two pages. So the end of the commit before
is first copied to where it is in nobody's way, beyond the new bytes; the file is cut off behind
these when they are all there.

The package mcap has a writer, but one that makes every summary from nothing, which takes 31 ms
after half an hour of four commits a second. Here a commit adds to the summary's bytes what is
new.
"""

from __future__ import annotations

import contextlib
import os
import struct
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from isal.isal_zlib import crc32
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    DataEnd,
    Footer,
    Header,
    Metadata,
    MetadataIndex,
    Statistics,
)
from mcap.writer import MCAP0_MAGIC

from lathe_chatter.recording.disk_thread import FileSync
from lathe_chatter.recording.mcap_summary import OUR_LIBRARY
from lathe_chatter.recording.open_chunk import ClosedChunk, Compression, OpenChunk, record_bytes
from lathe_chatter.recording.provenance import sealed
from lathe_chatter.recording.writer_lock import hold

_DATA_END_SIZE, _END_SIZE = 13, 37
"""Bytes of the record that ends the data, and of footer and magic."""
_RECORD_HEAD = struct.Struct('<BQ')
_PRIVATE = 0x80
"""Opcode of records that readers of MCAP pass over."""
_PAGE = 4096
"""Bytes of which a kill leaves all or none."""


@dataclass
class Contents:
    """What a file holds; log times in ns since the epoch.

    Attributes:
        first: Earliest log time, 0 where there is no message.
        last: Latest log time, 0 where there is no message.
        counts: Messages by channel.
        chunks: How many.
    """

    first: int = 0
    last: int = 0
    counts: Counter[int] = field(default_factory=Counter)
    chunks: int = 0

    def with_chunk(self, chunk: ClosedChunk) -> Contents:
        """The contents with one more chunk."""
        return Contents(
            min(self.first or chunk.first, chunk.first),
            max(self.last, chunk.last),
            self.counts + Counter(chunk.counts),
            self.chunks + 1,
        )


class CommittedFile:
    """Writes one MCAP file, chunked, with CRCs, by commits.

    Args:
        path: Of the file, which must not exist.
        compression: Of its chunks.

    Attributes:
        committed: What the file on disk holds.

    Raises:
        OSError: If the file cannot be made.
    """

    def __init__(self, path: Path, compression: Compression) -> None:
        """Make the file and commit its empty beginning."""
        self._compression = compression
        self._descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o644)
        hold(self._descriptor)
        self._sync = FileSync(self._descriptor)
        self._schemas: list[bytes] = []
        self._channels: list[bytes] = []
        self._chunk_indexes = bytearray()
        self._other_indexes = bytearray()
        self._attachments = self._metadata = 0
        self._body = bytearray(MCAP0_MAGIC)
        self._body += record_bytes(Header(profile='ros2', library=OUR_LIBRARY))
        self._body_start = self._crc = 0
        self._contents = self.committed = Contents()
        self._tail = b''
        self.commit()

    @property
    def size(self) -> int:
        """Bytes on disk."""
        return self._body_start + len(self._tail)

    @property
    def safe_messages(self) -> int:
        """How many messages no loss of power can take any more."""
        return self._sync.messages

    def add_channel(self, schema: bytes, channel: bytes) -> None:
        """Add the record of a channel, and of its schema unless it is empty."""
        if schema:
            self._schemas.append(schema)
        self._channels.append(channel)

    def add_chunk(self, chunk: OpenChunk) -> None:
        """Add a chunk of messages."""
        closed = chunk.close(self._end, self._compression)
        self._body += closed.data
        self._chunk_indexes += closed.index
        self._contents = self._contents.with_chunk(closed)

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add named values with their check, outside the stream of messages."""
        data = record_bytes(Metadata(name=name, metadata=sealed(name, values)))
        index = MetadataIndex(offset=self._end, length=len(data), name=name)
        self._other_indexes += record_bytes(index)
        self._metadata += 1
        self._body += data

    def attach(self, name: str, media_type: str, data: bytes, time: int) -> None:
        """Attach a file of another kind, dated in ns since the epoch."""
        named = {'name': name, 'media_type': media_type}
        attachment = record_bytes(Attachment(create_time=time, log_time=time, data=data, **named))
        index = AttachmentIndex(
            offset=self._end,
            length=len(attachment),
            log_time=time,
            create_time=time,
            data_size=len(data),
            **named,
        )
        self._other_indexes += record_bytes(index)
        self._attachments += 1
        self._body += attachment

    def commit(self) -> None:
        """Put everything added so far on disk, as a complete file.

        The data is handed to the operating system before this returns, and to the disk soon
        after, by another thread.

        Raises:
            OSError: If the disk refuses, now or in the sync that followed an earlier commit.
                The file then stays as the commit before left it.
        """
        self._sync.check()
        if self._tail and not self._body:
            return
        crc = crc32(self._body, self._crc)
        tail = self._summary(crc)
        try:
            self._write(b''.join((self._body, tail)))
        except OSError:
            self._restore()
            raise
        self._body_start += len(self._body)
        self._body.clear()
        self._crc, self._tail = crc, tail
        self.committed = self._contents
        self._sync.request(sum(self.committed.counts.values()))

    def close(self) -> FileSync:
        """Commit and close; what is returned is to be joined, which waits for the disk.

        Raises:
            OSError: If the disk refuses.
        """
        try:
            self.commit()
        finally:
            self._sync.end()
        return self._sync

    def abandon(self) -> None:
        """Close without another commit: what came since the last one is lost."""
        self._sync.end()
        with contextlib.suppress(OSError):
            self._sync.join()

    @property
    def _end(self) -> int:
        """Where the next bytes of the body go."""
        return self._body_start + len(self._body)

    def _summary(self, crc: int) -> bytes:
        """The end of the file: summary and footer, with the CRC of the body before."""
        data_end = record_bytes(DataEnd(data_section_crc=crc))
        contents = self._contents
        statistics = Statistics(
            attachment_count=self._attachments,
            channel_count=len(self._channels),
            channel_message_counts=dict(contents.counts),
            chunk_count=contents.chunks,
            message_count=sum(contents.counts.values()),
            message_end_time=contents.last,
            message_start_time=contents.first,
            metadata_count=self._metadata,
            schema_count=len(self._schemas),
        )
        summary = b''.join(
            (
                *self._schemas,
                *self._channels,
                record_bytes(statistics),
                self._chunk_indexes,
                self._other_indexes,
            )
        )
        return b''.join((data_end, summary, _end_after(summary, self._end + len(data_end))))

    def _write(self, data: bytes) -> None:
        """Write over the end of the last commit, so that the file has an end all the while."""
        start, end = self._body_start, self._body_start + len(data)
        if not self._tail:
            _write_at(self._descriptor, data, start)
            return
        summary = self._tail[_DATA_END_SIZE:-_END_SIZE]
        copy = record_bytes(DataEnd(data_section_crc=0)) + summary
        beyond = end
        if (beyond + len(copy)) % _PAGE > _PAGE - _END_SIZE:  # its last bytes would be on two
            beyond += _END_SIZE
        far = beyond + len(copy)
        # A few bytes at the far end, which point to the old summary; then a copy of it there.
        _write_at(self._descriptor, _end_after(b'', start + _DATA_END_SIZE, proven=False), far)
        _write_at(self._descriptor, copy, beyond)
        _write_at(self._descriptor, _end_after(summary, beyond + _DATA_END_SIZE), far)
        # Who walks through the file meets a record that is nobody's business and reaches up to
        # that copy, until all that it covers is there.
        head = _RECORD_HEAD.pack(_PRIVATE, beyond - start - _RECORD_HEAD.size)
        _write_at(self._descriptor, head, start)
        _write_at(self._descriptor, data[len(head) :], start + len(head))
        _write_at(self._descriptor, data[: len(head)], start)
        os.ftruncate(self._descriptor, end)

    def _restore(self) -> None:
        """Put the end of the last commit back, where a failed one has begun to overwrite it."""
        with contextlib.suppress(OSError):
            _write_at(self._descriptor, self._tail, self._body_start)
            os.ftruncate(self._descriptor, self._body_start + len(self._tail))


def _end_after(summary: bytes, start: int, *, proven: bool = True) -> bytes:
    """Footer and magic after a summary that starts at some byte of the file."""
    # The CRC of a summary covers the footer up to the CRC itself.
    beginning = struct.pack('<BQQQ', Opcode.FOOTER, 20, start, 0)
    crc = crc32(beginning, crc32(summary)) if proven else 0
    footer = Footer(summary_start=start, summary_offset_start=0, summary_crc=crc)
    end: bytes = record_bytes(footer) + MCAP0_MAGIC
    return end


def _write_at(descriptor: int, data: bytes, offset: int) -> None:
    """Write all of `data` at `offset`; one call, unless the system takes only a part."""
    view = memoryview(data)
    while view:
        written = os.pwrite(descriptor, view, offset)
        view, offset = view[written:], offset + written
