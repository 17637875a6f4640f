"""What a run says while it starts, follows and serves its page: real nodes, as processes."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from lathe_chatter.errors import RunFailedError
from lathe_chatter.nodes.run_scenario import play
from lathe_chatter.scenario import Scenario

TOLD = """
import sys
from contextlib import contextmanager
from pathlib import Path
from lathe_chatter.errors import LatheChatterError
from lathe_chatter.nodes import run_scenario
from lathe_chatter.scenario import load_scenario

class Screen:
    def say(self, text):
        print(text, flush=True)

    @contextmanager
    def working(self, text):
        print('working:', text, flush=True)
        yield

    @contextmanager
    def progress(self, what, total, unit):
        print('working:', what, flush=True)
        yield self

    def show(self, done, what):
        print('shown:', what)

{change}
file = Path(sys.argv[1])
try:
    run_scenario.play(load_scenario(file), file, Path(sys.argv[2]), Screen(), page={page})
except LatheChatterError as error:
    print(error)
"""
SHORT = 'name: short\nduration: 0.5\n'
NO_PATIENCE = 'run_scenario._START_PATIENCE = 0.01'
NO_PATIENCE_WITH_THE_LATHE = """
follow = run_scenario._follow
def impatient(*given):
    run_scenario._START_PATIENCE = 0.5
    follow(*given)
run_scenario._follow = impatient
"""
REFUSED_PAGE = """
start = run_scenario.ProcessGroup.start
def refused(group, name, given):
    start(group, name, ['-p', 'prt:=1'] if name == 'operator_page' else given)
run_scenario.ProcessGroup.start = refused
"""


def told(domain: int, folder: Path, scenario: str, change: str = '', *, page: bool = False) -> Any:
    """A run as a process, which prints what it tells."""
    file = folder / 'short.yaml'
    file.write_text(scenario)
    script = TOLD.replace('{change}', change).replace('{page}', str(page))
    return subprocess.Popen(
        [sys.executable, '-c', script, str(file), str(folder / 'run')],
        env={**os.environ, 'ROS_DOMAIN_ID': str(domain), 'DISPLAY': '', 'WAYLAND_DISPLAY': ''},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


@pytest.mark.parametrize(
    ('scenario', 'said'),
    [
        (
            Scenario('a', 'a', 1.0, parameters={'depth': 1.0}),
            "The scenario a: There is no parameter 'depth'",
        ),
        (
            Scenario('a', 'a', 1.0, supervisor={'mod': 'ask'}),
            "The scenario a: There is no parameter 'mod'",
        ),
    ],
)
def test_a_parameter_that_nobody_has_is_named_with_its_scenario(
    scenario: Scenario, said: str, tmp_path: Path
) -> None:
    nobody: Any = None
    with pytest.raises(RunFailedError) as refused:
        play(scenario, tmp_path, tmp_path / 'run', nobody)
    assert str(refused.value).startswith(said)


@pytest.mark.usefixtures('compiled')
def test_it_says_what_it_waits_for_and_then_what_the_monitor_says(
    domain: int, tmp_path: Path
) -> None:
    said, _ = told(domain, tmp_path, SHORT).communicate(timeout=120)
    lines = said.splitlines()
    first = [
        'working: Starting the monitor and the recorder ...',
        'working: waiting for the lathe',
    ]
    assert lines[:2] == first
    shown = [line for line in lines if line.startswith('shown: ')]
    assert shown.index('shown: waiting for the lathe') == 0
    assert shown[-1] != 'shown: waiting for the lathe'


@pytest.mark.usefixtures('compiled')
@pytest.mark.parametrize(
    ('scenario', 'change', 'said'),
    [
        (
            SHORT, NO_PATIENCE,
            'chatter_monitor and run_recorder did not appear within 0.01 s.',
        ),
        (
            SHORT + 'parameters: {await_readers: 1000}\n', NO_PATIENCE_WITH_THE_LATHE,
            'No sample of the lathe came within 0.5 s.',
        ),
    ],
)  # fmt: skip
def test_who_does_not_come_is_named(
    scenario: str, change: str, said: str, domain: int, tmp_path: Path
) -> None:
    words, _ = told(domain, tmp_path, scenario, change).communicate(timeout=120)
    assert words.splitlines()[-1] == said


@pytest.mark.usefixtures('compiled')
def test_a_page_is_said_to_be_there_once_it_is_and_comes_back(domain: int, tmp_path: Path) -> None:
    run = told(domain, tmp_path, SHORT, page=True)
    lines: list[str] = []
    for line in run.stdout:
        lines.append(line.rstrip('\n'))
        there = [
            each for each in lines if re.fullmatch(r'The page is at \S+ until Ctrl-C\.', each)
        ]
        if len(there) == 1 and lines[-1].startswith('working: The page is at'):
            kill_the_page_of(run.pid)
        elif len(there) == 2:
            run.send_signal(signal.SIGINT)
            break
    run.communicate(timeout=120)
    url = there[0].split()[4]
    again = [
        'working: Starting the page ...',
        f'The page is at {url} until Ctrl-C.',
    ]
    assert lines[-6:] == [
        *again,
        f'working: The page is at {url} until Ctrl-C ...',
        'operator_page was ended by the signal SIGKILL. It is started again.',
        *again,
    ]


@pytest.mark.usefixtures('compiled')
def test_a_page_that_cannot_start_ends_the_run(domain: int, tmp_path: Path) -> None:
    run = told(domain, tmp_path, SHORT, REFUSED_PAGE, page=True)
    said, _ = run.communicate(timeout=120)
    assert re.search(r'^operator_page ended with exit code 2: ', said, re.MULTILINE)
    assert 'It is started again' not in said


def kill_the_page_of(run: int) -> None:
    for child in Path(f'/proc/{run}/task/{run}/children').read_text().split():
        if b'entry_points\0operator_page\0' in Path(f'/proc/{child}/cmdline').read_bytes():
            os.kill(int(child), signal.SIGKILL)
