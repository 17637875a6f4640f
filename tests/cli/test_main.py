from __future__ import annotations

import os
import re
import shlex
import signal
import subprocess
import sys
import time
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from lathe_chatter.cli.common_options import path_of
from lathe_chatter.cli.main import main
from lathe_chatter.cli.verbs import VERBS, Parser, parser

ROOT = Path(__file__).resolve().parents[2]


def module_of(verb: str) -> Any:
    return import_module(f'lathe_chatter.cli.{verb.replace("-", "_")}')


@pytest.mark.parametrize('verb', VERBS)
def test_every_verb_has_help_with_an_example(
    verb: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main([verb, '--help'])
    assert ended.value.code == 0
    shown = ' '.join(capsys.readouterr().out.split())
    assert VERBS[verb] in shown
    assert f'example: {module_of(verb).EXAMPLE}' in shown


@pytest.mark.parametrize('verb', VERBS)
def test_every_example_is_a_valid_command_line(verb: str) -> None:
    words = module_of(verb).EXAMPLE.split()
    assert words[0] == 'lathe-chatter'
    assert parser(words).parse_args(words[1:]).verb == verb


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
        (['--versions'], 'lathe-chatter: unrecognized arguments: --versions, perhaps --version'),
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
    program = said.partition(':')[0]
    assert capsys.readouterr().err == f'{said}\nSee {program} --help.\n'


def test_alone_it_says_how_to_begin_with_calls_that_are_valid(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main([]) == 0
    calls = [line.split()[1:] for line in capsys.readouterr().out.split('\n') if '  lathe' in line]
    assert len(calls) == 3
    for words in calls:
        assert parser(words).parse_args(words).verb == words[0]


UNITS = r'(\bs\b|\bm\b|rev/min|N s\b|Hz|\bkg\b|rad/s|N/m|\bN\b)'
NUMBERS = (
    r'(ratio|relative|over the largest|of each call|number|part |fraction|whether|seed|times)'
)


@pytest.mark.parametrize(
    ('arguments', 'why'),
    [
        (['lobes', '--unbalance', '1'], 'no limit of a cut depends on it'),
        (['knock-map', '--force-noise=1'], 'a knock is followed without it'),
        (['knock-map', '--spindle-speed-rpm', '3000'], 'give --speeds'),
        (['lobes', '--no-accelerometers'], 'no limit of a cut depends on it'),
        (['simulate', '--output', 'x', '--tick-rate', '50'], 'the node lathe alone has it'),
    ],
)
def test_a_parameter_that_a_verb_has_not_is_refused_with_the_reason(
    arguments: list[str], why: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        main(arguments)
    said = capsys.readouterr().err
    assert f'is no option of this verb: {why}.\n' in said
    assert 'perhaps' not in said


@pytest.mark.parametrize('verb', VERBS)
def test_every_number_that_a_verb_takes_has_its_unit_in_the_help(verb: str) -> None:
    entry = Parser()
    module_of(verb).configure(entry)
    numbers = [a for a in entry._actions if a.type is float or a.metavar in {'X', 'A:B:N', 'T:J'}]
    for action in numbers:
        told = action.help or ''
        assert re.search(UNITS, told) or re.search(NUMBERS, told), (action.dest, told)


@pytest.mark.parametrize('verb', VERBS)
def test_help_fits_a_narrow_terminal_without_colour(
    verb: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv('COLUMNS', '40')
    monkeypatch.setenv('NO_COLOR', '1')
    with pytest.raises(SystemExit):
        main([verb, '--help'])
    told = capsys.readouterr().out
    assert '\x1b' not in told
    long = [line for line in told.split('\n') if len(line) > 40 and ' ' in line.strip()]
    assert not [line for line in long if not line.lstrip().startswith(('-', '['))]


@pytest.mark.skipif(sys.platform != 'linux', reason='a path is bytes on Linux')
@pytest.mark.parametrize('verb', VERBS)
@pytest.mark.parametrize('nothing', ['', 'a\0b'])
def test_what_names_no_file_is_refused(
    verb: str, nothing: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """As `--output "$FOLDER"` of a script in which FOLDER is not set."""
    of_verb = next(a for a in parser([verb])._actions if isinstance(a.choices, dict))
    takes = [a for a in of_verb.choices[verb]._actions if a.type is path_of]
    for action in takes:
        with pytest.raises(SystemExit) as ended:
            main([verb, *action.option_strings[:1], nothing])
        assert ended.value.code == 2
        assert f'{nothing!r} must name a file or a folder\n' in capsys.readouterr().err
    if not takes:
        pytest.skip('it takes no file')


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
from importlib import import_module
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


@pytest.mark.parametrize(
    ('line', 'next_word'),
    [('lathe-chatter lob', 'lobes'), ('lathe-chatter lobes --depth-l', '--depth-limit')],
)
def test_a_shell_may_ask_what_comes_next(line: str, next_word: str, tmp_path: Path) -> None:
    answer = tmp_path / 'answer'
    environment = {
        **os.environ,
        '_ARGCOMPLETE': '1',
        '_ARGCOMPLETE_STDOUT_FILENAME': str(answer),
        'COMP_LINE': line,
        'COMP_POINT': str(len(line)),
    }
    command = [sys.executable, '-m', 'lathe_chatter.cli']
    subprocess.run(command, env=environment, check=False, timeout=120)
    assert answer.read_text().strip() == next_word


LOADED = """
import sys
from lathe_chatter.cli.main import main
try:
    main(sys.argv[1:])
except SystemExit:
    pass
print(*sys.modules)
"""


def test_a_verb_loads_no_library_that_only_others_need() -> None:
    """Half of the time from a tap test to a chart was that of the page's server and others."""

    def loaded(*words: str) -> set[str]:
        call = [sys.executable, '-c', LOADED, *words]
        done = subprocess.run(call, capture_output=True, text=True, check=True)
        return set(done.stdout.split('\n')[-2].split())

    assert not loaded('--help') & {'numpy', 'rich', 'yaml'}
    others = {'uvicorn', 'starlette', 'mcap', 'rosbags', 'rclpy', 'matplotlib'}
    for verb in ('identify', 'lobes', 'knock-map', 'dataset'):
        assert not loaded(verb, '--help') & others, verb
    for verb in ('simulate', 'lobes', 'report', 'run'):
        assert 'scipy.special' not in loaded(verb, '--help'), verb


def test_a_misspelt_verb_is_told_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(['lobs'])
    assert ended.value.code == 2
    assert 'perhaps lobes' in capsys.readouterr().err


IMPORTING = """
import os, signal, sys
from lathe_chatter.cli import main

class Name:
    def __set_name__(self, owner, name):
        os.kill(os.getpid(), signal.SIGTERM)

def carried_out(words, begin):
    begin()
    class Owner:  # as of a library that is imported: Python 3.11 makes a RuntimeError of it
        name = Name()

main._carried_out = carried_out
sys.exit(main.main(['bench']))
"""


def test_an_interrupt_amid_an_import_is_no_traceback() -> None:
    command = [sys.executable, '-c', IMPORTING]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (143, '')


@pytest.mark.parametrize(
    ('verb', 'place', 'words'),
    [
        ('export', 'read_run', ['run']),
        ('listen', 'read_signals', ['a.csv']),
        ('identify', 'read_frequency_responses', ['tool=a.csv', '--output', 'a.yaml']),
        ('report', 'read_history', ['run']),
    ],
)
def test_an_interrupted_verb_says_so(
    verb: str, place: str, words: list[str], tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    def interrupted(*_values: object, **_options: object) -> object:
        raise KeyboardInterrupt

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(f'lathe_chatter.cli.{verb}.{place}', interrupted)
    assert main([verb, *words]) == 130
    assert f'lathe-chatter {verb}: interrupted before it was done.' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('words', 'allowed'),
    [
        (['--format', 'mat', '--output', 'x.csv'], 'a name that ends in .mat'),
        (['--output', 'x.png'], 'a name that ends in .csv'),
        (['--output', 'x.xyz'], 'a name that ends in .csv'),
        (['--columns', ''], 'names with commas between them'),
        (['--columns', 'time,'], 'names with commas between them'),
        (['--unrolled', '--output', 'x.csv'], 'the name of a folder'),
    ],
)
def test_an_export_whose_name_contradicts_its_format_is_refused(
    words: list[str], allowed: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(['export', 'run', *words]) == 2
    assert f'it must be {allowed}' in capsys.readouterr().err


COMMANDS = (
    (),
    ('--version',),
    ('lobes', '--help'),
    ('verify', str(ROOT / 'tests' / 'golden' / 'run')),
    ('verify', str(ROOT / 'tests' / 'golden' / 'run'), '--json'),
)


@pytest.mark.parametrize('unbuffered', ['', '1'])
@pytest.mark.parametrize('output', ['>&-', '> /dev/full'])
@pytest.mark.parametrize('command', COMMANDS, ids=lambda words: '_'.join(words[:1]) or 'alone')
def test_an_output_that_takes_nothing_is_a_sentence_and_exit_2(
    command: tuple[str, ...], output: str, unbuffered: str
) -> None:
    words = shlex.join([sys.executable, '-m', 'lathe_chatter.cli', *command])
    done = subprocess.run(
        ['sh', '-c', f'{words} {output}'], stderr=subprocess.PIPE, text=True, check=False,
        env={**os.environ, 'PYTHONUNBUFFERED': unbuffered},
    )  # fmt: skip
    assert done.returncode == 2
    said = 'standard output is closed' if '-' in output else 'No space left on device'
    sentences = [line for line in done.stderr.splitlines() if line.startswith('lathe-chatter')]
    assert len(sentences) == 1
    assert said in sentences[0]
    if '--json' not in command:  # with which all else goes to standard error
        assert done.stderr == f'{sentences[0]}\n'


def test_where_nothing_can_be_said_the_exit_code_stays() -> None:
    words = shlex.join([sys.executable, '-m', 'lathe_chatter.cli'])
    for rest in ('lobes --nonsense', 'verify nowhere', 'report nowhere >&-'):
        for error in ('2>&-', '2> /dev/full'):
            done = subprocess.run(['sh', '-c', f'{words} {rest} {error}'], check=False)
            assert done.returncode == 2, (rest, error)


def test_no_file_gets_the_number_of_a_closed_stream() -> None:
    program = (
        'from lathe_chatter.standard_streams import hold_standard_streams\n'
        'closed = hold_standard_streams()\n'
        'file = open("/dev/null")\n'
        'raise SystemExit(10 * file.fileno() + len(closed))'
    )
    words = shlex.join([sys.executable, '-c', program])
    for streams, code in (('', 30), ('<&- >&- 2>&-', 33), ('>&-', 31), ('2>&-', 31)):
        done = subprocess.run(['sh', '-c', f'{words} {streams}'], check=False)
        assert done.returncode == code, streams
