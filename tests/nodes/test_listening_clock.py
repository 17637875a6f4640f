"""A clock that stands while its process does: a real process, really stopped."""

from __future__ import annotations

import signal
import subprocess
import sys
import time

import pytest

PROGRAM = """
import sys, time
from lathe_chatter.nodes.listening_clock import ListeningClock
clock = ListeningClock()
begin = time.monotonic()
heard_long_ago = clock.now()
while clock.now() < heard_long_ago + 1.5:
    time.sleep(0.01)
heard_just_before = clock.now()
print('stop me', flush=True)
while time.monotonic() < begin + 1.5 + 2.0:
    time.sleep(0.01)
then = clock.now()
print(then - heard_just_before < 2.0, clock.is_silent(heard_just_before, 1.0))
print(clock.stood_still_near(heard_just_before, 1.0))
print(clock.is_silent(heard_long_ago, 1.0), clock.stood_still_near(heard_long_ago, 1.0))
print(clock.is_silent(then, 1.0))
while clock.now() < then + 30.5:
    time.sleep(0.01)
print(clock.is_silent(heard_just_before, 1.0), clock.stood_still_near(heard_just_before, 1.0))
"""


@pytest.fixture(scope='module')
def said() -> list[str]:
    command = [sys.executable, '-c', PROGRAM]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == 'stop me\n'
        process.send_signal(signal.SIGSTOP)
        time.sleep(3.0)
        process.send_signal(signal.SIGCONT)
        return process.stdout.read().splitlines()


def test_a_standstill_is_no_silence_of_others(said: list[str]) -> None:
    assert said[:2] == ['True True', 'True']


def test_who_was_silent_before_it_is_still(said: list[str]) -> None:
    assert said[2] == 'True False'


def test_what_came_again_is_not_missed(said: list[str]) -> None:
    assert said[3] == 'False'


def test_after_a_while_silence_is_silence(said: list[str]) -> None:
    assert said[4] == 'True False'
