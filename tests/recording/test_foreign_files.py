"""Files of other writers, sound and not: read whole, or one sentence says why not."""

from __future__ import annotations

import re
import shlex
import shutil
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.rosbag2.enums import CompressionFormat, CompressionMode
from support.recorded import ARRAY, STORE, block, topic

from lathe_chatter.array_types import Array
from lathe_chatter.cli.main import main
from lathe_chatter.errors import RunReadError
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.recording import read_run, recover, verify

START = 1_700_000_000_000_000_000
Alter = Callable[[int, bytes], bytes]
ROWS, WIDTH = 20, 8


@pytest.fixture(scope='module')
def blocks() -> list[Array]:
    lathe = VirtualLathe()
    return [lathe.advance(ROWS) for _ in range(80)]


def write(
    file: Path, blocks: list[Array], alter: Alter = lambda _k, data: data, **options: object
) -> Path:
    """As mcap's own writer does."""
    described = topic('/lathe/samples', ARRAY)
    with file.open('wb') as stream:
        writer = McapWriter(stream, compression=CompressionType.NONE, **options)
        writer.start('ros2', 'another')
        schema = writer.register_schema(ARRAY, 'ros2msg', described.definition.encode())
        channel = writer.register_channel(described.name, 'cdr', schema, {})
        for k, samples in enumerate(blocks):
            data = alter(k, block(samples))
            writer.add_message(channel, START + k, data, START + k, 0)
        writer.finish()
    return file


def array_of(path: Path) -> Array:
    return np.column_stack(list(read_run(path).samples().columns.values()))


def test_messages_outside_of_chunks_are_read_and_verified(
    blocks: list[Array], tmp_path: Path
) -> None:
    file = write(tmp_path / 'loose_0.mcap', blocks, use_chunking=False, enable_data_crcs=True)
    assert verify(file).findings == []
    assert verify(file).messages == {'/lathe/samples': len(blocks)}
    assert array_of(file).tobytes() == np.concatenate(blocks).tobytes()
    saved = recover(file, tmp_path / 'saved')
    assert array_of(saved.run.path).tobytes() == np.concatenate(blocks).tobytes()


def test_a_flipped_bit_outside_of_chunks_is_found_by_the_crc_of_the_file(
    blocks: list[Array], tmp_path: Path
) -> None:
    file = write(tmp_path / 'loose_0.mcap', blocks, use_chunking=False, enable_data_crcs=True)
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 1
    file.write_bytes(data)
    assert not verify(file).complete
    with pytest.raises(RunReadError, match='have no CRC of their own'):
        read_run(file).samples()


def number_at(row: int, value: float) -> Alter:
    """Another time for a sample of block 30."""

    def alter(k: int, data: bytes) -> bytes:
        place = len(data) - (ROWS - row) * WIDTH * 8
        return data[:place] + struct.pack('<d', value) + data[place + 8 :] if k == 30 else data

    return alter


@pytest.mark.parametrize(
    ('alter', 'said'),
    [
        (lambda k, data: data[:100] if k == 30 else data, 'is cut off'),
        (lambda k, data: b'\xff' * len(data) if k == 30 else data, 'is not CDR'),
        (lambda _k, _data: b'', 'is not CDR'),
        (number_at(0, np.nan), 'the times of 1 samples are no numbers'),
        (number_at(7, np.inf), 'the times of 1 samples are no numbers'),
        (number_at(19, 1e300), 'some samples are missing between 0.061900 s and 1e+300 s'),
        (number_at(3, 0.5), 'samples are missing between 0.060300 s and 0.500000 s'),
    ],
    ids=['cut', 'noise', 'empty', 'nan', 'infinite', 'huge', 'late'],
)
def test_payloads_that_cannot_be_are_losses_and_no_traceback(
    alter: Alter, said: str, blocks: list[Array], tmp_path: Path
) -> None:
    file = write(tmp_path / 'odd_0.mcap', blocks, alter)
    found = verify(file).findings
    assert any(said in finding.text for finding in found if finding.loss)
    assert len(found) < 5
    assert main(['verify', str(file), '--resimulate']) == 1
    assert main(['export', str(file), '--output', str(tmp_path / 'odd.csv')]) in {0, 2}
    assert main(['recover', str(file), '--output', str(tmp_path / 'saved')]) == 0


def converted(refused: RunReadError) -> Path:
    """What the command makes that the sentence names."""
    command = shlex.split(re.search('`(.+)`', str(refused))[1])  # type: ignore[index]  # there
    program = Path(sys.executable).with_name(command[0])
    subprocess.run([program, *command[1:]], check=True, capture_output=True)
    return Path(command[command.index('--dst') + 1])


@pytest.mark.parametrize(
    ('storage', 'mode', 'what'),
    [
        (StoragePlugin.MCAP, CompressionMode.FILE, 'a bag compressed by file'),
        (StoragePlugin.MCAP, CompressionMode.MESSAGE, 'a bag compressed by message'),
        (StoragePlugin.SQLITE3, CompressionMode.NONE, 'a bag in SQLite'),
    ],
)
def test_bags_that_are_no_plain_mcap_are_named_with_the_command_that_converts_them(
    storage: StoragePlugin,
    mode: CompressionMode,
    what: str,
    blocks: list[Array],
    tmp_path: Path,
) -> None:
    writer = Writer(tmp_path / 'a run', version=9, storage_plugin=storage)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection('/lathe/samples', ARRAY, typestore=STORE)
        for k, samples in enumerate(blocks):
            writer.write(connection, START + k, block(samples))
    with pytest.raises(RunReadError, match=rf'a run is {what}, and only plain MCAP') as refused:
        read_run(tmp_path / 'a run')
    plain = converted(refused.value)
    assert array_of(plain).tobytes() == np.concatenate(blocks).tobytes()
    assert verify(plain).complete
    (file,) = (each for each in (tmp_path / 'a run').iterdir() if each.suffix != '.yaml')
    with pytest.raises(RunReadError, match=rf'is (of )?{what}, and only plain MCAP') as refused:
        read_run(file)
    assert f"--src '{tmp_path / 'a run'}'" in str(refused.value)


@pytest.mark.parametrize(
    ('program', 'ending'), [('zstd', '.zstd'), ('zstd', ''), ('lz4', '.lz4'), ('gzip', '.gz')]
)
def test_a_compressed_file_alone_is_named_with_the_command_that_unpacks_it(
    program: str, ending: str, blocks: list[Array], tmp_path: Path
) -> None:
    if shutil.which(program) is None:
        pytest.skip(f'{program} is not here')
    plain = write(tmp_path / 'a.mcap', blocks)
    packed = subprocess.run([program, '-c', str(plain)], check=True, capture_output=True).stdout
    plain.unlink()
    file = tmp_path / f'a.mcap{ending}'
    file.write_bytes(packed)
    with pytest.raises(RunReadError, match=f'is a file compressed by {program}') as refused:
        read_run(file)
    command = str(refused.value).split('`')[1]
    subprocess.run(['sh', '-c', command], check=True, capture_output=True)
    target = tmp_path / ('a.mcap' if ending else 'a-plain.mcap')
    assert array_of(target).tobytes() == np.concatenate(blocks).tobytes()
