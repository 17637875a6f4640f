"""How long a program waits for its first sample, its machine code compiled before."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys

from figures import Figure, Line, tracked

_REPEATS = 5
_GOAL = 1.0

_SCRIPT = """
import json, sys, time
marks = [(time.perf_counter(), time.process_time())]
def mark():
    marks.append((time.perf_counter(), time.process_time()))
import numpy; mark()
import numba; mark()
import lathe_chatter.lathe; mark()
lathe = lathe_chatter.lathe.VirtualLathe(); mark()
lathe.advance(1); mark()
print(json.dumps([marks, 'scipy.linalg' in sys.modules]))
"""
_STAGES = (
    'import of numpy',
    'import of numba',
    'import of lathe_chatter.lathe beyond them',
    'VirtualLathe(), with what numba loads for it',
    'first sample',
)


def startup() -> list[Line]:
    """Import of the package and a first step, in fresh interpreters."""
    # As a user has it: with bytecode kept, whatever the environment of this process says.
    kept = {key: value for key, value in os.environ.items() if key != 'PYTHONDONTWRITEBYTECODE'}
    runs = []
    for _ in tracked(range(_REPEATS + 1), 'fresh interpreters'):
        output = subprocess.check_output([sys.executable, '-c', _SCRIPT], env=kept)  # noqa: S603 -- our own
        runs.append(json.loads(output))
    runs = runs[1:]  # the first may have compiled
    prepared = any(linalg for _, linalg in runs)
    lines: list[Line] = []

    def medians(begin: int, end: int) -> tuple[float, float]:
        wall, cpu = (
            statistics.median(marks[end][clock] - marks[begin][clock] for marks, _ in runs)
            for clock in (0, 1)
        )
        return wall, cpu

    whole, whole_cpu = medians(0, len(_STAGES))
    name = f'import and first step: median of {_REPEATS}'
    lines += [
        Figure(name, whole, 's', _GOAL, note='by the clock'),
        Figure(
            '   CPU time of it',
            whole_cpu,
            's',
            _GOAL,
            note=f"numba's compiler {'made ready' if prepared else 'not needed'}",
        ),
    ]
    for k, stage in enumerate(_STAGES):
        wall, cpu = medians(k, k + 1)
        lines.append(Figure(f'   {stage}', wall, 's', note=f'{cpu:.2f} s of CPU time'))
    return lines
