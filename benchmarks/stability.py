"""The figures of the stability core on this machine: times, errors and how often advice holds.

    python benchmarks/stability.py [--repeats 7] [--machines 200] [--json]

Times are medians of several repeats, CPU time in one thread, so that a busy machine tells the
same as an idle one (`lathe-chatter bench stability` prints these alone). Errors are taken against
other ways to the same number: collocation with twice the nodes it needs, a constant speed, a
finer mesh.
"""

from __future__ import annotations

import os

# One thread: the figures are those of one core.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

import argparse
import json
import statistics
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from lathe_chatter import stability
from lathe_chatter.cli.bench import (
    DEPTHS,
    MACHINE,
    MANY_SPEEDS,
    SPEEDS,
    Figure,
    growth_map,
    stability_figures,
    this_machine,
    varied_cuts,
)

sys.path.append(str(Path(__file__).parents[1] / 'tests'))

from support.machines import random_machine
from support.reference import collocation


def import_time(repeats: int) -> float:
    """What importing the stability core costs beyond NumPy, s."""
    script = (
        'import time, numpy; start = time.process_time(); import lathe_chatter.stability; '
        'print(time.process_time() - start)'
    )
    durations = [
        float(subprocess.check_output([sys.executable, '-c', script]))  # noqa: S603 -- our own
        for _ in range(repeats)
    ]
    return statistics.median(durations)


def errors_of_roots() -> list[Figure]:
    """The growth map against collocation at another resolution, point by point."""
    found = growth_map()
    rng = np.random.default_rng(0)
    rows, columns = rng.integers(DEPTHS.size, size=200), rng.integers(SPEEDS.size, size=200)
    errors = []
    for row, column in zip(rows, columns, strict=True):
        expected = collocation.rightmost_root(MACHINE, SPEEDS[column], DEPTHS[row], seated=False)
        errors.append(abs(found[row, column].real - expected.real))
    return [
        Figure('largest error of 200 points of the map against collocation', max(errors), '1/s')
    ]


def errors_of_limits() -> list[Figure]:
    """How far the rightmost root at a critical depth is from the axis, and so the depth."""
    figures = []
    for seated in (False, True):
        depths = stability.critical_depths(MACHINE, MANY_SPEEDS, seated=seated)
        below, at, above = (
            stability.rightmost_roots(MACHINE, MANY_SPEEDS, share * depths, seated=seated).real
            for share in (1.0 - 1e-4, 1.0, 1.0 + 1e-4)
        )
        slope = (above - below) / (2e-4 * depths)
        name = 'on its bearing' if seated else 'open'
        figures.append(
            Figure(f'largest error of 300 critical depths, {name}', np.abs(at / slope).max(), 'm')
        )
    return figures


def advice(machines: int) -> list[Figure]:
    """Recommended speeds for machines that differ by 50 % from the paper's."""
    rng = np.random.default_rng(1)
    durations, possible, held = [], 0, 0
    scan = 60.0 / np.linspace(60.0 / 1000.0, 60.0 / 12000.0, 200)
    for _ in range(machines):
        machine, seated = random_machine(rng), bool(rng.integers(2))
        depth = 10 ** rng.uniform(-3.6, -2.3)
        start = time.process_time()
        advised = stability.recommend_speeds(machine, depth, seated=seated, current_rpm=3000.0)
        durations.append(time.process_time() - start)
        growth = stability.rightmost_roots(machine, scan, depth, seated=seated).real
        if growth.min() < 0.0 or advised.speeds:
            possible += 1
            rates = [
                stability.rightmost_root(machine, s.spindle_speed_rpm, depth, seated=seated).real
                for s in advised.speeds
            ]
            held += bool(rates) and max(rates) < 0.0
    return [
        Figure('recommended speeds, median', 1e3 * statistics.median(durations), 'ms'),
        Figure('recommended speeds, 95 %', 1e3 * float(np.percentile(durations, 95)), 'ms'),
        Figure(f'machines where a stable speed exists, of {machines}', possible, ''),
        Figure('of these, all recommended speeds are stable', 100.0 * held / possible, '%'),
    ]


def errors_of_variation() -> list[Figure]:
    """Floquet multipliers at a constant speed, and with twice the elements."""
    constant, refined = [], []
    for cut in varied_cuts():
        steady = cut.with_changes(speed_variation_amplitude=0.0)
        root = stability.rightmost_root(
            MACHINE, cut.spindle_speed_rpm, cut.depth_of_cut, seated=False
        )
        constant.append(
            abs(stability.floquet(MACHINE, steady, seated=False).growth_rate - root.real)
        )
        rates = [
            stability.floquet(MACHINE, cut, seated=False, refinement=k).growth_rate for k in (1, 2)
        ]
        refined.append(abs(rates[0] - rates[1]))
    return [
        Figure('error of speed variation at constant speed', max(constant), '1/s'),
        Figure('its change with twice the elements', max(refined), '1/s'),
    ]


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('--repeats', type=int, default=7, help='of every timed call (default 7)')
    parser.add_argument('--machines', type=int, default=200, help='random machines (default 200)')
    parser.add_argument('--json', action='store_true', help='print JSON instead of a table')
    options = parser.parse_args(arguments)
    if options.repeats < 1 or options.machines < 1:
        parser.error('--repeats and --machines must be at least 1')
    imported = import_time(min(options.repeats, 5))
    figures = [
        Figure('import of lathe_chatter.stability beyond NumPy', 1e3 * imported, 'ms'),
        *stability_figures(options.repeats),
        *errors_of_roots(),
        *errors_of_limits(),
        *advice(options.machines),
        *errors_of_variation(),
    ]
    if options.json:
        print(json.dumps([asdict(figure) for figure in figures], indent=2))
        return 0
    print(this_machine())
    width = max(len(figure.name) for figure in figures)
    for figure in figures:
        print(f'{figure.name:<{width}}  {figure.value:>10.4g} {figure.unit}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
