"""What the first start on a machine takes: installing, compiling, and until the first sample.

    python benchmarks/first_start.py [--compile-only] [--json]

Compiling is measured in an empty cache, part by part and as `make run` does it, with both cores at
work. The whole is `make run` in a fresh clone with an empty cache, the downloads being pip's from
before. Processor time counts all processes; it is what a busy machine tells about an idle one,
though not quite: caches and cores are shared.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import IO, NamedTuple, cast

from lathe_chatter import LatheChatterError, read_run
from lathe_chatter.cli.bench import this_machine
from lathe_chatter.precompile import DETECTOR_LOOP, LATHE_LOOP

ROOT = Path(__file__).resolve().parents[1]
CPU_GOAL, FIRST_SAMPLE_GOAL = 30.0, 60.0
PATIENCE = 1200.0


class Figure(NamedTuple):
    """A line of the table."""

    name: str
    value: float
    unit: str
    goal: float | None = None


def processor_time() -> float:
    """Of all processes that were started here and have ended, s."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def compiling(place: Path) -> list[Figure]:
    """Part by part, then all as `make run` does it."""
    figures = []
    for number, parts in enumerate(([], [LATHE_LOOP], [DETECTOR_LOOP])):
        environment = {**os.environ, 'NUMBA_CACHE_DIR': str(place / f'cache{number}')}
        command = [sys.executable, '-m', 'lathe_chatter.precompile', *parts]
        began, used = time.perf_counter(), processor_time()
        subprocess.run(command, env=environment, check=True, stderr=subprocess.DEVNULL)
        seconds, used = time.perf_counter() - began, processor_time() - used
        what = f'the {parts[0]}, alone' if parts else 'all that the main job needs'
        goal = None if parts else CPU_GOAL
        figures += [
            Figure(f'compiling {what}: processor time', used, 's', goal),
            Figure(f'compiling {what}: by the clock', seconds, 's'),
        ]
    return figures


def first_sample(place: Path) -> list[Figure]:
    """`make run` in a fresh clone, until a sample is on disk."""
    clone, output = place / 'clone', place / 'run'
    subprocess.run(['git', 'clone', '--quiet', ROOT, clone], check=True)
    environment = {**os.environ, 'NUMBA_CACHE_DIR': str(place / 'cache')}
    used = processor_time()
    began = time.perf_counter()
    subprocess.run([clone / 'scripts/environment'], check=True, stdout=subprocess.DEVNULL)
    installed, installing = time.perf_counter() - began, processor_time() - used
    command = ['make', 'run', f'ARGS=--output {output}']
    with subprocess.Popen(
        command,
        cwd=clone,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    ) as run:
        said = cast('IO[str]', run.stdout)
        first_word = said.readline()
        spoke = time.perf_counter() - began - installed
        while not has_samples(output) and time.perf_counter() - began < PATIENCE:
            if run.poll() is not None:
                raise SystemExit(first_word + said.read())
            time.sleep(0.1)
        whole = time.perf_counter() - began
        os.killpg(run.pid, signal.SIGTERM)
        said.read()
    return [
        Figure('installing: processor time', installing, 's'),
        Figure('installing: by the clock', installed, 's'),
        Figure('from then to the first word of `make run`', spoke, 's', 1.0),
        Figure('from `make run` to the first sample', whole, 's', FIRST_SAMPLE_GOAL),
    ]


def has_samples(output: Path) -> bool:
    """Whether a run that is being recorded has samples of a lathe."""
    try:
        run = read_run(output, damaged=True)
        topics = [name for name in run.topics if name.endswith('/samples')]
        return bool(topics) and any(True for _ in run.raw_messages(*topics))
    except (LatheChatterError, OSError):
        return False


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--compile-only', action='store_true', help='install and run nothing')
    parser.add_argument('--json', action='store_true', help='print the figures as JSON')
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as name:
        figures = compiling(Path(name))
        if not options.compile_only:
            figures += first_sample(Path(name))
    if options.json:
        print(
            json.dumps(
                {'machine': this_machine(), 'figures': [each._asdict() for each in figures]}
            )
        )
        return
    print(this_machine())
    for figure in figures:
        goal = '' if figure.goal is None else f'   (goal {figure.goal:g})'
        print(f'{figure.name:60s} {figure.value:8.1f} {figure.unit}{goal}')


if __name__ == '__main__':
    main()
