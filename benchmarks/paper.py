"""The figures of the reproduction and of the knocks: what holds, how exactly, how long it takes.

    python benchmarks/paper.py [runs] [reproduce] [safe] [knocks] [--json]

`runs` judges the 14 runs, `reproduce` times the whole command with every picture, `safe` holds
the safe region against time simulation, `knocks` looks for the knocks that cuts survive. Wall
times, in one call each: with other work on the machine they are longer.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from lathe_chatter.cli.bench import Figure, this_machine
from lathe_chatter.knocks import (
    KnockGrid,
    Margin,
    follow_knock,
    resting_state,
    run_knock_map,
    smallest_lasting_knock,
)
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.lathe.config import LatheConfig
from lathe_chatter.model import Cut, Machine
from lathe_chatter.paper import PAPER_RUNS, find, reproduce_run
from lathe_chatter.precompile import precompile
from lathe_chatter.stability import safe_limit

MACHINE = Machine()
PRINTED = {  # the table of established facts: bearing carries, rev/min, mm
    (False, 3000.0, 0.5): -8.999066 + 825.483211j,
    (False, 10000.0, 0.5): -7.240068 + 794.924220j,
    (False, 3000.0, 1.0): 13.652715 + 847.585268j,
    (False, 10000.0, 1.0): 21.598456 + 816.172885j,
    (True, 3000.0, 0.5): 1.708234 + 845.306344j,
    (True, 10000.0, 0.5): 4.349768 + 822.140171j,
    (True, 3000.0, 1.0): 19.182492 + 867.884034j,
    (True, 10000.0, 1.0): 28.772325 + 847.879127j,
}


def runs() -> list[Figure]:
    """Verdicts, roots and measured growth of the 14 runs."""
    start = time.perf_counter()
    results = [reproduce_run(run) for run in PAPER_RUNS]
    spent = time.perf_counter() - start
    away, missed = [], []
    for result in results:
        run = result.run
        printed = PRINTED[run.has_bearing, run.spindle_speed_rpm, 1e3 * run.depth_of_cut]
        away.append(max(abs((result.root - printed).real), abs((result.root - printed).imag)))
        missed.append(abs(result.measured.real - result.root.real))
    found = find()
    verdicts = {reading.contact.value: reading.verdicts for reading in found.screening}
    return [
        Figure('verdicts of the paper that agree, of 14', sum(r.agrees for r in results)),
        Figure('the same with equation (9) as printed', sum(r.literal_agrees for r in results)),
        Figure('the same with the bearing never touched', verdicts['none']),
        Figure('largest distance of a root from its printed digits', max(away), '1/s'),
        Figure('largest miss of a measured growth rate', max(missed), '1/s'),
        Figure('C from which all verdicts hold', found.coefficient.low, 'N/m2'),
        Figure('C up to which all verdicts hold', found.coefficient.high, 'N/m2'),
        Figure('all 14 runs, three ways each', spent, 's'),
    ]


def reproduce() -> list[Figure]:
    """The command with its page and all pictures."""
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        subprocess.run(  # noqa: S603 -- our own
            [sys.executable, '-m', 'lathe_chatter.cli', 'reproduce', '--output', folder],
            check=True,
            stdout=subprocess.DEVNULL,
        )
        spent = time.perf_counter() - start
        size = Path(folder, 'index.html').stat().st_size
        pictures = len(list(Path(folder).glob('*.png')))
    return [
        Figure('lathe-chatter reproduce, everything', spent, 's'),
        Figure('pictures, each as PNG and SVG', pictures),
        Figure('the page', size / 1e6, 'MB'),
    ]


def safe() -> list[Figure]:
    """Cuts 3 % below and above the edge of the safe region, disturbed by 1e-11 N s."""
    right, total = 0, 0
    for clearance in (2e-6, 3e-6, 5e-6, 8e-6, 20e-6):
        for rpm in np.linspace(1500.0, 11000.0, 39).tolist():
            cut = Cut(rpm, 1e-3, clearance)
            edge = min(float(safe_limit(MACHINE, cut).depth_of_cut), 0.0095)
            for share in (0.97, 1.03):
                here = cut.with_changes(depth_of_cut=share * edge)
                lathe = VirtualLathe(MACHINE, here, initial_state=resting_state(MACHINE, here))
                lathe.knock(1e-11)
                lathe.advance(8000)
                sizes = [float(np.ptp(lathe.advance(2000)[:, 3])) for _ in range(3)]
                right += (sizes[2] < sizes[0]) == (share < 1.0)
                total += 1
    return [
        Figure('cuts beside the edge of the safe region that were simulated', total),
        Figure('of these, as the chart says in the simulation', 100 * right / total, '%'),
    ]


def knocks() -> list[Figure]:
    """A threshold, what its search costs, and a small map on every core."""
    cut = Cut(3000.0, 0.65e-3, 10e-6)
    start = time.perf_counter()
    limit = smallest_lasting_knock(MACHINE, cut, tolerance=1e-3)
    one = time.perf_counter() - start
    outcome = follow_knock(MACHINE, cut, limit.impulse)
    speeds = tuple(np.linspace(2500.0, 4500.0, 11).tolist())
    depths = tuple(np.linspace(0.4e-3, 1.0e-3, 7).tolist())
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        found = run_knock_map(
            KnockGrid(LatheConfig(), speeds, depths, (5e-6,)), Path(folder, 'map.jsonl')
        )
        spent = time.perf_counter() - start
    limits = list(found.limits.values())
    return [
        Figure(
            'smallest lasting knock, 3000 rev/min, 0.65 mm, 10 um',
            1e3 * abs(limit.impulse),
            'mN s',
        ),
        Figure('largest below it that was seen to die out', 1e3 * limit.survived, 'mN s'),
        Figure('no knock below can leave the linear regime', 1e3 * limit.linear, 'mN s'),
        Figure('chatter that it ends in, tool, peak to peak', 1e6 * outcome.amplitude, 'um'),
        Figure('knocks simulated for it', limit.trials),
        Figure('time for it', one, 's'),
        Figure('a map of 11 x 7 cuts, clearance 5 um', spent, 's'),
        Figure('of them chatter unknocked', sum(k.margin is Margin.UNSTABLE for k in limits)),
        Figure('of them can be knocked so', sum(k.margin is Margin.FINITE for k in limits)),
    ]


PARTS: dict[str, Callable[[], list[Figure]]] = {
    'runs': runs,
    'reproduce': reproduce,
    'safe': safe,
    'knocks': knocks,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('parts', nargs='*', choices=[[], *PARTS], metavar='PART')
    parser.add_argument('--json', action='store_true', help='print JSON instead of a table')
    options = parser.parse_args(arguments)
    precompile()
    figures = [figure for part in options.parts or PARTS for figure in PARTS[part]()]
    if options.json:
        print(json.dumps([asdict(figure) for figure in figures], indent=2))
        return 0
    print(this_machine())
    width = max(len(figure.name) for figure in figures)
    for figure in figures:
        print(f'{figure.name:<{width}}  {figure.value:>12.7g} {figure.unit}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
