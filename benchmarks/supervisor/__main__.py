"""How often, how soon and at what price a supervisor ends chatter, and what it must leave alone.

    python benchmarks/supervisor [--trials N] [--hours H] [--processes N] [PART ...]

Parts: core stable nodes hostile (all by default). `core` and `stable` are lathe, detector and
supervisor of the core in simulated time; `nodes` are real ones over DDS. Constants were chosen on
the seeds below 1000; what is printed is from those above.
"""

from __future__ import annotations

import os

# One thread a process: the cores are shared out by the trial.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

import argparse
import multiprocessing
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

sys.path.append(str(Path(__file__).resolve().parents[2] / 'tests'))

from core import Outcome, play
from stable import STRETCH, stretch
from trials import random_trial

FIRST_SEED, NODE_TRIALS = 1000, 10
ROOT = Path(__file__).resolve().parents[2]


def _outcome(seed: int, off: float, answer: str) -> Outcome:
    return play(random_trial(seed, off), answer)


def core(options: Any) -> Iterator[str]:
    """The table over random machines and cuts."""
    seeds = range(options.first_seed, options.first_seed + options.trials)
    yield 'random machines and cuts    ended  alarm to stable, s  moves  rate kept  unsafe moves'
    yield '                                   median      95 %           median'
    rows = (
        ('supervisor, told right', 0.0, 'supervisor'),
        ('supervisor, told +-5 % off', 0.05, 'supervisor'),
        ('60 f/k, repeated', 0.0, 'rule'),
        ('no action', 0.0, 'nothing'),
    )
    with multiprocessing.Pool(options.processes) as pool:
        for name, off, answer in rows:
            work = partial(_outcome, off=off, answer=answer)
            yield f'{name:<27} {_row(pool.map(work, seeds, chunksize=5))}'


def _row(outcomes: Sequence[Outcome]) -> str:
    """One line of the table: of the trials with an alarm in which a stable cut exists."""
    counted = [o for o in outcomes if o.alarmed and o.possible]
    ended = [o for o in counted if o.ended]
    moves, unsafe = sum(o.moves for o in counted), sum(o.unsafe for o in counted)
    share = 100.0 * len(ended) / max(len(counted), 1)
    times = np.array([o.time for o in ended if o.moves] or [np.nan])
    kept = np.array([min(o.kept, 1.0) for o in ended] or [np.nan])
    return (
        f'{share:5.1f} %  {np.median(times):6.2f}   {np.percentile(times, 95):6.2f}     '
        f'{moves / max(len(counted), 1):5.2f}  {100.0 * np.median(kept):6.1f} %   '
        f'{unsafe} of {moves}  ({len(ended)} of {len(counted)}; {len(outcomes)} tried)'
    )


def stable(options: Any) -> Iterator[str]:
    """Hours of stable cutting."""
    count = max(round(3600.0 * options.hours / STRETCH), 1)
    seeds = range(options.first_seed, options.first_seed + count)
    with multiprocessing.Pool(options.processes) as pool:
        found = pool.map(stretch, seeds, chunksize=5)
    actions, alarms = sum(each[0] for each in found), sum(each[1] for each in found)
    hours = count * STRETCH / 3600.0
    yield f'{hours:.1f} h of stable cutting: {actions} actions, {alarms} alarms of the monitor'
    yield from (f'   {sentence}' for acted, _, said in found if acted for sentence in said)


def nodes(options: Any) -> Iterator[str]:
    """The real nodes on the first machines of the table."""
    from nodes import play_nodes  # where there is no ROS 2 the other parts work all the same

    count = min(options.trials, NODE_TRIALS)
    trials = [random_trial(options.first_seed + k) for k in range(count)]
    played = [play_nodes(trial) for trial in trials]
    flagged = [each for each in played if each.alarmed]
    ended = [each for each in flagged if each.ended]
    times = np.array([each.time for each in ended] or [np.nan])
    yield (
        f'real nodes: chatter ended in {len(ended)} of {len(flagged)} ({count} tried); from the '
        f'flag to its end {np.median(times):.1f} s in the median, {times.max():.1f} s at most'
    )
    yield from (f'   {s}' for each in flagged if not each.ended for s in each.said)


def hostile(_options: Any) -> Iterator[str]:
    """The kinds of disturbance are tests: what they say is printed."""
    command = [sys.executable, '-m', 'pytest', '-q', 'tests/supervisor/test_hostile.py']
    done = subprocess.run(  # noqa: S603 -- our own tests
        command, cwd=ROOT, capture_output=True, text=True, check=False
    )
    yield f'hostile: {done.stdout.strip().splitlines()[-1]}'


PARTS: dict[str, Callable[[Any], Iterator[str]]] = {
    'core': core,
    'stable': stable,
    'nodes': nodes,
    'hostile': hostile,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        prog='python benchmarks/supervisor',
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('parts', nargs='*', metavar='PART', help=f'of {", ".join(PARTS)}')
    parser.add_argument('--trials', type=int, default=200, help='random machines and cuts')
    parser.add_argument('--first-seed', type=int, default=FIRST_SEED, metavar='N')
    parser.add_argument('--hours', type=float, default=10.0, help='of stable cutting')
    parser.add_argument('--processes', type=int, default=os.cpu_count())
    options = parser.parse_args(arguments)
    unknown = [part for part in options.parts if part not in PARTS]
    if unknown:
        parser.error(f'{unknown[0]} is no part: it must be one of {", ".join(PARTS)}')
    begin = time.monotonic()
    for part in options.parts or PARTS:
        for line in PARTS[part](options):
            print(line, flush=True)
    print(f'{os.cpu_count()} cores; {time.monotonic() - begin:.0f} s')
    return 0


if __name__ == '__main__':
    sys.exit(main())
