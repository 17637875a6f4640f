"""The processes of a cell: what is said of one that ends as it should not."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import pytest

import lathe_chatter
from lathe_chatter.errors import NodeFailedError
from lathe_chatter.nodes import node_processes
from lathe_chatter.nodes.node_processes import ProcessGroup


def module(folder: Path, monkeypatch: pytest.MonkeyPatch, program: str) -> str:
    """A program as a module that `python -m` finds."""
    (folder / 'a_program.py').write_text(program)
    monkeypatch.setenv('PYTHONPATH', str(folder))
    return 'a_program'


def failure(group: ProcessGroup) -> str:
    """What the group says once a process of it has ended."""
    end = time.monotonic() + 60.0
    while time.monotonic() < end:
        try:
            group.check()
        except NodeFailedError as error:
            return str(error)
        time.sleep(0.01)
    return ''


def test_nothing_is_imported_from_where_the_user_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Beside a clone there is a folder of its name, and a script may have any."""
    here = tmp_path / 'here'
    (here / 'lathe_chatter').mkdir(parents=True)
    (here / 'random').mkdir()
    (here / 'random/__init__.py').write_text('raise SystemExit("a script of mine")')
    monkeypatch.chdir(here)
    program = 'import random, lathe_chatter; raise SystemExit(lathe_chatter.__file__)'
    with ProcessGroup() as group:
        group.start('node', module=module(tmp_path, monkeypatch, program))
        assert failure(group) == f'node ended with exit code 1: {lathe_chatter.__file__}'


@pytest.mark.parametrize(
    ('program', 'said'),
    [
        (
            'print("one"); raise SystemExit("the reason")',
            'node ended with exit code 1: the reason',
        ),
        ('raise SystemExit(3)', 'node ended with exit code 3: it said nothing'),
    ],
)
def test_a_node_that_fails_is_named_with_its_last_words(
    program: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with ProcessGroup() as group:
        group.start('node', module=module(tmp_path, monkeypatch, program))
        assert failure(group) == said


def test_a_node_that_is_killed_is_named_with_the_signal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = f'import os; os.kill(os.getpid(), {int(signal.SIGKILL)})'
    with ProcessGroup() as group:
        group.start('node', module=module(tmp_path, monkeypatch, program))
        assert failure(group) == 'node was ended by the signal SIGKILL.'


def test_a_node_that_does_not_end_is_killed_and_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(node_processes, '_END_TIMEOUT', 1.0)
    ready = tmp_path / 'ready'
    program = (
        'import pathlib, signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); '
        f'pathlib.Path({os.fspath(ready)!r}).touch(); time.sleep(600)'
    )
    with ProcessGroup() as group:
        group.start('node', module=module(tmp_path, monkeypatch, program))
        while not ready.exists():
            group.check()
            time.sleep(0.01)
        assert group.end() == ['node did not end within 1 s and was killed.']
