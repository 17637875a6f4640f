"""Small MCAP files in every way in which the format lets them be written.

As the public conformance suite has them: six kinds of data, and every combination of features
that makes sense for them, 416 files. Written here by the format's rules, record by record.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from itertools import combinations
from typing import NamedTuple
from zlib import crc32

MAGIC = b'\x89MCAP0\r\n'
CHUNKS, MESSAGE_INDEX, CHUNK_INDEX = 'ch', 'mx', 'chx'
STATISTICS, SCHEMAS_AGAIN, CHANNELS_AGAIN = 'st', 'rsh', 'rch'
ATTACHMENT_INDEX, METADATA_INDEX, SUMMARY_OFFSETS, PADDING = 'ax', 'mdx', 'sum', 'pad'
FEATURES = (
    CHUNKS,
    MESSAGE_INDEX,
    STATISTICS,
    SCHEMAS_AGAIN,
    CHANNELS_AGAIN,
    ATTACHMENT_INDEX,
    METADATA_INDEX,
    CHUNK_INDEX,
    SUMMARY_OFFSETS,
    PADDING,
)
_NEVER_PADDED = {0x02, 0x05, 0x06, 0x0F}
"""Footer, message, chunk and end of the data have no room for it."""


class Message(NamedTuple):
    """A message of channel 1; times in ns."""

    log_time: int
    publish_time: int
    sequence: int
    data: bytes = b'\x01\x02\x03'


class Data(NamedTuple):
    """What a file holds.

    Attributes:
        name: Of the kind.
        schema: Whether channel 1 has one: `Example`, encoded as `c`.
        channel: Whether there is a channel, with the topic `example`.
        messages: Of the channel.
        attachment: Whether there is one: `myFile`.
        metadata: Whether there is a record of it: `myMetadata`.
    """

    name: str
    schema: bool = False
    channel: bool = False
    messages: tuple[Message, ...] = ()
    attachment: bool = False
    metadata: bool = False


_TIMES = (0, 2, 1, 3, 3, 5, 4, 7, 8, 9)
KINDS = (
    Data('NoData'),
    Data('OneSchemalessMessage', channel=True, messages=(Message(2, 1, 10),)),
    Data('OneMessage', schema=True, channel=True, messages=(Message(2, 1, 10),)),
    Data('OneAttachment', attachment=True),
    Data('OneMetadata', metadata=True),
    Data(
        'TenMessages',
        schema=True,
        channel=True,
        messages=tuple(Message(time, time, k) for k, time in enumerate(_TIMES)),
    ),
)


def variants() -> Iterator[tuple[str, Data, bytes]]:
    """Name, data and bytes of every file."""
    for data in KINDS:
        for count in range(len(FEATURES) + 1):
            for features in combinations(FEATURES, count):
                if _makes_sense(data, set(features)):
                    name = '-'.join([data.name, *sorted(features)])
                    yield name, data, file_of(data, set(features))


def _makes_sense(data: Data, features: set[str]) -> bool:
    needs = {
        ATTACHMENT_INDEX: data.attachment,
        METADATA_INDEX: data.metadata,
        SCHEMAS_AGAIN: data.schema,
        CHANNELS_AGAIN: data.channel,
        CHUNKS: data.channel,
        MESSAGE_INDEX: CHUNKS in features,
        CHUNK_INDEX: CHUNKS in features,
        SUMMARY_OFFSETS: bool(
            features
            & {
                CHUNK_INDEX,
                SCHEMAS_AGAIN,
                CHANNELS_AGAIN,
                METADATA_INDEX,
                ATTACHMENT_INDEX,
                STATISTICS,
            }
        ),
    }
    return all(needs.get(feature, True) for feature in features)


def _text(value: str) -> bytes:
    return struct.pack('<I', len(value)) + value.encode()


def _map(values: dict[str, str]) -> bytes:
    content = b''.join(_text(key) + _text(value) for key, value in values.items())
    return struct.pack('<I', len(content)) + content


class _Records:
    def __init__(self, features: set[str]) -> None:
        self._padding = b'\x01\x02\x03' if PADDING in features else b''

    def record(self, opcode: int, content: bytes) -> bytes:
        if opcode not in _NEVER_PADDED:
            content += self._padding
        return struct.pack('<BQ', opcode, len(content)) + content

    def schema(self) -> bytes:
        data = b'\x04\x05\x06'
        content = struct.pack('<H', 1) + _text('Example') + _text('c')
        return self.record(0x03, content + struct.pack('<I', len(data)) + data)

    def channel(self, data: Data) -> bytes:
        encoding, values = ('a', {'foo': 'bar'}) if data.schema else ('text', {})
        content = struct.pack('<HH', 1, int(data.schema)) + _text('example') + _text(encoding)
        return self.record(0x04, content + _map(values))

    def message(self, message: Message) -> bytes:
        head = struct.pack('<HIQQ', 1, message.sequence, message.log_time, message.publish_time)
        return self.record(0x05, head + message.data)


def file_of(data: Data, features: set[str]) -> bytes:
    """A file with some data, written with some features."""
    make = _Records(features)
    body = MAGIC + make.record(0x01, _text('') + _text(''))
    # As in the public suite, what is in a chunk is not padded.
    within = _Records(set() if CHUNKS in features else features)
    records = within.schema() if data.schema else b''
    records += within.channel(data) if data.channel else b''
    places: list[tuple[int, int]] = []  # log time and place of each message
    for message in data.messages:
        places.append((message.log_time, len(records)))
        records += within.message(message)
    indexes: list[tuple[int, bytes]] = []  # of the summary: opcode and record
    if CHUNKS in features:
        chunk, index = _chunk(
            make, records, places, len(body), with_index=MESSAGE_INDEX in features
        )
        body += chunk
        indexes += [index] if CHUNK_INDEX in features else []
    else:
        body += records
    if data.attachment:
        record, index = _attachment(make, len(body))
        body += record
        indexes += [index] if ATTACHMENT_INDEX in features else []
    if data.metadata:
        record = make.record(0x0C, _text('myMetadata') + _map({'foo': 'bar'}))
        content = struct.pack('<QQ', len(body), len(record)) + _text('myMetadata')
        body += record
        indexes += [(0x0D, make.record(0x0D, content))] if METADATA_INDEX in features else []
    body += make.record(0x0F, struct.pack('<I', crc32(body)))
    groups: list[tuple[int, bytes]] = []
    if SCHEMAS_AGAIN in features:
        groups.append((0x03, make.schema()))
    if CHANNELS_AGAIN in features:
        groups.append((0x04, make.channel(data)))
    if STATISTICS in features:
        groups.append((0x0B, _statistics(make, data, int(CHUNKS in features))))
    groups += indexes
    return body + _end(make, groups, len(body), with_offsets=SUMMARY_OFFSETS in features)


def _chunk(
    make: _Records,
    records: bytes,
    messages: list[tuple[int, int]],
    start: int,
    *,
    with_index: bool,
) -> tuple[bytes, tuple[int, bytes]]:
    """A chunk with what follows it, and its index for the summary."""
    times = [time for time, _ in messages] or [0]
    spans = struct.pack('<QQ', min(times), max(times))
    content = spans + struct.pack('<QI', len(records), crc32(records)) + _text('')
    chunk = make.record(0x06, content + struct.pack('<Q', len(records)) + records)
    message_index, places = b'', b''
    if with_index:
        entries = b''.join(struct.pack('<QQ', *entry) for entry in sorted(messages))
        places = struct.pack('<HQ', 1, start + len(chunk))
        message_index = make.record(0x07, struct.pack('<HI', 1, len(entries)) + entries)
    content = spans + struct.pack('<QQI', start, len(chunk), len(places)) + places
    content += struct.pack('<Q', len(message_index)) + _text('')
    content += struct.pack('<QQ', len(records), len(records))
    return chunk + message_index, (0x08, make.record(0x08, content))


def _attachment(make: _Records, start: int) -> tuple[bytes, tuple[int, bytes]]:
    """An attachment, and its index for the summary."""
    kept, named = b'\x01\x02\x03', _text('myFile') + _text('application/octet-stream')
    content = struct.pack('<QQ', 2, 1) + named + struct.pack('<Q', len(kept)) + kept
    record = make.record(0x09, content + struct.pack('<I', crc32(content)))
    content = struct.pack('<QQQQQ', start, len(record), 2, 1, len(kept)) + named
    return record, (0x0A, make.record(0x0A, content))


def _statistics(make: _Records, data: Data, chunks: int) -> bytes:
    times = [message.log_time for message in data.messages] or [0]
    counts = struct.pack('<HQ', 1, len(data.messages)) if data.channel else b''
    content = struct.pack('<QH', len(data.messages), int(data.schema))
    content += struct.pack(
        '<IIII', int(data.channel), int(data.attachment), int(data.metadata), chunks
    )
    content += struct.pack('<QQI', min(times), max(times), len(counts)) + counts
    return make.record(0x0B, content)


def _end(
    make: _Records, groups: list[tuple[int, bytes]], start: int, *, with_offsets: bool
) -> bytes:
    """Summary, footer and magic."""
    summary = b''.join(records for _, records in groups)
    offset_start = 0
    if with_offsets:
        offset_start, place = start + len(summary), start
        for opcode, records in groups:
            content = struct.pack('<BQQ', opcode, place, len(records))
            summary += make.record(0x0E, content)
            place += len(records)
    footer = struct.pack('<BQQQ', 0x02, 20, start if summary else 0, offset_start)
    return summary + footer + struct.pack('<I', crc32(footer, crc32(summary))) + MAGIC
