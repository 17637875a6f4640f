from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.recorded import ARRAY, NUMBER, block, number, topic

from lathe_chatter.array_types import Array
from lathe_chatter.errors import RunReadError
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.recording import RunWriter, read_run
from lathe_chatter.samples import SAMPLE_COLUMNS


def record(folder: Path, blocks: list[Array], lathes: tuple[str, ...] = ('/lathe',)) -> None:
    with RunWriter(folder) as writer:
        for lathe in lathes:
            writer.add_topic(topic(f'{lathe}/samples', ARRAY))
        for k, samples in enumerate(blocks):
            if k == len(blocks) // 2:
                writer.split()
            for lathe in lathes:
                time = 10**9 + k * 2_000_000
                writer.write(f'{lathe}/samples', block(samples), log_time=time, publish_time=time)


@pytest.fixture
def blocks() -> list[Array]:
    lathe = VirtualLathe()
    return [lathe.advance(20) for _ in range(50)]


def test_samples_come_back_bit_for_bit_over_a_split(tmp_path: Path, blocks: list[Array]) -> None:
    record(tmp_path / 'run', blocks)
    samples = read_run(tmp_path / 'run').samples()
    assert tuple(samples.columns) == SAMPLE_COLUMNS
    joined = np.column_stack(list(samples.columns.values()))
    assert joined.tobytes() == np.concatenate(blocks).tobytes()
    assert samples.gaps == []


def test_a_missing_block_is_a_gap_and_never_joined_in_silence(
    tmp_path: Path, blocks: list[Array]
) -> None:
    record(tmp_path / 'run', blocks[:10] + blocks[12:])
    assert read_run(tmp_path / 'run').samples().gaps == [(blocks[9][-1, 0], blocks[12][0, 0])]


def test_other_topics_are_dated_by_the_samples_about_them(
    tmp_path: Path, blocks: list[Array]
) -> None:
    record(tmp_path / 'run', blocks)
    samples = read_run(tmp_path / 'run').samples()
    assert samples.simulated_time(10**9 + 4_000_000) == blocks[2][-1, 0]
    between = samples.simulated_time(10**9 + 5_000_000)
    assert between == pytest.approx(0.5 * (blocks[2][-1, 0] + blocks[3][-1, 0]), rel=1e-12)


def test_two_lathes_must_be_told_apart(tmp_path: Path, blocks: list[Array]) -> None:
    record(tmp_path / 'run', blocks[:4], lathes=('/a/lathe', '/b/lathe'))
    run = read_run(tmp_path / 'run')
    with pytest.raises(
        RunReadError,
        match=r'several lathes: name one by its topic, /a/lathe/samples, /b/lathe/samples',
    ):
        run.samples()
    assert len(run.samples('/b/lathe/samples').columns['time']) == 80


@pytest.mark.parametrize('name', ['nowhere', '.'])
def test_no_run_is_a_sentence(name: str, tmp_path: Path) -> None:
    with pytest.raises(RunReadError, match=r'does not exist|holds no recorded run'):
        read_run(tmp_path / name)


def test_a_damaged_file_is_never_read_as_if_it_were_whole(
    tmp_path: Path, blocks: list[Array]
) -> None:
    record(tmp_path / 'run', blocks)
    file = tmp_path / 'run' / 'run_0.mcap'
    whole = bytearray(file.read_bytes())
    whole[len(whole) // 3] ^= 0x10
    file.write_bytes(whole)
    with pytest.raises(RunReadError, match=r'run_0\.mcap is damaged'):
        read_run(tmp_path / 'run').samples()


def test_a_run_without_samples_says_so(tmp_path: Path) -> None:
    with RunWriter(tmp_path / 'run') as writer:
        writer.add_topic(topic('/numbers', NUMBER))
        writer.write('/numbers', number(1.0), log_time=1, publish_time=1)
    with pytest.raises(RunReadError, match='holds no samples of a lathe'):
        read_run(tmp_path / 'run').samples()
