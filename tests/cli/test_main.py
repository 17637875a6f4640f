from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from lathe_chatter.cli.main import main, parser
from lathe_chatter.cli.verbs import VERBS, Verb


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
