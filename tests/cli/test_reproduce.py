"""`lathe-chatter reproduce` as a user calls it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from lathe_chatter.cli import main as cli


def test_it_judges_every_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(['reproduce', '--output', str(tmp_path), '--no-pictures', '--json']) == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures == json.loads((tmp_path / 'reproduction.json').read_text())
    assert figures['agreeing'] == len(figures['runs']) == 14
    text = (tmp_path / 'index.html').read_text(encoding='utf-8')
    for run in figures['runs']:
        assert f'{run["root"]["growth_rate"]:+.6f}' in text
        assert abs(run['root']['growth_rate'] - run['measured']['growth_rate']) < 0.01
    assert len(figures['cutting_coefficient']['readings']) == 21


def test_interrupted_it_ends_soon_without_a_traceback_and_leaves_no_pictures(
    tmp_path: Path,
) -> None:
    """Ctrl-C of a terminal reaches every process of the call."""
    with subprocess.Popen(
        [sys.executable, '-m', 'lathe_chatter.cli', 'reproduce', '--output', str(tmp_path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    ) as process:
        while not [*tmp_path.iterdir()]:
            assert process.poll() is None
            time.sleep(0.02)
        os.killpg(process.pid, signal.SIGINT)
        said, _ = process.communicate(timeout=60)
    assert process.returncode == 130, said
    assert said == 'Interrupted: what was drawn is removed again.\n'
    assert not [*tmp_path.iterdir()]


def test_a_reproduction_is_not_overwritten(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / 'index.html').write_text('mine')
    assert cli.main(['reproduce', '--output', str(tmp_path), '--no-pictures']) == 2
    assert 'index.html exists already' in capsys.readouterr().err
    assert (tmp_path / 'index.html').read_text() == 'mine'


def test_a_file_where_the_folder_should_be_is_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / 'file'
    path.touch()
    assert cli.main(['reproduce', '--output', str(path)]) == 2
    assert capsys.readouterr().err.count('\n') == 1
