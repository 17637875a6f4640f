"""One MCAP file of a run: its messages chunk by chunk, and what of it is damaged."""

from __future__ import annotations

import contextlib
import struct
from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Iterator
from functools import cached_property, partial
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from isal.isal_zlib import crc32
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import Attachment, Metadata

from lathe_chatter.recording.chunk_index import Span, spans_of
from lathe_chatter.recording.chunk_messages import Messages, messages_of
from lathe_chatter.recording.mcap_chunk_walk import (
    Chunk,
    ChunkHead,
    Damage,
    Found,
    Plain,
    record_at,
    scan,
)
from lathe_chatter.recording.mcap_summary import Summary, add_record, body_is_sound, read_summary
from lathe_chatter.recording.provenance import CHECK, OURS, checked
from lathe_chatter.recording.writer_lock import is_held

_RECORD = struct.Struct('<BQ')
_LOOSE_AT_ONCE = 1 << 20
_LATEST = 2**64 - 1
"""ns: no message is later."""
_UNREADABLE = (ValueError, EndOfFile, struct.error)
"""What parsing a record raises whose content is not of its kind."""


class Note(NamedTuple):
    """Named values that were kept beside the messages."""

    name: str
    values: dict[str, str]


class Contents(NamedTuple):
    """The messages of one chunk, or of some that are in none.

    Attributes:
        offset: Of the chunk, or of the first of these messages, in the file.
        messages: All of them, as they were written.
    """

    offset: int
    messages: Messages


class Raw(NamedTuple):
    """A message as it was recorded.

    Attributes:
        topic: Its name.
        type: As `std_msgs/msg/Bool`; empty where it has no schema.
        log_time: When it was received, ns since the epoch.
        publish_time: When it was published, ns since the epoch.
        sequence: Its number among those of its publisher; 0 from writers that keep none.
        data: As it was serialised.
        channel: As mcap has it: message_encoding, metadata.
        schema: As mcap has it: encoding, data; None where it has none.
    """

    topic: str
    type: str
    log_time: int
    publish_time: int
    sequence: int
    data: bytes
    channel: Any
    schema: Any


class RecordedFile:
    """A file that is walked when it is asked: as it was when it was opened, whoever writes it.

    Args:
        path: Of the file.
        on_damage: Called with every part that cannot be read; it may raise.

    Attributes:
        has_end: Whether it ends as a sound file does.
        being_written: Whether its writer was still at it when this was made.
        known: Schemas and channels, as far as they have been met, and what the summary has.
        unproven: Whether messages were handed out that no CRC covers.
    """

    def __init__(self, path: Path, on_damage: Callable[[Damage], None]) -> None:
        """Read the end of the file, where schemas and channels mostly stand together."""
        self.path = path
        self.on_damage = on_damage
        self.being_written = is_held(path)
        summary = read_summary(path)
        self.has_end = summary is not None
        self.known = summary or Summary(0)
        self.unproven = False
        self._walked = self.known.names_all
        self._data_end = 0
        self._told = False
        self._walk = partial(scan, path, end=self.known.data_end)

    def topics(self) -> dict[str, str]:
        """The type of each topic by name; empty for one without a schema.

        A file whose summary does not name them all is walked for it.
        """
        if not self._walked:
            for _ in self.contents():
                pass
        return {channel.topic: self.type_of(channel) for channel in self.known.channels.values()}

    def type_of(self, channel: Any) -> str:
        """The type of the messages of a channel, as mcap has it; empty where it has no schema."""
        schema = self.known.schemas.get(channel.schema_id)
        return str(schema.name) if schema is not None else ''

    def channels_of(self, topic: str) -> list[int]:
        """Numbers of the channels of a topic, as far as they are known."""
        return [n for n, channel in self.known.channels.items() if channel.topic == topic]

    def count(self, topic: str) -> int:
        """How many messages of a topic the file says it has; 0 if it does not say."""
        if self.known.statistics is None:
            return 0
        counts = self.known.statistics.channel_message_counts
        return sum(counts.get(number, 0) for number in self.channels_of(topic))

    def contents(self) -> Iterator[Contents]:
        """The messages of each sound chunk; schemas and channels are known before they come.

        A file may have messages outside of chunks; these come many at a time.
        """
        loose = bytearray()
        first = 0
        for found in self._scan():
            if isinstance(found, Plain) and found.opcode == Opcode.MESSAGE:
                first = first if loose else found.offset
                loose += _record(found)
                if len(loose) < _LOOSE_AT_ONCE:
                    continue
            if loose:
                yield from self._contents_of(Chunk(first, 0, 0, bytes(loose), {}, proven=False))
                loose.clear()
            if isinstance(found, Chunk):
                yield from self._contents_of(found)
            else:
                self._learn(found)
        if loose:
            yield from self._contents_of(Chunk(first, 0, 0, bytes(loose), {}, proven=False))
        self._walked = True

    def _scan(self, *, chunks: bool = True) -> Iterator[Found]:
        """Walk the file; what the summary counts and is not met is damage like any other.

        A flipped bit may make of a chunk a record of another kind, which nobody looks at.
        """
        met: Counter[int] = Counter()
        damaged = False
        for found in self._walk(chunks=chunks):
            damaged = damaged or isinstance(found, Damage)
            met[found.opcode if isinstance(found, Plain) else Opcode.CHUNK] += 1
            yield found
        counted = self.known.statistics
        if counted is None or damaged:
            return
        for opcode, what, count in (
            (Opcode.CHUNK, 'chunks', counted.chunk_count),
            (Opcode.METADATA, 'notes', counted.metadata_count),
            (Opcode.ATTACHMENT, 'attachments', counted.attachment_count),
        ):
            if met[opcode] < count:
                end = self.path.stat().st_size
                reason = f'{count - met[opcode]} of its {what} are not there'
                yield Damage(self.path, end, end, reason)

    def by_time(self) -> Iterator[tuple[Contents, int]]:
        """The messages of each chunk, in the order of the earliest of each.

        Each comes with the earliest log time, ns, of what comes after.
        """
        self.topics()  # a chunk may name what an earlier one has
        spans = sorted(self._spans())
        bounds = [*(span.first for span in spans), _LATEST]
        for span, bound in zip(spans, bounds[1:], strict=True):
            found = record_at(self.path, span.offset) if not span.end else self._loose(span)
            if isinstance(found, Chunk):
                for contents in self._contents_of(found):
                    yield contents, bound
            elif isinstance(found, Damage):
                self.on_damage(found)

    def _loose(self, span: Span) -> Chunk:
        """Messages outside of chunks, as if they were in one."""
        with self.path.open('rb') as stream:
            stream.seek(span.offset)
            records = stream.read(span.end - span.offset)
        return Chunk(span.offset, span.first, span.last, records, {}, proven=False)

    def _spans(self) -> Iterator[Span]:
        """Chunks and other messages; the index, which has a CRC, proves the times of a chunk."""
        indexed = {place.offset: (place.first, place.last) for place in self.known.chunks}
        for span in spans_of(self._scan(chunks=False), self.on_damage):
            times = span.first, span.last
            if indexed.get(span.offset, times) != times:
                reason = 'a chunk has not the times that the index has for it'
                self.on_damage(Damage(self.path, span.offset, span.offset, reason))
            yield span

    @cached_property
    def in_time_order(self) -> bool:
        """Whether no chunk has a message that was received before one of an earlier chunk."""
        statistics = self.known.statistics
        spans = [(place.first, place.last) for place in self.known.chunks if place.last]
        if statistics is None or statistics.chunk_count != len(self.known.chunks) or not spans:
            spans = [(span.first, span.last) for span in self._spans() if span.last]
        return all(before[1] <= after[0] for before, after in pairwise(spans))

    def raw_messages(self, topics: tuple[str, ...] = ()) -> Iterator[Raw]:
        """The messages of some topics, or of all if none is named, by the time of reception."""
        waiting: list[Raw] = []
        for contents, bound in self.by_time():
            found = self.raw_of(contents.messages, topics)
            # Sorting keeps the order of those that were received at the same time.
            waiting = sorted([*waiting, *found], key=lambda raw: raw.log_time)
            ready = bisect_right([raw.log_time for raw in waiting], bound)
            yield from waiting[:ready]
            waiting = waiting[ready:]
        yield from waiting

    def raw_of(self, messages: Messages, topics: tuple[str, ...] = ()) -> Iterator[Raw]:
        """Those of some messages that are of some topics, or of any if none is named."""
        channels = {
            number: channel
            for number, channel in self.known.channels.items()
            if not topics or channel.topic in topics
        }
        for place in np.flatnonzero(np.isin(messages.heads['channel'], list(channels))):
            head = messages.heads[place]
            channel = channels[int(head['channel'])]
            yield Raw(
                channel.topic,
                self.type_of(channel),
                int(head['log_time']),
                int(head['publish_time']),
                int(head['sequence']),
                messages.payload(int(place)),
                channel,
                self.known.schemas.get(channel.schema_id),
            )

    def _learn(self, found: Found) -> None:
        """Take note of what is no message."""
        if isinstance(found, Damage):
            self.on_damage(found)
        elif isinstance(found, Plain) and found.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            # The summary has a CRC of its own: what it has is known better.
            known = Summary(0)
            with contextlib.suppress(*_UNREADABLE):
                add_record(known, found.opcode, found.content)
            self.known.schemas = known.schemas | self.known.schemas
            self.known.channels = known.channels | self.known.channels

    @cached_property
    def proof(self) -> bool | None:
        """Whether all data have their CRC; None where there is none, or no end of the data.

        Raises:
            OSError: If the file cannot be read.
        """
        expected, end = self.known.data_crc, self.known.data_end
        if end is None:  # a damaged summary
            plain = (each for each in self._walk(chunks=False) if isinstance(each, Plain))
            last = next((each for each in plain if each.opcode == Opcode.DATA_END), None)
            (expected,) = struct.unpack('<I', last.content) if last else (0,)
            end = last.offset - _RECORD.size if last else self.path.stat().st_size
        self._data_end = end
        return body_is_sound(self.path, end, expected) if expected else None

    def _is_proven(self, offset: int) -> bool:
        """Whether nothing speaks against what has no CRC of its own: that of all data may."""
        self.unproven = self.unproven or self.proof is None
        if self.proof is False and not self._told:
            self._told = True
            reason = 'its messages have no CRC of their own, and that of the file is another'
            self.on_damage(Damage(self.path, offset, self._data_end, reason))
        return self.proof is not False

    def contradictions(self) -> Iterator[str]:
        """Where the summary says what is not so, as phrases."""
        heads = [f for f in self._walk(chunks=False) if isinstance(f, ChunkHead)]
        places = {place.offset for place in self.known.chunks}
        if places and places != {head.offset for head in heads}:
            yield 'its index does not lead to all of its chunks, and to nothing else'

    def notes(self) -> Iterator[Note]:
        """Every note, in order; one that is not as it was written is damage."""
        records = [*self._plain(Opcode.METADATA, Metadata)]
        have_checks = any(CHECK in record.metadata for record in records)
        for record in records:
            values = dict(record.metadata)
            sound = checked(record.name, values)
            if sound is None:
                sound = not (have_checks and record.name.startswith(OURS))
            if not sound:
                end = self.path.stat().st_size
                reason = f'the note {record.name} is not as it was written'
                self.on_damage(Damage(self.path, end, end, reason))
                continue
            values.pop(CHECK, None)
            yield Note(record.name, values)

    def attachments(self) -> Iterator[Any]:
        """Every attachment, as mcap has it, in order; one without its CRC is damage."""
        return self._plain(Opcode.ATTACHMENT, Attachment)

    def _plain(self, opcode: int, kind: Any) -> Iterator[Any]:
        for found in self._scan(chunks=False):
            if isinstance(found, Damage):
                self.on_damage(found)
            elif isinstance(found, Plain) and found.opcode == opcode:
                try:
                    if opcode == Opcode.ATTACHMENT:
                        _check_attachment(found.content)
                    yield kind.read(ReadDataStream(BytesIO(found.content)))
                except _UNREADABLE as error:
                    where = found.offset, found.offset + len(found.content)
                    what = 'an attachment' if opcode == Opcode.ATTACHMENT else 'a note'
                    reason = str(error) if isinstance(error, _BadCrcError) else 'cannot be read'
                    self.on_damage(Damage(self.path, *where, f'{what} {reason}'))

    def _contents_of(self, chunk: Chunk) -> Iterator[Contents]:
        if not chunk.proven and not self._is_proven(chunk.offset) and self.known.chunks:
            return  # no message, but what damage has made of the index of a chunk
        try:
            messages = messages_of(chunk)
            for offset in messages.others:
                opcode, length = _RECORD.unpack_from(chunk.records, offset)
                begin = offset + _RECORD.size
                add_record(self.known, opcode, chunk.records[begin : begin + length])
        except _UNREADABLE as error:
            self.on_damage(Damage(self.path, chunk.offset, chunk.offset, str(error)))
            return
        unknown = set(np.unique(messages.heads['channel']).tolist()) - set(self.known.channels)
        if unknown:
            reason = f'its messages of channel {min(unknown)} are of a topic that nothing names'
            self.on_damage(Damage(self.path, chunk.offset, chunk.offset, reason))
        yield Contents(chunk.offset, messages)


def _record(found: Plain) -> bytes:
    """A record outside of chunks as it stands in the file."""
    return _RECORD.pack(found.opcode, len(found.content)) + found.content


class _BadCrcError(ValueError):
    """A record that is not what was written; the text is the end of a phrase."""


def _check_attachment(content: bytes) -> None:
    """Compare the CRC of an attachment, if it has one.

    Raises:
        ValueError: If it has another.
    """
    place = 16
    for _ in range(2):  # name and media type
        place += 4 + struct.unpack_from('<I', content, place)[0]
    place += 8 + struct.unpack_from('<Q', content, place)[0]
    (expected,) = struct.unpack_from('<I', content, place)
    if expected and crc32(content[:place]) != expected:
        raise _BadCrcError('does not have its CRC')


def offered_qos(channel: Any) -> list[dict[str, Any]]:
    """The profiles that the publishers of a channel offered, as rosbag2 writes them."""
    try:
        offers = yaml.safe_load(channel.metadata.get('offered_qos_profiles', ''))
    except yaml.YAMLError:
        return []
    return offers if isinstance(offers, list) else []
