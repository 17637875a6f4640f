"""Nodes as processes, what they take of the machine, and what keeps the machine busy."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from lathe_chatter.nodes.node_main import make_executor

NODES = [sys.executable, '-m', 'lathe_chatter.nodes.entry_points']
LATHE, MONITOR, RECORDER, CELL = 'lathe', 'chatter_monitor', 'run_recorder', 'cell'


@contextlib.contextmanager
def running(node: str, *arguments: str, cores: set[int] | None = None) -> Iterator[int]:
    """A node as a process; its process id."""
    process = subprocess.Popen(  # noqa: S603 -- our own modules
        [*NODES, node, *(['--ros-args', *arguments] if arguments else [])],
        stderr=subprocess.DEVNULL,
        preexec_fn=(lambda: os.sched_setaffinity(0, cores)) if cores else None,  # noqa: PLW1509 -- no thread is running
    )
    try:
        yield process.pid
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(30)


@contextlib.contextmanager
def script(name: str, *arguments: str) -> Iterator[int]:
    """A script of this folder as a process; its process id."""
    process = subprocess.Popen([sys.executable, str(Path(__file__).with_name(name)), *arguments])  # noqa: S603 -- our own
    try:
        yield process.pid
    finally:
        process.kill()
        process.wait(30)


def cpu_seconds(pid: int) -> float:
    """User and system time of a process so far."""
    fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


def resident(pid: int) -> float:
    """Resident memory, MB."""
    pages = int(Path(f'/proc/{pid}/statm').read_text().split()[1])
    return pages * os.sysconf('SC_PAGE_SIZE') / 1e6


def cpu_share(pid: int, seconds: float) -> float:
    """Percent of a core that a process takes."""
    return cpu_shares({'': pid}, seconds)['']


def cpu_shares(pids: dict[str, int], seconds: float) -> dict[str, float]:
    """Percent of a core that each process takes, over the same time."""
    before, began = {name: cpu_seconds(pid) for name, pid in pids.items()}, time.monotonic()
    time.sleep(seconds)
    elapsed = time.monotonic() - began
    return {name: 100 * (cpu_seconds(pid) - before[name]) / elapsed for name, pid in pids.items()}


def burn() -> None:
    """Keep a core busy."""
    while True:
        sum(range(10_000))


@contextlib.contextmanager
def busy(count: int) -> Iterator[None]:
    """So many processes that do nothing but burn a core."""
    burners = [multiprocessing.Process(target=burn, daemon=True) for _ in range(count)]
    for burner in burners:
        burner.start()
    try:
        yield
    finally:
        for burner in burners:
            burner.kill()  # the handlers of rclpy, which a fork inherits, ignore SIGTERM
            burner.join()


def executor_of(node: Any) -> Any:
    """A quick executor that serves a node."""
    executor = make_executor(node)
    executor.add_node(node)
    return executor
