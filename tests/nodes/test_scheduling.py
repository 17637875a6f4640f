"""The kernel is asked for short slices, and only where nobody has decided otherwise."""

from __future__ import annotations

import ctypes
import os
import platform
import struct
import subprocess
import sys

import pytest

GET_ATTRIBUTES = {'x86_64': 315, 'aarch64': 275}
ASK = 'from lathe_chatter.nodes.scheduling import ask_for_short_slices as a; print(a())'


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
