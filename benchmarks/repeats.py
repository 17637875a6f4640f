"""The node tests again and again: whether one of them fails now and then.

    python benchmarks/repeats.py [--repeats 200]

Two runs of all node tests go at a time, on the cores of this machine, with a process beside them
that does nothing but burn a core. Nothing is tried again; it stops at the first failure.
"""

from __future__ import annotations

import argparse
import multiprocessing
import subprocess
import sys
import time
from pathlib import Path

_TESTS = [sys.executable, '-m', 'pytest', '-q', '-x', '-p', 'no:cacheprovider', 'tests/nodes']


def burn() -> None:
    """Keep a core busy."""
    while True:
        sum(range(10_000))


def repeat(repeats: int) -> None:
    """Run all node tests so many times.

    Raises:
        SystemExit: With what the tests said, if one fails.
    """
    done, began = 0, time.monotonic()
    while done < repeats:
        runs = [
            subprocess.Popen(  # noqa: S603 -- our own tests
                _TESTS, cwd=Path(__file__).parents[1], stdout=subprocess.PIPE, text=True
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


def main() -> None:
    """Repeat as often as was asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').partition('\n')[0])
    parser.add_argument('--repeats', type=int, default=200)
    burner = multiprocessing.Process(target=burn, daemon=True)
    burner.start()
    try:
        repeat(parser.parse_args().repeats)
    finally:
        burner.kill()
        burner.join()


if __name__ == '__main__':
    main()
