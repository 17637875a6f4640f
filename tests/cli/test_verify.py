"""`verify` and `recover` on a run with and without damage."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from support.recorded import number, topic

from lathe_chatter.cli.main import main
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.lathe.change_and_knock_sentences import BEGINNING
from lathe_chatter.model.lathe_parameter_table import parameters_of
from lathe_chatter.recording import LatheRun, RunWriter, read_run


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    with RunWriter(tmp_path / 'run') as writer:
        writer.add_topic(topic('/numbers'))
        for k in range(2000):
            writer.write('/numbers', number(float(k)), log_time=k, publish_time=k, sequence=k + 1)
            if k % 100 == 99:
                writer.commit()
    return tmp_path / 'run'


def test_a_whole_run_is_complete(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['verify', str(folder), '--json']) == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures['complete']
    assert figures['messages'] == {'/numbers': 2000}


def test_a_damaged_run_is_not_and_its_sound_part_is_saved(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = folder / 'run_0.mcap'
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) // 2])
    assert main(['verify', str(folder)]) == 1
    assert 'NOT complete' in capsys.readouterr().out
    assert main(['recover', str(folder), '--json']) == 1
    figures = json.loads(capsys.readouterr().out)
    saved = [m.message.data for m in read_run(figures['run']).messages('/numbers')]
    assert saved == [float(k) for k in range(len(saved))]
    assert 500 < len(saved) < 2000
    assert file.read_bytes() == whole[: len(whole) // 2]
    assert figures['damage']


def test_a_run_that_was_altered_is_found_out_by_computing_it_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, change in (('true', 0.0), ('altered', 1e-9), ('without its log', 1e-9)):
        lathe = VirtualLathe()
        with LatheRun(tmp_path / name, parameters_of(lathe)) as run:
            if 'log' not in name:
                run.log(BEGINNING)
            for k in range(20):
                samples = lathe.advance(20)
                samples[4, 6] += change * (k == 9)
                run.write(samples)
    assert main(['verify', str(tmp_path / 'true'), '--resimulate']) == 0
    assert 'all 400 samples were computed again and are equal' in capsys.readouterr().out
    assert main(['verify', str(tmp_path / 'altered')]) == 0
    capsys.readouterr()
    assert main(['verify', str(tmp_path / 'altered'), '--resimulate']) == 1
    said = capsys.readouterr().out
    assert 'WRONG  /lathe/samples: the sample at 0.0185 s has chip_thickness' in said
    assert 'The run was altered.' in said
    # What cannot be told apart from a change that nobody logged is no accusation.
    assert main(['verify', str(tmp_path / 'without its log'), '--resimulate']) == 3
    said = capsys.readouterr().out
    assert 'UNSURE /lathe/samples: the sample at 0.0185 s has chip_thickness' in said
    assert 'altered' not in said
    assert said.endswith('neither confirmed nor denied\n')


def test_without_samples_there_is_nothing_to_compute_again(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(['verify', str(folder), '--resimulate']) == 2
    assert 'holds no samples of a lathe' in capsys.readouterr().err


@pytest.mark.parametrize('content', [b'', bytes(range(256)) * 20])
def test_what_nothing_can_be_saved_of_is_said_and_leaves_no_folder(
    content: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / 'a.mcap').write_bytes(content)
    assert main(['recover', str(tmp_path / 'a.mcap')]) == 1
    said = capsys.readouterr().out
    assert 'LOST' in said
    assert said.endswith('a.mcap could be saved\n')
    assert main(['recover', str(tmp_path / 'a.mcap'), '--json']) == 1
    assert json.loads(capsys.readouterr().out)['run'] is None
    assert [*tmp_path.iterdir()] == [tmp_path / 'a.mcap']


def test_a_device_is_said_to_be_no_file(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['verify', '/dev/null']) == 2
    assert '/dev/null is neither a file nor a folder.' in capsys.readouterr().err
