"""Every way in which the format lets a file be written is read, listed, verified and recovered."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from mcap.records import Message
from mcap.stream_reader import StreamReader
from support.conformance import KINDS, MAGIC, Data, variants

from lathe_chatter.errors import RunReadError
from lathe_chatter.recording import read_run, recover, verify

FILES = [*variants()]


def test_the_suite_is_whole() -> None:
    assert len(FILES) == len({name for name, _, _ in FILES}) == 416


@pytest.mark.parametrize('kind', KINDS, ids=lambda kind: kind.name)
def test_mcap_itself_reads_what_is_written_here(kind: Data) -> None:
    for _, data, content in FILES:
        if data is kind:
            records = StreamReader(io.BytesIO(content), validate_crcs=True).records
            found = [record.log_time for record in records if isinstance(record, Message)]
            assert found == [message.log_time for message in data.messages]


def messages_of(path: Path) -> list[tuple[object, ...]]:
    return [
        (
            raw.topic,
            raw.type,
            raw.channel.message_encoding,
            dict(raw.channel.metadata),
            (raw.schema.name, raw.schema.encoding, bytes(raw.schema.data)) if raw.schema else None,
            raw.log_time,
            raw.publish_time,
            raw.sequence,
            raw.data,
        )
        for raw in read_run(path).raw_messages()
    ]


def expected_of(data: Data) -> list[tuple[object, ...]]:
    schema = ('Example', 'c', b'\x04\x05\x06') if data.schema else None
    encoding, values = ('a', {'foo': 'bar'}) if data.schema else ('text', {})
    kind = 'Example' if data.schema else ''
    return [
        ('example', kind, encoding, values, schema, m.log_time, m.publish_time, m.sequence, m.data)
        for m in sorted(data.messages, key=lambda message: message.log_time)
    ]


@pytest.mark.parametrize(
    ('data', 'content'), [each[1:] for each in FILES], ids=[each[0] for each in FILES]
)
def test_it_is_read_listed_verified_and_recovered(
    data: Data, content: bytes, tmp_path: Path
) -> None:
    file = tmp_path / 'file.mcap'
    file.write_bytes(content)
    saved = recover(file, tmp_path / 'saved')
    assert saved.damage == saved.lost == []
    for path in (file, tmp_path / 'saved'):
        run = read_run(path)
        assert messages_of(path) == expected_of(data)
        assert run.topics == (
            {'example': 'Example' if data.schema else ''} if data.channel else {}
        )
        notes = {n.name: n.values for n in run.notes() if not n.name.startswith('lathe_chatter/')}
        assert notes.get('myMetadata') == ({'foo': 'bar'} if data.metadata else None)
        attached = [(each.name, each.media_type, each.data) for each in run.attachments()]
        whole = [('myFile', 'application/octet-stream', b'\x01\x02\x03')]
        assert attached == (whole if data.attachment else [])
        found = verify(path)
        assert found.complete
        assert dict(found.messages) == ({'example': len(data.messages)} if data.messages else {})
    if data.messages:
        with pytest.raises(RunReadError, match=r'Messages of example.* are encoded as'):
            list(read_run(file).messages())
        assert list(read_run(file).messages(skip=True)) == []


def test_any_flipped_bit_of_a_small_file_is_found(tmp_path: Path) -> None:
    """Also where no chunk has a CRC: that of the data and that of the summary cover all else."""
    for name in ('TenMessages', 'TenMessages-ch-chx-mx-rch-rsh-st', 'OneAttachment-ax-st'):
        content = next(content for each, _, content in FILES if each == name)
        for bit in range(8 * len(MAGIC), 8 * len(content), 7):
            damaged = bytearray(content)
            damaged[bit // 8] ^= 1 << bit % 8
            (file := tmp_path / 'file.mcap').write_bytes(damaged)
            assert not verify(file).complete, f'bit {bit} of {name}'
