"""What tests have workers do: in a module of its own, so that a worker starts in no time."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

from lathe_chatter.errors import ParameterError


def square(number: int) -> int:
    return number * number


def refused(number: int) -> int:
    if number >= 3:
        raise ParameterError('number', number, '', 'below 3')
    return number


def fatal(_number: int) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def square_unless_killed(number: int, mark: Path) -> int:
    """The first worker that comes to 5 is killed, with whatever else it has."""
    time.sleep(0.02)
    if number == 5 and not mark.exists():
        mark.touch()
        fatal(number)
    return square(number)
