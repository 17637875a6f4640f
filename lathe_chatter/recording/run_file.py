"""One MCAP file of a run: its messages chunk by chunk, and what of it is damaged."""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import Attachment, Metadata

from lathe_chatter.recording.chunk_messages import Messages, messages_of
from lathe_chatter.recording.mcap_reader import Chunk, Damage, Plain, Wanted, scan
from lathe_chatter.recording.mcap_summary import Summary, add_record, body_is_sound, read_summary
from lathe_chatter.recording.provenance import CHECK, OURS, checked

_RECORD = struct.Struct('<BQ')
_LOOSE_AT_ONCE = 1 << 20
_UNREADABLE = (ValueError, EndOfFile, struct.error)
"""What parsing a record raises whose content is not of its kind."""


class Note(NamedTuple):
    """Named values that were kept beside the messages."""

    name: str
    values: dict[str, str]


class Contents(NamedTuple):
    """The messages of one chunk.

    Attributes:
        first: Earliest log time, ns.
        messages: All of them.
    """

    first: int
    messages: Messages


class RecordedFile:
    """A file that is walked when it is asked.

    Args:
        path: Of the file.
        on_damage: Told of every part that cannot be read; it may raise.

    Attributes:
        known: Schemas and channels, as far as they have been met.
        on_damage: As it was given.
    """

    def __init__(self, path: Path, on_damage: Callable[[Damage], None]) -> None:
        """Read the end of the file, where schemas and channels stand together."""
        self.path = path
        self.on_damage = on_damage
        summary = read_summary(path)
        self.has_summary = summary is not None
        self.known = summary or Summary(0)
        self._sound = False

    def topics(self) -> dict[str, str]:
        """The type of each topic by name; a file without a summary is walked for it."""
        if not self.has_summary:
            for _ in self.contents():
                pass
        return {
            channel.topic: self.known.schemas[channel.schema_id].name
            for channel in self.known.channels.values()
            if channel.schema_id in self.known.schemas
        }

    def count(self, topic: str) -> int:
        """How many messages of a topic the file says it has; 0 if it does not say."""
        statistics = self.known.statistics
        if statistics is None:
            return 0
        numbers = [n for n, channel in self.known.channels.items() if channel.topic == topic]
        return sum(statistics.channel_message_counts.get(number, 0) for number in numbers)

    def contents(self, wanted: Wanted | None = None) -> Iterator[Contents]:
        """The messages of each sound chunk; schemas and channels are known before they come.

        A file may have messages outside of chunks; these come many at a time.
        """
        loose = bytearray()
        for found in scan(self.path, wanted):
            if isinstance(found, Plain) and found.opcode == Opcode.MESSAGE:
                if not loose:
                    self._trust_loose(found)
                loose += _RECORD.pack(found.opcode, len(found.content)) + found.content
                if len(loose) < _LOOSE_AT_ONCE:
                    continue
            if loose:
                yield from self._loose(bytes(loose))
                loose.clear()
            if isinstance(found, Chunk):
                yield from self._opened(found)
            else:
                self._learn(found)
        if loose:
            yield from self._loose(bytes(loose))

    def _learn(self, found: Plain | Damage) -> None:
        """Take note of what is no message."""
        if isinstance(found, Damage):
            self.on_damage(found)
        elif not self.has_summary and found.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            # No CRC covers what stands outside of chunks: only where there is nothing better.
            with contextlib.suppress(*_UNREADABLE):
                add_record(self.known, found.opcode, found.content)

    def _trust_loose(self, first: Plain) -> None:
        """Messages outside of chunks have no CRC but that of the whole file, if there is one."""
        if self.has_summary and not self._sound and not body_is_sound(self.path, self.known):
            reason = 'its messages have no CRC of their own, and that of the file is another'
            self.on_damage(Damage(self.path, first.offset, self.known.start, reason))
        self._sound = True  # asked once

    def _loose(self, records: bytes) -> Iterator[Contents]:
        for contents in self._opened(Chunk(0, 0, 0, records, {})):
            first = int(contents.messages.heads['log_time'].min())
            yield contents._replace(first=first)

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
        """Every attachment, as mcap has it, in order."""
        return self._plain(Opcode.ATTACHMENT, Attachment)

    def _plain(self, opcode: int, kind: Any) -> Iterator[Any]:
        for found in scan(self.path, lambda _first, _last: False):
            if isinstance(found, Plain) and found.opcode == opcode:
                try:
                    yield kind.read(ReadDataStream(BytesIO(found.content)))
                except _UNREADABLE:
                    where = found.offset, found.offset + len(found.content)
                    self.on_damage(Damage(self.path, *where, 'a note cannot be read'))

    def _opened(self, chunk: Chunk) -> Iterator[Contents]:
        try:
            messages = messages_of(chunk)
            for offset in messages.others:
                opcode, length = struct.unpack_from('<BQ', chunk.records, offset)
                content = chunk.records[offset + 9 : offset + 9 + length]
                add_record(self.known, opcode, content)
        except _UNREADABLE as error:
            self.on_damage(Damage(self.path, chunk.offset, chunk.offset, str(error)))
            return
        unknown = set(np.unique(messages.heads['channel']).tolist()) - set(self.known.channels)
        if unknown:
            reason = f'its messages of channel {min(unknown)} are of a topic that nothing names'
            self.on_damage(Damage(self.path, chunk.offset, chunk.offset, reason))
        yield Contents(chunk.first, messages)


def offers_of(channel: Any) -> list[dict[str, Any]]:
    """The profiles that the publishers of a channel offered, as rosbag2 writes them."""
    try:
        offers = yaml.safe_load(channel.metadata.get('offered_qos_profiles', ''))
    except yaml.YAMLError:
        return []
    return offers if isinstance(offers, list) else []
