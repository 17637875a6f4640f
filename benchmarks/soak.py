"""All tests many times in a row, some of them beside busy cores: do they pass every time?

    python benchmarks/soak.py [--runs 10] [--busy 3] [--cores 1] [ARGUMENTS OF PYTEST ...]

The last `--busy` of the runs share the machine with `--cores` processes that count without end.
One line a run: its counts, time and the tests that failed, with why; then a line of all. The exit
code is 1 if any test failed in any run.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def one_run(words: Sequence[str], cores: int) -> tuple[str, list[str], float, bool]:
    """The counts, the tests that failed, the seconds, and whether all was well."""
    command = [sys.executable, '-m', 'pytest', '-q', '-n', '3', '--dist', 'loadfile', *words]
    with ExitStack() as stack:
        for _ in range(cores):
            busy = subprocess.Popen([sys.executable, '-c', 'while True: pass'])
            stack.callback(busy.wait)
            stack.callback(busy.kill)
        began = time.monotonic()
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    seconds = time.monotonic() - began
    failed = re.findall(r'^(?:FAILED|ERROR) .*|^E  .*', done.stdout, re.MULTILINE)
    *_, counts = [line for line in done.stdout.splitlines() if line.strip()] or [done.stderr]
    return counts.strip('= '), failed, seconds, done.returncode == 0


def main() -> int:
    """Run, and print."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--runs', type=int, default=10)
    parser.add_argument('--busy', type=int, default=3, help='how many of them beside busy cores')
    parser.add_argument('--cores', type=int, default=1, help='how many cores are busy then')
    options, words = parser.parse_known_args()
    fine, times = 0, []
    for number in range(options.runs):
        cores = options.cores if number >= options.runs - options.busy else 0
        counts, failed, seconds, passed = one_run(words, cores)
        fine += passed
        times.append(seconds)
        beside = f', {cores} core busy' if cores else ''
        print(
            f'run {number + 1}{beside}: {seconds:.0f} s: {counts}', *failed, sep='\n  ', flush=True
        )
    print(
        f'{fine} of {options.runs} runs without a failure, {options.busy} of the {options.runs} '
        f'beside {options.cores} busy core; {min(times):.0f} to {max(times):.0f} s each'
    )
    return int(fine < options.runs)


if __name__ == '__main__':
    sys.exit(main())
