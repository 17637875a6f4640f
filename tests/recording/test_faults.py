"""Faults that a file meets after it was written: what is handed out is right, or an error."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from support.recorded import ARRAY, STORE, block, number, topic

from lathe_chatter.array_types import Array
from lathe_chatter.errors import NothingSavedError, RunReadError
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.recording import RunWriter, read_run, recover, verify
from lathe_chatter.recording.provenance import PUBLISHERS

START = 1_700_000_000_000_000_000
BLOCKS, PER_COMMIT = 60, 10


@pytest.fixture(scope='module')
def blocks() -> list[Array]:
    lathe = VirtualLathe()
    return [lathe.advance(20) for _ in range(BLOCKS)]


@pytest.fixture(scope='module')
def whole(tmp_path_factory: pytest.TempPathFactory, blocks: list[Array]) -> bytes:
    """A run of six chunks in one file."""
    folder = tmp_path_factory.mktemp('whole') / 'run'
    with RunWriter(folder) as writer:
        writer.note('lathe_chatter/made_by', {'lathe_chatter': '0'})
        writer.add_topic(topic('/lathe/samples', ARRAY))
        writer.add_topic(topic('/numbers'))
        for k, samples in enumerate(blocks):
            time = START + k * 2_000_000
            told = {'log_time': time, 'publish_time': time, 'sequence': k + 1}
            writer.write('/lathe/samples', block(samples), **told)
            writer.write('/numbers', number(float(k)), **told)
            if k % PER_COMMIT == PER_COMMIT - 1:
                writer.commit()
    assert verify(folder).findings == []
    return (folder / 'run_0.mcap').read_bytes()


def records(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Opcode, beginning and end of each record, walked as the specification has it."""
    place = 8
    while place < len(data) - 8:
        opcode, length = struct.unpack_from('<BQ', data, place)
        yield opcode, place, place + 9 + length
        place += 9 + length


def run_of(folder: Path, data: bytes) -> Path:
    folder.mkdir()
    file = folder / 'run_0.mcap'
    file.write_bytes(data)
    return file


def chunks_before(data: bytes, place: int) -> int:
    return sum(opcode == 6 and end <= place for opcode, _, end in records(data))


def test_a_file_cut_at_any_record_gives_back_every_chunk_before_the_cut(
    whole: bytes, blocks: list[Array], tmp_path: Path
) -> None:
    for k, (_, _, end) in enumerate(records(whole)):
        if end >= len(whole) - 8:
            break
        file = run_of(tmp_path / f'{k}', whole[:end])
        assert not verify(file).complete
        kept = PER_COMMIT * chunks_before(whole, end)
        if k == 0:  # a head, and nothing after it
            with pytest.raises(NothingSavedError):
                recover(file, tmp_path / f'saved_{k}')
            continue
        recovery = recover(file, tmp_path / f'saved_{k}')
        assert recovery.messages['/lathe/samples'] == kept
        assert file.read_bytes() == whole[:end]
        if kept:
            columns = recovery.run.samples().columns
            assert np.column_stack(list(columns.values())).tobytes() == (
                np.concatenate(blocks[:kept]).tobytes()
            )
            with Reader(tmp_path / f'saved_{k}') as reader:
                assert len(list(reader.messages())) == 2 * kept


def test_a_file_cut_within_a_record_gives_back_every_chunk_before_the_cut(
    whole: bytes, tmp_path: Path
) -> None:
    for k, place in enumerate(np.random.default_rng(1).integers(8, len(whole), 40).tolist()):
        file = run_of(tmp_path / f'{k}', whole[:place])
        assert not verify(file).complete
        recovery = recover(file, tmp_path / f'saved_{k}')
        assert recovery.messages['/numbers'] == PER_COMMIT * chunks_before(whole, place)


def test_a_flipped_bit_is_found_and_costs_one_chunk_at_most(
    whole: bytes, blocks: list[Array], tmp_path: Path
) -> None:
    generator = np.random.default_rng(2)
    places = generator.integers(0, len(whole), 100).tolist()
    reference = {row.tobytes() for row in np.concatenate(blocks)}
    for k, place in enumerate(places):
        data = bytearray(whole)
        data[place] ^= 1 << int(generator.integers(8))
        file = run_of(tmp_path / f'{k}', bytes(data))
        assert not verify(file).complete, place
        try:
            found = list(read_run(file).samples().columns.values())
        except RunReadError:
            found = []
        # Without an error: right samples only, whatever the flip.
        assert {row.tobytes() for row in np.column_stack(found)} <= reference if found else True
        recovery = recover(file, tmp_path / f'saved_{k}')
        assert recovery.messages['/numbers'] >= BLOCKS - PER_COMMIT, place
        samples = recovery.run.samples().columns.values()
        assert {row.tobytes() for row in np.column_stack(list(samples))} <= reference


def test_what_a_damaged_chunk_held_is_a_gap_in_what_is_left(
    whole: bytes, blocks: list[Array], tmp_path: Path
) -> None:
    data = bytearray(whole)
    _, start, end = [entry for entry in records(whole) if entry[0] == 6][2]
    data[(start + end) // 2] ^= 0x10
    file = run_of(tmp_path / 'damaged', bytes(data))
    with pytest.raises(RunReadError, match=r'run_0\.mcap is damaged at byte .* CRC|decompressed'):
        read_run(file).samples()
    run = read_run(file, damaged=True)
    expected = [(blocks[19][-1, 0], blocks[30][0, 0])]
    assert run.samples().gaps == expected
    assert [(each.start, each.end) for each in run.damage] == [(start, end)]
    texts = [finding.text for finding in verify(file).findings if finding.loss]
    between = f'between {expected[0][0]:.6f} s and {expected[0][1]:.6f} s'
    assert f'/lathe/samples: 200 samples are missing {between} of simulated time.' in texts


def test_losses_on_the_way_are_named_with_topic_and_interval(tmp_path: Path) -> None:
    with RunWriter(tmp_path / 'run') as writer:
        writer.add_topic(topic('/numbers'))
        for k in (1, 2, 3, 8, 9):
            time = START + k * 1_000_000_000
            writer.write('/numbers', number(k), log_time=time, publish_time=time, sequence=k)
    assert [finding.text for finding in verify(tmp_path / 'run').findings] == [
        '/numbers: 4 messages are missing between 22:13:23.000000 UTC and 22:13:28.000000 UTC.'
    ]


@pytest.mark.parametrize(('publishers', 'losses'), [(None, 1), (2, 0)])
def test_numbers_of_a_publisher_that_was_found_later_are_no_loss(
    publishers: int | None, losses: int, tmp_path: Path
) -> None:
    with RunWriter(tmp_path / 'run') as writer:
        writer.add_topic(topic('/numbers'))
        if publishers is not None:
            writer.note(PUBLISHERS, {'/numbers': str(publishers)})
        for second, sequence in ((0, 1), (2, 5), (4, 6), (6, 7)):
            time = START + second * 10**9
            told = {'log_time': time, 'publish_time': time, 'sequence': sequence}
            writer.write('/numbers', number(sequence), **told)
    assert len(verify(tmp_path / 'run').findings) == losses


def test_a_run_whose_recorder_was_killed_says_where_it_ends(
    blocks: list[Array], tmp_path: Path
) -> None:
    writer = RunWriter(tmp_path / 'run')
    writer.note('lathe_chatter/made_by', {'lathe_chatter': '0'})
    writer.add_topic(topic('/lathe/samples', ARRAY))
    writer.write('/lathe/samples', block(blocks[0]), log_time=START, publish_time=START)
    writer.commit()
    writer.abandon()
    said = (
        'The recorder did not finish: all that it had taken is there, the last sample is of '
        '0.002000 s.'
    )
    assert [finding.text for finding in verify(tmp_path / 'run').findings] == [said]


def test_a_run_of_another_recorder_is_verified_and_read_too(
    blocks: list[Array], tmp_path: Path
) -> None:
    def write(folder: Path, chosen: list[Array]) -> Path:
        with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            connection = writer.add_connection('/lathe/samples', ARRAY, typestore=STORE)
            for k, samples in enumerate(chosen):
                writer.write(connection, START + k, block(samples))
        return folder

    folder = write(tmp_path / 'whole', blocks)
    assert verify(folder).complete
    columns = read_run(folder).samples().columns
    joined = np.column_stack(list(columns.values()))
    assert joined.tobytes() == np.concatenate(blocks).tobytes()
    assert not verify(write(tmp_path / 'lossy', blocks[:9] + blocks[10:])).complete


@pytest.mark.parametrize(
    ('compression', 'crcs'),
    [(CompressionType.NONE, False), (CompressionType.NONE, True), (CompressionType.ZSTD, False)],
)
def test_a_file_as_ros2_bag_record_leaves_it_is_verified_by_its_payload(
    compression: CompressionType, crcs: bool, blocks: list[Array], tmp_path: Path
) -> None:
    """As rosbag2's plugin writes: its profile, chunks of 768 KiB, no sequence numbers."""
    described = topic('/lathe/samples', ARRAY)
    for name, kept in (('whole', blocks), ('part', [*blocks[5:30], *blocks[31:]])):
        with (tmp_path / f'{name}_0.mcap').open('wb') as stream:
            writer = McapWriter(
                stream,
                chunk_size=768 * 1024,
                compression=compression,
                enable_crcs=crcs,
                enable_data_crcs=crcs,
            )
            writer.start(profile='ros2', library='libmcap 1.3.0')
            text = described.definition.encode()
            schema = writer.register_schema(described.type, 'ros2msg', text)
            qos = {'offered_qos_profiles': ''}
            channel = writer.register_channel(described.name, 'cdr', schema, qos)
            for k, samples in enumerate(kept):
                time = START + k * 2_000_000
                writer.add_message(channel, time, block(samples), time, 0)
            writer.finish()
    remarks = verify(tmp_path / 'whole_0.mcap').findings
    assert [finding.loss for finding in remarks] == [False] * (not crcs)
    assert all('has no CRC of its data' in finding.text for finding in remarks)
    found = read_run(tmp_path / 'whole_0.mcap').samples()
    assert np.column_stack(list(found.columns.values())).tobytes() == (
        np.concatenate(blocks).tobytes()
    )
    late, lost = verify(tmp_path / 'part_0.mcap').findings[-2:]
    assert not late.loss
    assert 'begins at 0.010100 s of simulated time, 100 samples late' in late.text
    assert lost.loss
    assert '20 samples are missing between 0.060000 s and 0.062100 s' in lost.text
