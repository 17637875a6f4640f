"""What is printed is what was meant: no markup, valid JSON, whole words, one sentence."""

from __future__ import annotations

import fcntl
import json
import math
import os
import pty
import re
import struct
import subprocess
import sys
import termios
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from support.recorded import number, topic

from lathe_chatter.cli.console import Screen, plain, writing
from lathe_chatter.cli.main import main
from lathe_chatter.errors import OutputError
from lathe_chatter.recording import RunWriter

MARKUP = 'a [bold] b [/red] [/] :smile: \\[x]'


class _Kind(Enum):
    GAP = 'gap'


class _Pair(NamedTuple):
    low: float
    high: float


@dataclass
class _Figure:
    name: str
    value: Any


@pytest.mark.parametrize(
    ('value', 'expected'),
    [
        (math.nan, None),
        (-math.inf, None),
        (np.float64('nan'), None),
        (np.array([1.0, math.inf]), [1.0, None]),
        (np.int64(3), 3),
        ({'a': (1, math.nan), 2: _Kind.GAP}, {'a': [1, None], '2': 'gap'}),
        (_Figure('x', _Pair(0.5, math.inf)), {'name': 'x', 'value': {'low': 0.5, 'high': None}}),
        ([True, None, 'nan', Path('a/b')], [True, None, 'nan', 'a/b']),
    ],
)
def test_figures_as_json_holds_them(value: Any, expected: Any) -> None:
    assert plain(value) == expected


def test_text_is_never_markup(capsys: pytest.CaptureFixture[str]) -> None:
    screen = Screen()
    screen.say(MARKUP, 'bold red')
    screen.name_file('run', Path(MARKUP))
    screen.table({'name': 'left', MARKUP: 'text'}, [('x', MARKUP)], MARKUP)
    with screen.progress(MARKUP, 1.0) as bar:
        bar.show(what=MARKUP)
    with screen.working(MARKUP):
        pass
    told = capsys.readouterr().out
    assert told.count(MARKUP) == 5


@pytest.mark.parametrize('columns', [40, 60, 100])
def test_a_table_cuts_no_words(
    columns: int, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv('COLUMNS', str(columns))
    words = 'spindle_speed_rpm changed, bearing_clearance too'
    rows = [('1.000', words, '134.5   +17.25', '132.6   +18.20')]
    kinds = {'time': 'right', 'what': 'text', 'monitor': 'right', 'root, open': 'right'}
    Screen().table(kinds, rows)
    told = capsys.readouterr().out
    assert max(map(len, told.splitlines())) <= columns
    for word in [*words.split(), '134.5   +17.25', '132.6   +18.20', '1.000']:
        assert word in told


def test_with_json_standard_output_is_json_alone(capsys: pytest.CaptureFixture[str]) -> None:
    screen = Screen(json=True)
    screen.say('a sentence')
    screen.json({'value': math.nan})
    told = capsys.readouterr()
    assert json.loads(told.out) == {'value': None}
    assert told.err == 'a sentence\n'


def test_what_cannot_be_written_is_named(tmp_path: Path) -> None:
    with (
        pytest.raises(OutputError, match='none/a cannot be written: No such file'),
        writing(tmp_path),
    ):
        (tmp_path / 'none' / 'a').write_text('')
    with (
        pytest.raises(OutputError, match='b cannot be written: No space left on device'),
        writing(tmp_path / 'b'),
    ):
        raise OSError(28, os.strerror(28))


def test_a_run_without_samples_is_valid_json(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / 'a [bold] run'
    with RunWriter(folder) as writer:
        writer.add_topic(topic('/lathe/samples', 'std_msgs/msg/Float64MultiArray'))
        writer.add_topic(topic('/numbers'))
        writer.write('/numbers', number(1.0), log_time=1, publish_time=1, sequence=1)
    assert main(['verify', str(folder), '--json']) == 0

    def refuse(text: str) -> None:
        raise AssertionError(text)

    figures = json.loads(capsys.readouterr().out, parse_constant=refuse)
    assert figures['samples'] in (
        {},
        {'/lathe/samples': {'samples': 0, 'first': None, 'last': None}},
    )


def test_brackets_in_a_path_are_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / 'a [bold] [/red] run'
    call = ['simulate', '--output', str(folder), '--duration', '0.3', '--report']
    assert main(call) == 0
    assert f'run      {folder}\n' in capsys.readouterr().out
    assert main(['report', str(folder), '--json']) == 0
    told = capsys.readouterr()
    assert json.loads(told.out)['run'] == str(folder)
    assert f'picture  {folder}/report.png\n' in told.err


ON_A_TERMINAL = """
from lathe_chatter.cli.console import Screen
screen = Screen()
with screen.progress('doing', 2.0, 's') as bar, screen.working('working'):
    bar.show(1.0)
screen.say('word ' * 20)
"""


@pytest.mark.parametrize('columns', [40, 90])
def test_a_terminal_that_cannot_draw_gets_lines_of_its_width_alone(columns: int) -> None:
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack('HHHH', 24, columns, 0, 0))
    others = {name: value for name, value in os.environ.items() if name != 'COLUMNS'}
    subprocess.run(
        [sys.executable, '-c', ON_A_TERMINAL],
        stdout=theirs,
        env={**others, 'TERM': 'dumb'},
        check=True,
    )
    lines = os.read(ours, 4096).decode().splitlines()
    os.close(ours)
    os.close(theirs)
    assert {word for line in lines for word in line.split()} == {'word'}
    assert all(lines)
    assert max(map(len, lines)) == columns - 1


def test_nothing_begins_with_an_empty_line(tmp_path: Path) -> None:
    """Where no terminal is: what a log or a pipe gets."""
    call = ['simulate', '--output', str(tmp_path / 'run'), '--duration', '0.3']
    said = subprocess.run(
        [sys.executable, '-m', 'lathe_chatter.cli', *call],
        capture_output=True,
        text=True,
        check=True,
    )
    assert re.match(
        r'0\.3 s simulated in \S+ s, [\d.]+ times real time: 3000 samples\.\n', said.stdout
    )
    assert not said.stderr
