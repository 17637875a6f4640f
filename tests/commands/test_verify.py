"""`verify` and `recover` on a run with and without damage."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from recording.conftest import number, topic

from lathe_chatter.cli import main
from lathe_chatter.recording import RunWriter, read_run


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
