"""`lathe-chatter reproduce` as a user calls it."""

from __future__ import annotations

import json
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


def test_a_file_where_the_folder_should_be_is_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / 'file'
    path.touch()
    assert cli.main(['reproduce', '--output', str(path)]) == 2
    assert capsys.readouterr().err.count('\n') == 1
