"""A figure, and how it is measured: CPU time in one thread, the median of several repeats."""

from __future__ import annotations

import os
import platform
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Figure:
    """A line of the table.

    Attributes:
        name: What was measured.
        value: In `unit`.
        unit: Empty for a pure number.
    """

    name: str
    value: float
    unit: str = ''


def median_time(work: Callable[[], Any], repeats: int) -> float:
    """Median duration of some calls after a first one, s.

    CPU time, so that a busy machine tells the same as an idle one.
    """
    work()
    durations = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        durations.append(time.process_time() - start)
    return statistics.median(durations)


def this_machine() -> str:
    """The machine in one line: processor, cores, system and Python."""
    processor = platform.processor() or platform.machine()
    info = Path('/proc/cpuinfo')
    if info.is_file():
        for line in info.read_text(encoding='utf-8', errors='replace').splitlines():
            if line.startswith('model name'):
                processor = line.partition(':')[2].strip()
                break
    return (
        f'{processor}, {os.cpu_count()} cores, {platform.system()} {platform.release()}, '
        f'Python {platform.python_version()}'
    )
