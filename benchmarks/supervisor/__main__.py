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
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

sys.path.append(str(Path(__file__).parents[2] / 'tests'))

from core import Outcome, play
from trials import random_trial

FIRST_SEED = 1000


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


PARTS: dict[str, Callable[[Any], Iterator[str]]] = {'core': core}


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
