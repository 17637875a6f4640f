"""What a caller may ask of a run: a mistake is one sentence, never a wrong answer."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from support.recorded import ARRAY, topic

from lathe_chatter.errors import LatheChatterError
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model.lathe_parameter_table import parameters_of
from lathe_chatter.recording import LatheRun, Run, RunWriter, read_run
from lathe_chatter.samples import SAMPLE_COLUMNS
from lathe_chatter.samples.codec import encode_block


@pytest.fixture(scope='module')
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = tmp_path_factory.mktemp('choice') / 'run'
    lathe = VirtualLathe()
    with LatheRun(folder, parameters_of(lathe)) as record:
        record.write(lathe.advance(100))
    return read_run(folder)


@pytest.mark.parametrize(
    ('asked', 'sentence'),
    [
        ({'columns': 'time'}, "columns is 'time': it must be a list of names of columns."),
        ({'columns': 5}, 'columns is 5: it must be a list of names of columns.'),
        ({'columns': []}, 'columns is []: it must be a list of names of columns.'),
        ({'start': 'a'}, "start is 'a': it must be a number, in s."),
        ({'end': math.nan}, 'end is nan s: it must be a number.'),
        ({'start': 2, 'end': 1}, 'start is 2.0 s: it must be at most the end, 1 s.'),
    ],
    ids=str,
)
def test_a_wish_that_cannot_be_met_is_one_sentence(
    run: Run, asked: dict[str, Any], sentence: str
) -> None:
    with pytest.raises(LatheChatterError) as refused:
        run.samples(**asked)
    assert str(refused.value) == sentence


def test_a_topic_without_samples_is_told_with_those_that_have_some(run: Run) -> None:
    with pytest.raises(LatheChatterError, match=r'of the topic /x: .* are of /lathe/samples'):
        run.samples('/x')


def test_a_file_of_another_kind_is_no_run(tmp_path: Path) -> None:
    (tmp_path / 'notes.md').write_text('# notes')
    with pytest.raises(LatheChatterError, match=r'notes\.md is no MCAP file'):
        read_run(tmp_path / 'notes.md')


def test_a_column_that_ends_is_one_sentence(tmp_path: Path) -> None:
    lathe = VirtualLathe()
    columns = SAMPLE_COLUMNS[:5]
    with RunWriter(tmp_path / 'run') as writer:
        writer.add_topic(topic('/lathe/samples', ARRAY))
        for k in range(4):
            samples = lathe.advance(20)
            data = encode_block(samples) if k < 2 else encode_block(samples[:, :5], columns)
            writer.write('/lathe/samples', data, log_time=k + 1, publish_time=k + 1)
    run = read_run(tmp_path / 'run')
    with pytest.raises(
        LatheChatterError, match=r'from 0\.004100 s on have no chip_thickness, cutt'
    ):
        run.samples()
    assert len(run.samples(columns=columns).columns['time']) == 80
