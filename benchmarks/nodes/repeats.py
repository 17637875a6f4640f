"""The node tests again and again: whether one of them fails now and then.

Two runs of all node tests go at a time, on the cores of this machine, with a process beside them
that does nothing but burn a core. Nothing is tried again; it stops at the first failure.
"""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

from processes import busy

_TESTS = [sys.executable, '-m', 'pytest', '-q', '-x', '-p', 'no:cacheprovider', 'tests/nodes']


def repeats(count: int) -> None:
    """Run all node tests so many times, beside a burner.

    Raises:
        SystemExit: With what the tests said, if one fails.
    """
    with busy(1):
        _repeat(count)


def _repeat(repeats: int) -> None:
    """Run all node tests so many times.

    Raises:
        SystemExit: With what the tests said, if one fails.
    """
    done, began = 0, time.monotonic()
    while done < repeats:
        runs = [
            subprocess.Popen(  # noqa: S603 -- our own tests
                _TESTS, cwd=Path(__file__).parents[2], stdout=subprocess.PIPE, text=True
            )
            for _ in range(min(2, repeats - done))
        ]
        outputs = [run.communicate()[0] for run in runs]
        for run, output in zip(runs, outputs, strict=True):
            if run.returncode:
                sys.exit(f'{output}\na failure after {done} repeats without one')
        done += len(runs)
        minutes = (time.monotonic() - began) / 60.0
        print(f'{done} repeats of the node tests, 0 failures, {minutes:.0f} min', flush=True)
