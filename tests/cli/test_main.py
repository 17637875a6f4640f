from __future__ import annotations

import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from lathe_chatter.cli.main import main
from lathe_chatter.cli.verbs import VERBS, Verb, parser


@pytest.mark.parametrize('verb', VERBS, ids=lambda verb: str(verb.NAME))
def test_every_verb_has_help_with_an_example(
    verb: Verb, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        parser().parse_args([verb.NAME, '--help'])
    assert ended.value.code == 0
    shown = ' '.join(capsys.readouterr().out.split())
    assert f'example: {verb.EXAMPLE}' in shown


@pytest.mark.parametrize('verb', VERBS, ids=lambda verb: str(verb.NAME))
def test_every_example_is_a_valid_command_line(verb: Verb) -> None:
    words = verb.EXAMPLE.split()
    assert words[0] == 'lathe-chatter'
    assert parser().parse_args(words[1:]).verb == verb.NAME


@pytest.mark.parametrize(
    ('arguments', 'named'),
    [
        (['run', '--scenario', 'nowhere.yaml'], "'nowhere.yaml'"),
        (['run', '--output', '.'], '. exists already'),
        (['report', 'nowhere'], 'nowhere'),
    ],
)
def test_a_mistake_is_one_sentence_and_exit_2(
    arguments: list[str], named: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 2
    written = capsys.readouterr().err.strip()
    assert named in written
    assert '\n' not in written


@pytest.mark.parametrize(
    ('arguments', 'said'),
    [
        (
            ['lobes', '--depth-limits', '1'],
            'lathe-chatter lobes: unrecognized arguments: --depth-limits 1, perhaps --depth-limit',
        ),
        (['lobes', '--from'], 'lathe-chatter lobes: argument --from: expected one argument'),
        (['simulate'], 'lathe-chatter simulate: the following arguments are required: --output'),
    ],
)
def test_a_wrong_command_line_is_a_line_and_where_to_look(
    arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2
    assert capsys.readouterr().err == f'{said}\nSee lathe-chatter {arguments[0]} --help.\n'


@pytest.mark.skipif(sys.platform != 'linux', reason='a path is bytes on Linux')
def test_a_path_in_another_encoding_works_or_is_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Reading it works; a run, which names itself in UTF-8, is not made there."""
    place = os.fsdecode(os.fsencode(tmp_path) + b'/\xff')
    made = ['simulate', '--duration', '0.2', '--output']
    for call in (
        [*made, place],
        [*made, str(tmp_path / 'run2'), '--scenario', place],
        ['run', '--output', place],
        ['recover', str(tmp_path / 'run'), '--output', place],
    ):
        Path(place).touch()
        assert main(call) == 2
        said = capsys.readouterr().err
        assert r'\udcff' in said
        assert 'UTF-8' in said
        assert said.count('\n') == 1
    Path(place).unlink()
    assert main([*made, str(tmp_path / 'run')]) == 0
    (tmp_path / 'run').rename(place)
    assert main(['verify', place]) == 0
    assert main(['report', place]) == 0
    assert main(['export', place, '--output', f'{place}.csv']) == 0
    assert main(['export', place, '--format', 'parquet', '--output', f'{place}.parquet']) == 2
    assert main(['lobes', '--output', f'{place}.png']) == 0
    assert Path(f'{place}.svg').exists()


SLOW_LIBRARY = """
import time
from pathlib import Path
Path(__file__).with_name('begun').touch()
time.sleep(30.0)
"""


def test_an_interrupt_while_libraries_are_loaded_is_no_traceback(tmp_path: Path) -> None:
    (tmp_path / 'rich').mkdir()
    (tmp_path / 'rich' / '__init__.py').write_text(SLOW_LIBRARY)
    with subprocess.Popen(
        [sys.executable, '-m', 'lathe_chatter.cli', 'bench'],
        env={**os.environ, 'PYTHONPATH': str(tmp_path)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as process:
        while not (tmp_path / 'rich' / 'begun').exists():
            assert process.poll() is None
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        said, _ = process.communicate(timeout=30)
    assert process.returncode == 130
    assert not said


def test_a_reader_that_has_enough_is_no_mistake(tmp_path: Path) -> None:
    words = [sys.executable, '-m', 'lathe_chatter.cli', 'simulate', '--duration', '0.2']
    call = shlex.join([*words, '--output', str(tmp_path / 'run')])
    done = subprocess.run(
        ['bash', '-c', f'{call} --json | true; echo "${{PIPESTATUS[0]}}"'],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() in {'141', '0'}
    assert 'Traceback' not in done.stderr
    assert 'rror' not in done.stderr


def test_the_program_starts_without_ros_and_says_its_version(tmp_path: Path) -> None:
    # The core must not need ROS: here any import of it fails.
    (tmp_path / 'rclpy.py').write_text('raise ImportError("not here")\n')
    done = subprocess.run(
        [sys.executable, '-m', 'lathe_chatter.cli', '--version'],
        env={'PYTHONPATH': str(tmp_path), 'HOME': str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith('lathe-chatter ')
