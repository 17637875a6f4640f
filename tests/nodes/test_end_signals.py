from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest

from lathe_chatter.nodes.end_signals import DeferredSignals


@pytest.fixture(autouse=True)
def handlers() -> Iterator[list[int]]:
    """SIGTERM and SIGHUP raise KeyboardInterrupt, as in the program, and are listed."""
    came: list[int] = []

    def interrupt(number: int, _frame: object) -> None:
        came.append(number)
        raise KeyboardInterrupt

    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)}
    for number in before:
        signal.signal(number, interrupt)
    yield came
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_waits_until_it_is_heeded(number: signal.Signals) -> None:
    with DeferredSignals() as held:
        held.deliver()
        os.kill(os.getpid(), number)
        with pytest.raises(KeyboardInterrupt):
            held.deliver()
        held.deliver()  # once


def test_the_first_of_several_signals_counts(handlers: list[int]) -> None:
    with DeferredSignals() as held:
        for number in (signal.SIGTERM, signal.SIGHUP, signal.SIGTERM):
            os.kill(os.getpid(), number)
        with pytest.raises(KeyboardInterrupt):
            held.deliver()
    assert handlers == [signal.SIGTERM]


def test_what_nobody_heeded_comes_at_the_end(handlers: list[int]) -> None:
    with pytest.raises(KeyboardInterrupt), DeferredSignals():
        os.kill(os.getpid(), signal.SIGHUP)
    assert handlers == [signal.SIGHUP]
    with pytest.raises(KeyboardInterrupt):  # and the handler is back
        os.kill(os.getpid(), signal.SIGHUP)


def test_an_error_goes_before_a_signal() -> None:
    def fail_when_told_to_end() -> None:
        os.kill(os.getpid(), signal.SIGINT)
        raise ValueError('the real reason')

    with pytest.raises(ValueError, match='real'), DeferredSignals():
        fail_when_told_to_end()


def test_a_signal_that_is_ignored_stays_ignored() -> None:
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    with DeferredSignals() as held:
        os.kill(os.getpid(), signal.SIGHUP)
        held.deliver()
    assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN


LOST = """
import ctypes, os, signal, sys, time
from lathe_chatter.nodes.end_signals import ignore_end_signals, raise_on_end_signals
raise_on_end_signals()

@ctypes.CFUNCTYPE(None)
def called_from_c():
    os.kill(os.getpid(), signal.SIGTERM)

def wait():  # apart: Python 3.13 misses what is raised where a loop beside `try` goes back
    end = time.monotonic() + 20.0
    while time.monotonic() < end:
        pass

try:
    called_from_c()  # as LLVM calls Numba: what is raised there is ignored
    wait()
    print('lost')
except KeyboardInterrupt:
    ignore_end_signals()
    print('heard')
"""


def test_an_interrupt_that_is_lost_in_a_call_from_c_is_raised_again() -> None:
    done = subprocess.run(
        [sys.executable, '-c', LOST], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.stdout, done.stderr) == ('heard\n', '')
