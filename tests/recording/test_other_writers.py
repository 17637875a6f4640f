"""Files with what ROS cannot name beside a lathe's samples: kept, counted, skipped or refused."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.records import Channel
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter
from support.recorded import ARRAY, BOOL, NUMBER, block, number, topic

from lathe_chatter.array_types import Array
from lathe_chatter.errors import RunReadError
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.recording import read_run, recover, verify

ROWS = 500
START = 1_700_000_000_000_000_000
TICK = 50_000_000


@pytest.fixture(scope='module')
def blocks() -> list[Array]:
    lathe = VirtualLathe()
    return [lathe.advance(ROWS) for _ in range(40)]


def write(file: Path, blocks: list[Array], *, leave_out: slice = slice(0), **options: Any) -> Path:
    """Samples, in chunks of 12 blocks, and what stands beside them."""
    kept = [k for k in range(len(blocks)) if k not in range(len(blocks))[leave_out]]
    described = topic('/lathe/samples', ARRAY)
    with file.open('wb') as stream:
        writer = McapWriter(
            stream, compression=CompressionType.LZ4, chunk_size=12 * ROWS * 64, **options
        )
        writer.start('ros2', 'another')
        schema = writer.register_schema(ARRAY, 'ros2msg', described.definition.encode())
        channel = writer.register_channel(described.name, 'cdr', schema)
        for k in kept:
            time = START + k * TICK
            writer.add_message(channel, time, block(blocks[k]), time, k + 1)
        writer.finish()
    return file


def write_beside(file: Path) -> Path:
    """Two types on one topic, no schema, JSON, protobuf, and no description of a type."""
    with file.open('wb') as stream:
        writer = McapWriter(stream)
        writer.start('', 'another')
        schemas = {
            kind: writer.register_schema(kind, 'ros2msg', topic('/t', kind).definition.encode())
            for kind in (BOOL, NUMBER)
        }
        schemas['json'] = writer.register_schema('Thing', 'jsonschema', b'{"type": "object"}')
        schemas['proto'] = writer.register_schema('pkg.Thing', 'protobuf', b'\xff\xfe\x00')
        schemas['bare'] = writer.register_schema('other_msgs/msg/Thing', 'ros2msg', b'')
        for k, (name, encoding, schema, data) in enumerate(
            [
                ('/t', 'cdr', schemas[BOOL], b'\0\1\0\0\1'),
                ('/t', 'cdr', schemas[NUMBER], number(2.5)),
                ('/raw', 'bytes', 0, b'\1\2'),
                ('/json', 'json', schemas['json'], b'{}'),
                ('/proto', 'protobuf', schemas['proto'], b'\x08\x01'),
                ('/bare', 'cdr', schemas['bare'], b'\0\1\0\0'),
                ('/short', 'cdr', schemas[NUMBER], b'\0\1\0\0\1'),
            ]
        ):
            channel = writer.register_channel(name, encoding, schema, {'kept': str(k)})
            writer.add_message(channel, k, data, k, 0)
        writer.finish()
    return file


def listed(path: Path) -> list[Any]:
    """All that a file holds of its messages, by mcap's own walk."""
    with path.open('rb') as stream:
        records = [*StreamReader(stream).records]
    schemas = {r.id: (r.name, r.encoding, r.data) for r in records if type(r).__name__ == 'Schema'}
    channels = {
        r.id: (r.topic, r.message_encoding, dict(r.metadata), schemas.get(r.schema_id))
        for r in records
        if isinstance(r, Channel)
    }
    return [
        (*channels[r.channel_id], r.log_time, r.data)
        for r in records
        if type(r).__name__ == 'Message'
    ]


def test_recover_keeps_every_schema_and_encoding(tmp_path: Path) -> None:
    file = write_beside(tmp_path / 'beside_0.mcap')
    saved = recover(file, tmp_path / 'saved')
    assert saved.damage == []
    assert listed(tmp_path / 'saved' / 'saved_0.mcap') == listed(file)
    for path in (file, tmp_path / 'saved'):
        found = verify(path)
        assert found.complete
        assert sum(found.messages.values()) == 7
        assert found.messages['/t'] == 2


@pytest.mark.parametrize(
    ('name', 'sentence'),
    [
        ('/raw', r"Messages of /raw are encoded as 'bytes', and not as CDR: they are not decoded"),
        ('/json', r"Messages of /json of type Thing are encoded as 'json'"),
        ('/proto', r"Messages of /proto of type pkg\.Thing are encoded as 'protobuf'"),
        ('/bare', r'Messages of /bare of type other_msgs/msg/Thing have no definition'),
        ('/short', r'Messages of /short of type std_msgs/msg/Float64 do not fit the definition'),
    ],
)
def test_what_cannot_be_decoded_is_one_sentence_or_left_out(
    name: str, sentence: str, tmp_path: Path
) -> None:
    run = read_run(write_beside(tmp_path / 'beside_0.mcap'))
    with pytest.raises(RunReadError, match=sentence):
        list(run.messages(name))
    assert [each.message.data for each in run.messages(skip=True)] == [True, 2.5]


OLD = """std_msgs/Header header
uint8 radiation_type
float32 field_of_view
float32 min_range
float32 max_range
float32 range
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
OTHER = OLD.replace(
    'float32 min_range\nfloat32 max_range\nfloat32 range\n',
    'float32 range\nfloat32 min_range\nfloat32 max_range\nfloat32 variance\n',
)
IDL = """================================================================================
IDL: sensor_msgs/msg/Range
module sensor_msgs { module msg {
  struct Range {
    float field_of_view; float range; float min_range; float max_range; float variance;
  };
}; };
"""
STAMPED = b'\0\1\0\0' + struct.pack('<iI', 1, 2) + struct.pack('<I', 2) + b'a\0\0\0'


@pytest.mark.parametrize(
    ('encoding', 'definition', 'data', 'expected'),
    [
        (
            'ros2msg',
            OLD,
            STAMPED + struct.pack('<4f', 1, 2, 3, 4),
            {'min_range': 2.0, 'max_range': 3.0, 'range': 4.0},
        ),
        (
            'ros2msg',
            OTHER,
            STAMPED + struct.pack('<5f', 1, 2, 3, 4, 5),
            {'range': 2.0, 'min_range': 3.0, 'max_range': 4.0, 'variance': 5.0},
        ),
        (
            'ros2idl',
            IDL,
            b'\0\1\0\0' + struct.pack('<5f', 1, 2, 3, 4, 5),
            {'field_of_view': 1.0, 'range': 2.0, 'variance': 5.0},
        ),
    ],
    ids=['older', 'another order', 'idl'],
)
def test_messages_are_decoded_by_the_definition_in_the_file(
    encoding: str, definition: str, data: bytes, expected: dict[str, float], tmp_path: Path
) -> None:
    file = tmp_path / 'range_0.mcap'
    with file.open('wb') as stream:
        writer = McapWriter(stream)
        writer.start('ros2', 'other')
        schema = writer.register_schema('sensor_msgs/msg/Range', encoding, definition.encode())
        channel = writer.register_channel('/range', 'cdr', schema)
        writer.add_message(channel, 1, data, 1, 0)
        writer.finish()
    (found,) = read_run(file).messages('/range')
    assert {name: float(getattr(found.message, name)) for name in expected} == expected


NOTHING_REPEATED = {
    'repeat_schemas': False,
    'repeat_channels': False,
}
NO_INDEX = {'index_types': IndexType.NONE}


@pytest.mark.parametrize(
    'options',
    [
        NOTHING_REPEATED,
        NO_INDEX,
        {'use_statistics': False, **NOTHING_REPEATED},
        {**NOTHING_REPEATED, **NO_INDEX, 'use_statistics': False},
        {'use_chunking': False, **NOTHING_REPEATED},
        {'use_chunking': False, 'use_statistics': False, 'use_summary_offsets': False, **NO_INDEX},
    ],
    ids=str,
)
def test_missing_samples_are_found_however_little_the_summary_says(
    options: dict[str, Any], blocks: list[Array], tmp_path: Path
) -> None:
    whole = write(tmp_path / 'whole_0.mcap', blocks, **options)
    assert verify(whole).complete
    assert verify(whole).messages == {'/lathe/samples': 40}
    found = np.column_stack([*read_run(whole).samples().columns.values()])
    assert found.tobytes() == np.concatenate(blocks).tobytes()
    part = write(tmp_path / 'part_0.mcap', blocks, leave_out=slice(13, 18), **options)
    losses = [finding.text for finding in verify(part).findings if finding.loss]
    assert any('2500 samples are missing between 0.650000 s and 0.900100 s' in t for t in losses)
