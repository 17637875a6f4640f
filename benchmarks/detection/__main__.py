"""The figures of the chatter detector: how late, how often wrong, what it knows, what it costs.

    python benchmarks/detection [--quick] [--hours H] [--onsets N] [--plot FILE] [PART ...]
        [--workers N] [--cluster ADDRESS]

Parts: check onsets benign limit advice cpu (all by default); and, only if asked for, wrong
machines sensors air history, and recordings (`recordings FOLDER`). Thresholds of the rivals, and
the detector's own, belong to one set of seeds (calibration); what is printed is from another.
Delays are counted from the change that makes the cut unstable. --quick is a smoke test.
"""

from __future__ import annotations

import os

# One thread a process: the cores are shared out by the case.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

import argparse
import json
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import worlds
from benign import advice, benign, check, cpu, limit
from onsets import onsets
from recordings import recordings
from scenarios import NOISES

from lathe_chatter.cli.bench import this_machine
from lathe_chatter.cli.console import Screen
from lathe_chatter.cli.worker_options import add_executor, executor_of

PARTS: dict[str, Callable[[Any], list[str]]] = {
    'check': check,
    'onsets': onsets,
    'benign': benign,
    'limit': limit,
    'advice': advice,
    'cpu': cpu,
}
OUTSIDE: dict[str, Callable[[Any], list[str]]] = {
    'wrong': worlds.wrong,
    'machines': worlds.machines,
    'sensors': worlds.sensors,
    'air': worlds.air,
    'history': worlds.history,
    'recordings': recordings,
}
"""What is measured outside the scenarios of the laboratory."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        prog='python benchmarks/detection',
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        'parts', nargs='*', metavar='PART', help=f'of {", ".join(PARTS | OUTSIDE)}'
    )
    parser.add_argument('--quick', action='store_true', help='few cases: a smoke test')
    parser.add_argument('--scenarios', nargs='+', default=sorted(NOISES), choices=sorted(NOISES))
    parser.add_argument('--hours', type=float, metavar='H', help='of stable cutting (10.5)')
    parser.add_argument('--onsets', type=int, metavar='N', help='and events of a kind (240; 200)')
    add_executor(parser, 'a process a core')
    parser.add_argument('--plot', metavar='FILE', help='draw delay against false-alarm rate')
    parser.add_argument('--json', action='store_true', help='print JSON')
    options = parser.parse_args(arguments)
    every = PARTS | OUTSIDE
    options.folder = None
    if options.parts[:1] == ['recordings'] and len(options.parts) > 1:
        options.parts, options.folder = ['recordings'], Path(options.parts[1])
    unknown = [part for part in options.parts if part not in every]
    if unknown:
        parser.error(f'{unknown[0]} is no part: it must be one of {", ".join(every)}')
    begin = time.monotonic()
    found: dict[str, list[str]] = {}
    if options.cluster is None:
        options.workers = options.workers or os.cpu_count()
    with executor_of(options, Screen(json=options.json)) as options.executor:
        for part in options.parts or PARTS:
            found[part] = every[part](options)
            if not options.json:
                print('\n'.join(found[part]), flush=True)
    if options.json:
        print(json.dumps(found, indent=2))
    else:
        print(f'{this_machine()}; {time.monotonic() - begin:.0f} s')
    return 0


if __name__ == '__main__':
    sys.exit(main())
