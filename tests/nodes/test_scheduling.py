"""The kernel is asked for short slices, and only where nobody has decided otherwise."""

from __future__ import annotations

import ctypes
import os
import platform
import struct
import subprocess
import sys

import pytest

from lathe_chatter.nodes.real_time_loop import RealTime

GET_ATTRIBUTES = {'x86_64': 315, 'aarch64': 275}
ASK = 'from lathe_chatter.nodes.real_time_loop import ask_for_short_slices as a; print(a())'


def kernel() -> tuple[int, int]:
    major, minor = platform.release().split('.')[:2]
    return int(major), int(minor)


def slice_of(pid: int) -> int:
    """The slice that a process has asked for, ns."""
    attributes = ctypes.create_string_buffer(56)
    call = GET_ATTRIBUTES[platform.machine()]
    assert ctypes.CDLL(None).syscall(call, pid, attributes, 56, 0) == 0
    return int(struct.unpack('IIQiIQQQII', attributes.raw)[5])


@pytest.mark.skipif(
    platform.system() != 'Linux' or platform.machine() not in GET_ATTRIBUTES or kernel() < (6, 12),
    reason='slices of tasks are known to Linux from 6.12 on',
)
def test_the_slice_is_the_shortest_and_the_niceness_stays() -> None:
    script = f'import os; os.nice(3); {ASK}; input()'
    with subprocess.Popen(
        [sys.executable, '-c', script], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == 'True\n'
        assert slice_of(process.pid) == 100_000
        assert os.getpriority(os.PRIO_PROCESS, process.pid) == 3 + os.nice(0)
        process.communicate('\n')


@pytest.mark.skipif(platform.system() != 'Linux', reason='policies of Linux')
def test_a_policy_that_somebody_chose_is_kept() -> None:
    script = f'import os; os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0)); {ASK}'
    out = subprocess.run(
        [sys.executable, '-c', script], capture_output=True, check=True, text=True
    )
    assert out.stdout == 'False\n'


REAL_TIME = """
import os, subprocess, sys
from lathe_chatter.nodes.real_time_loop import RealTime
child = [sys.executable, '-c', 'import os; print(os.sched_getscheduler(0))']
place = RealTime(1)
for wanted in (True, True, False):
    place.hold(wanted=wanted)
    inherited = subprocess.run(child, capture_output=True, text=True).stdout
    print(place.word, os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK, inherited.strip())
"""


@pytest.mark.skipif(platform.system() != 'Linux', reason='policies of Linux')
def test_real_time_is_held_while_wanted_and_never_inherited() -> None:
    done = subprocess.run(
        [sys.executable, '-c', REAL_TIME], capture_output=True, check=True, text=True
    )
    ordinary = f'ordinary {os.SCHED_OTHER} {os.SCHED_OTHER}'
    held = f'real time, priority 1 {os.SCHED_RR} {os.SCHED_OTHER}'
    first, second, last = done.stdout.splitlines()
    assert first in {held, ordinary}  # as the system permits
    assert first == held or not permitted()
    assert second == first
    assert last == ordinary


def permitted() -> bool:
    """Whether this system lets this user have real-time scheduling."""
    script = 'import os; os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))'
    done = subprocess.run([sys.executable, '-c', script], check=False, capture_output=True)
    return done.returncode == 0


@pytest.mark.skipif(platform.system() != 'Linux', reason='policies of Linux')
def test_real_time_is_not_asked_for_where_it_is_not_wanted_or_somebody_chose() -> None:
    never = RealTime(0)
    never.hold(wanted=True)
    assert never.word == 'ordinary'
    chosen = (
        'import os; os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0));'
        'from lathe_chatter.nodes.real_time_loop import RealTime; place = RealTime(1);'
        'place.hold(wanted=True); print(os.sched_getscheduler(0) == os.SCHED_BATCH)'
    )
    out = subprocess.run(
        [sys.executable, '-c', chosen], capture_output=True, check=True, text=True
    )
    assert out.stdout == 'True\n'
