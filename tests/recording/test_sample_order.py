"""Samples come in the order in which they were taken, whatever the writer or the clock did."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import Writer as McapWriter
from support.recorded import ARRAY, topic

from lathe_chatter.array_types import Array
from lathe_chatter.errors import ParameterError
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.recording import read_run, verify
from lathe_chatter.samples.codec import encode_block

ROWS, BLOCKS, PER_CHUNK = 20, 1200, 100
START = 1_700_000_000_000_000_000
TICK = 2_000_000


@pytest.fixture(scope='module')
def samples() -> Array:
    return VirtualLathe().advance(ROWS * BLOCKS)


def write(file: Path, samples: Array, order: Sequence[int], times: Any, **options: Any) -> Path:
    """Blocks of samples in some order, with a time of reception each."""
    described = topic('/lathe/samples', ARRAY)
    with file.open('wb') as stream:
        writer = McapWriter(stream, chunk_size=PER_CHUNK * ROWS * 64, **options)
        writer.start('ros2', 'another')
        schema = writer.register_schema(ARRAY, 'ros2msg', described.definition.encode())
        channel = writer.register_channel(described.name, 'cdr', schema)
        for k in order:
            data = encode_block(samples[k * ROWS : (k + 1) * ROWS])
            writer.add_message(channel, int(times[k]), data, int(times[k]), 0)
        writer.finish()
    return file


def chunks_exchanged() -> list[int]:
    """A chunk too early, and some blocks of another too late."""
    chunks = np.arange(BLOCKS).reshape(-1, PER_CHUNK)
    order = np.concatenate((chunks[7], chunks[:7].ravel(), chunks[8:].ravel()))
    late = order[1000:1030].copy()
    return [*np.delete(order, slice(1000, 1030)).tolist(), *late.tolist()]


def shuffled_in_chunks() -> list[int]:
    generator = np.random.default_rng(5)
    chunks = np.arange(BLOCKS).reshape(-1, PER_CHUNK)
    return [int(k) for chunk in chunks for k in generator.permutation(chunk)]


@pytest.mark.parametrize(
    'options', [{}, {'use_chunking': False}, {'use_statistics': False}], ids=str
)
@pytest.mark.parametrize('order', [chunks_exchanged(), shuffled_in_chunks()], ids=['of', 'within'])
def test_chunks_that_a_writer_mixed_up_are_put_right(
    order: list[int], options: dict[str, Any], samples: Array, tmp_path: Path
) -> None:
    times = START + TICK * np.arange(BLOCKS)
    file = write(tmp_path / 'mixed_0.mcap', samples, order, times, **options)
    found = read_run(file).samples()
    assert np.column_stack([*found.columns.values()]).tobytes() == samples.tobytes()
    assert found.gaps == found.restarts == []
    assert found.log_times.tolist() == times.tolist()
    assert [raw.log_time for raw in read_run(file).raw_messages()] == times.tolist()
    assert not [f for f in verify(file).findings if 'goes back' in f.text or f.loss]


@pytest.mark.parametrize('step', [-2.0, -0.05, -3600.0, 5.0])
def test_a_clock_that_steps_does_not_mix_samples_up(
    step: float, samples: Array, tmp_path: Path
) -> None:
    times = START + TICK * np.arange(BLOCKS)
    times[BLOCKS // 2 + 30 :] += int(step * 1e9)
    file = write(tmp_path / 'stepped_0.mcap', samples, range(BLOCKS), times)
    found = read_run(file).samples()
    assert np.column_stack([*found.columns.values()]).tobytes() == samples.tobytes()
    assert found.gaps == found.restarts == []
    raw = [each.log_time for each in read_run(file).raw_messages()]
    assert raw == sorted(times.tolist())


def test_a_reset_stays_a_reset(samples: Array, tmp_path: Path) -> None:
    twice = np.concatenate((samples[: ROWS * 700], samples[: ROWS * 500]))
    file = write(tmp_path / 'reset_0.mcap', twice, range(BLOCKS), START + TICK * np.arange(BLOCKS))
    found = read_run(file).samples()
    assert found.columns['time'].tobytes() == twice[:, 0].tobytes()
    assert found.restarts == [(samples[ROWS * 700 - 1, 0], samples[0, 0])]


@pytest.mark.parametrize('lengths', [[700, 500], [3, 1, 700, 496], [500, 500, 200]], ids=str)
def test_each_cut_is_had_by_itself(lengths: list[int], samples: Array, tmp_path: Path) -> None:
    cuts = [samples[: ROWS * length] for length in lengths]
    file = write(
        tmp_path / 'cuts_0.mcap',
        np.concatenate(cuts),
        range(BLOCKS),
        START + TICK * np.arange(BLOCKS),
    )
    run = read_run(file)
    place = 0
    for number, (cut, length) in enumerate(zip(cuts, lengths, strict=True)):
        found = run.samples(cut=number)
        assert np.column_stack([*found.columns.values()]).tobytes() == cut.tobytes()
        assert found.restarts == found.gaps == []
        begun = START + TICK * place
        assert found.log_times.tolist() == [begun + TICK * k for k in range(length)]
        place += length
    late = run.samples(columns=['tool_velocity'], start=0.3, end=0.4, cut=len(cuts) - 1)
    times = cuts[-1][:, 0]
    inside = cuts[-1][(times >= 0.3) & (times <= 0.4), 3]
    assert late.columns['tool_velocity'].tolist() == inside.tolist()
    for none in (len(cuts), -1, 0.5):
        with pytest.raises(ParameterError, match=f'a whole number from 0 to {len(cuts) - 1}'):
            run.samples(cut=none)  # type: ignore[arg-type]  # as a caller may


def test_what_is_joined_says_so(samples: Array, tmp_path: Path) -> None:
    twice = np.concatenate((samples[: ROWS * 700], samples[: ROWS * 500]))
    file = write(tmp_path / 'reset_0.mcap', twice, range(BLOCKS), START + TICK * np.arange(BLOCKS))
    found = read_run(file).samples(columns=['tool_velocity'], start=0.3, end=0.4)
    assert len(found.columns['tool_velocity']) == 2002
    assert found.gaps == []
    assert found.restarts == [(0.4, 0.3)]
    assert repr(found).endswith(', 1 restart at 0.4 s>')
