"""The figures of the stability core on this machine: times, errors and how often advice holds.

    python benchmarks/stability.py [--repeats 7] [--machines 200] [--json]

Times are medians of several repeats, CPU time in one thread, so that a busy machine tells the
same as an idle one. Errors are taken against other ways to the
same number: collocation with twice the nodes it needs, a constant speed, a finer mesh.
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
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lathe_chatter import stability
from lathe_chatter.model import Cut, Machine

sys.path.append(str(Path(__file__).parents[1] / 'tests'))

from machines import random_machine
from reference import collocation

MACHINE = Machine()
SPEEDS = np.linspace(1000.0, 12000.0, 111)
DEPTHS = np.linspace(0.05e-3, 2e-3, 38)
MANY_SPEEDS = np.linspace(1000.0, 12000.0, 300)


@dataclass(frozen=True)
class Figure:
    """One line of the table."""

    name: str
    value: float
    unit: str


def median_time(work: Callable[[], Any], repeats: int) -> float:
    """Median duration of some calls after a first one, s."""
    work()
    durations = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        durations.append(time.process_time() - start)
    return statistics.median(durations)


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


def roots(repeats: int) -> list[Figure]:
    """The growth map and single roots, with their errors."""

    def growth_map() -> Any:
        return stability.rightmost_roots(MACHINE, SPEEDS, DEPTHS[:, None], seated=False)

    found = growth_map()
    rng = np.random.default_rng(0)
    rows, columns = rng.integers(DEPTHS.size, size=200), rng.integers(SPEEDS.size, size=200)
    errors = []
    for row, column in zip(rows, columns, strict=True):
        expected = collocation.rightmost_root(MACHINE, SPEEDS[column], DEPTHS[row], seated=False)
        errors.append(abs(found[row, column].real - expected.real))
    duration = median_time(growth_map, repeats)
    figures = [
        Figure('growth map 111 x 38, every point proven', duration, 's'),
        Figure('largest error of 200 of its points against collocation', max(errors), '1/s'),
    ]
    for rpm in (60.0, 300.0, 3000.0, 12000.0):
        spent = median_time(
            lambda rpm=rpm: stability.rightmost_root(MACHINE, rpm, 1e-3, seated=False), repeats
        )
        figures.append(Figure(f'rightmost root at {rpm:g} rev/min, proven', 1e3 * spent, 'ms'))
    return figures


def limits(repeats: int) -> list[Figure]:
    """Limits in closed form."""
    boundary = median_time(
        lambda: stability.lobe_boundary(MACHINE, seated=False, lobes=20, points=10_000), repeats
    )
    one = median_time(lambda: stability.critical_depth(MACHINE, 3000.0, seated=False), repeats)
    many = median_time(lambda: stability.safe_limit(MACHINE, Cut(), MANY_SPEEDS), repeats)
    depths = stability.critical_depths(MACHINE, MANY_SPEEDS, seated=True)
    growth = stability.rightmost_roots(MACHINE, MANY_SPEEDS, depths, seated=True).real
    return [
        Figure('lobe boundary, 200 000 points', 1e3 * boundary, 'ms'),
        Figure('critical depth at one speed', 1e3 * one, 'ms'),
        Figure('safe region at 300 speeds', 1e3 * many, 'ms'),
        Figure('largest growth rate at 300 critical depths', float(np.abs(growth).max()), '1/s'),
    ]


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


def variation(repeats: int) -> list[Figure]:
    """Floquet multipliers under sinusoidal speed variation."""
    figures, constant, refined = [], [], []
    for rpm, frequency in ((1000.0, 1.0), (3000.0, 5.0), (9000.0, 30.0)):
        steady = Cut(rpm, 1e-3, speed_variation_frequency=frequency)
        cut = steady.with_changes(speed_variation_amplitude=0.2)
        root = stability.rightmost_root(MACHINE, rpm, 1e-3, seated=False)
        rate = stability.floquet(MACHINE, steady, seated=False).growth_rate
        constant.append(abs(rate - root.real))
        rates = [
            stability.floquet(MACHINE, cut, seated=False, refinement=k).growth_rate for k in (1, 2)
        ]
        refined.append(abs(rates[0] - rates[1]))
        spent = median_time(lambda cut=cut: stability.floquet(MACHINE, cut, seated=False), repeats)
        figures.append(
            Figure(f'speed variation, {rpm:g} rev/min at {frequency:g} Hz', 1e3 * spent, 'ms')
        )
    return [
        *figures,
        Figure('its error at constant speed', max(constant), '1/s'),
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
        *roots(options.repeats),
        *limits(options.repeats),
        *advice(options.machines),
        *variation(options.repeats),
    ]
    if options.json:
        print(json.dumps([asdict(figure) for figure in figures], indent=2))
        return 0
    width = max(len(figure.name) for figure in figures)
    for figure in figures:
        print(f'{figure.name:<{width}}  {figure.value:>10.4g} {figure.unit}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
