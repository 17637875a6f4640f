"""Runs are read by their index: the same arrays, and damage is found as well."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.recorded import number, topic

from lathe_chatter.array_types import Array
from lathe_chatter.errors import RunReadError
from lathe_chatter.recording import RunWriter, read_run
from lathe_chatter.recording.recorded_file import RecordedFile
from lathe_chatter.samples import SAMPLE_COLUMNS
from lathe_chatter.samples.codec import SAMPLES_TYPE, encode_block

BLOCKS, ROWS, PER_COMMIT = 6000, 5, 100
START = 1_700_000_000_000_000_000


def samples_of(blocks: int) -> Array:
    numbers = np.random.default_rng(4).standard_normal((blocks * ROWS, len(SAMPLE_COLUMNS)))
    numbers[:, 0] = np.arange(1, len(numbers) + 1) / 1e4
    return numbers


@pytest.fixture(scope='module')
def samples() -> Array:
    return samples_of(BLOCKS)


@pytest.fixture(scope='module', params=[3, 40], ids=['scattered', 'in stretches'])
def folder(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory, samples: Array
) -> Path:
    """A long run among whose samples are other messages; its last block is shorter."""
    folder = tmp_path_factory.mktemp('long') / 'run'
    with RunWriter(folder) as writer:
        writer.add_topic(topic('/numbers'))
        writer.add_topic(topic('/lathe/samples', SAMPLES_TYPE))
        for k in range(BLOCKS):
            part = samples[k * ROWS : (k + 1) * ROWS - (k == BLOCKS - 1)]
            time = START + k * 500_000
            writer.write('/lathe/samples', encode_block(part), log_time=time, publish_time=time)
            if k % request.param == 0:
                writer.write('/numbers', number(k), log_time=time, publish_time=time)
            if k % PER_COMMIT == PER_COMMIT - 1:
                writer.commit_soon()
    return folder


def array_of(columns: dict[str, Array]) -> Array:
    return np.column_stack(list(columns.values()))


def test_every_sample_comes_back_bit_for_bit(folder: Path, samples: Array) -> None:
    found = read_run(folder).samples()
    assert tuple(found.columns) == SAMPLE_COLUMNS
    assert array_of(found.columns).tobytes() == samples[:-1].tobytes()
    assert found.gaps == found.restarts == []
    assert found.log_times.tolist() == [START + k * 500_000 for k in range(BLOCKS)]
    ends = samples[ROWS - 1 :: ROWS, 0].tolist()
    assert found.block_ends.tolist() == [*ends[:-1], samples[-2, 0]]


@pytest.mark.parametrize('columns', [['chip_thickness'], ['time'], ['cutting_force', 'time']])
def test_single_columns_are_the_same(folder: Path, samples: Array, columns: list[str]) -> None:
    found = read_run(folder).samples(columns=columns).columns
    for name in columns:
        column = samples[:-1, SAMPLE_COLUMNS.index(name)]
        assert found[name].tobytes() == np.ascontiguousarray(column).tobytes()


def test_a_range_of_time_is_cut_out(folder: Path, samples: Array) -> None:
    found = read_run(folder).samples(columns=['time'], start=0.50005, end=1.5)
    inside = samples[(samples[:, 0] >= 0.50005) & (samples[:, 0] <= 1.5), 0]
    assert found.columns['time'].tolist() == inside.tolist()


def test_chunks_outside_of_a_span_of_reception_are_passed_by(folder: Path, samples: Array) -> None:
    begin, end = 2345, 2455
    spans = [(START + begin * 500_000, START + end * 500_000)]
    found = list(read_run(folder).sample_blocks(received=spans))
    numbers = np.concatenate([(each.log_times - START) // 500_000 for each in found]).tolist()
    assert numbers == [*range(2300, 2500)]
    assert np.array_equal(np.concatenate([e.samples for e in found]), samples[11500:12500])


def test_a_damaged_message_index_leads_nobody_astray(
    folder: Path, samples: Array, tmp_path: Path
) -> None:
    whole = (folder / 'run_0.mcap').read_bytes()
    chunks = RecordedFile(folder / 'run_0.mcap', lambda _damage: None).known.chunks
    generator = np.random.default_rng(5)
    file = tmp_path / 'run_0.mcap'
    for chunk in generator.integers(len(chunks), size=8):
        place = chunks[chunk]
        begin = place.offset + place.length
        data = bytearray(whole)
        data[begin + generator.integers(place.index_length)] ^= 1 << generator.integers(8)
        file.write_bytes(data)
        try:
            found = array_of(read_run(file).samples().columns)
        except RunReadError:
            continue
        assert found.tobytes() == samples[:-1].tobytes()


@pytest.mark.parametrize('chunk', [0, 23, 59])
def test_a_damaged_chunk_is_an_error_or_a_gap(
    folder: Path, samples: Array, tmp_path: Path, chunk: int
) -> None:
    data = bytearray((folder / 'run_0.mcap').read_bytes())
    place = RecordedFile(folder / 'run_0.mcap', lambda _damage: None).known.chunks[chunk]
    data[place.offset + place.length // 2] ^= 4
    (tmp_path / 'run').mkdir()
    (tmp_path / 'run' / 'run_0.mcap').write_bytes(data)
    with pytest.raises(RunReadError, match='is damaged at byte'):
        read_run(tmp_path / 'run').samples(columns=['time'])
    run = read_run(tmp_path / 'run', damaged=True)
    found = run.samples()
    per_chunk = ROWS * PER_COMMIT
    left = np.delete(samples[:-1], np.s_[chunk * per_chunk : (chunk + 1) * per_chunk], axis=0)
    assert array_of(found.columns).tobytes() == left.tobytes()
    assert len(found.gaps) == (0 < chunk < 59)
    assert [damage.start for damage in run.damage] == [place.offset]
