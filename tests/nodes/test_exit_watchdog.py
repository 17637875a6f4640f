"""A process that its libraries do not let go ends all the same, with the code that is due."""

from __future__ import annotations

import subprocess
import sys

import pytest

ARM = 'import ctypes, sys, threading; from lathe_chatter.nodes.node_main import exit_within; '
# PyDLL calls with the GIL held, as rclpy does where it destroys a node.
STUCK = 'ctypes.PyDLL(None).pause()'


def end_of(program: str) -> int:
    done = subprocess.run([sys.executable, '-c', ARM + program], check=False, timeout=60)
    return done.returncode


@pytest.mark.skipif(sys.platform != 'linux', reason='the timer is that of Linux')
@pytest.mark.parametrize('code', [0, 2])
def test_a_process_that_is_stuck_with_the_gil_held_ends(code: int) -> None:
    assert end_of(f'exit_within(0.3, {code}); {STUCK}') == code


@pytest.mark.skipif(sys.platform != 'linux', reason='the timer is that of Linux')
def test_a_process_that_is_stuck_while_python_ends_ends() -> None:
    stuck = f'class Stuck:\n def __del__(self): {STUCK}\nkept = Stuck()\n'
    assert end_of(f'exit_within(0.5, 3)\n{stuck}') == 3


def test_one_that_ends_by_itself_has_its_own_code() -> None:
    assert end_of('exit_within(30.0, 1); sys.exit(4)') == 4
