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
from collections.abc import Callable, Sequence
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
from lathe_chatter.model import Machine, Mode

sys.path.append(str(Path(__file__).parents[1] / 'tests'))

from support.machines import random_machine, random_structure
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


def structures(repeats: int) -> list[Figure]:
    """Machines with several modes, many machines at once, and textbook limits."""
    rng = np.random.default_rng(0)
    figures = []
    for modes in ((1, 1), (2, 2), (4, 4), (8, 8)):
        machines = np.array([random_structure(rng, *modes) for _ in range(1000)], object)
        for seated in (False, True):
            spent = _median(
                lambda machines=machines, seated=seated: stability.rightmost_roots(
                    machines, 3000.0, 7e-4, seated=seated
                ),
                repeats,
            )
            regime = 'on the bearing' if seated else 'open'
            name = f'rightmost root of each of 1000 machines with {modes[0]}+{modes[1]} modes'
            figures.append(Figure(f'{name}, {regime}', spent, 'ms each'))
    machines = np.array([random_machine(rng) for _ in range(1000)], object)[:, None]
    speeds = np.linspace(1000.0, 12000.0, 200)
    spent = _median(
        lambda: stability.critical_depths(machines, speeds, seated=False), min(repeats, 3)
    )
    figures.append(Figure('critical depths of 1000 machines at 200 speeds', spent, 's'))
    machine = random_structure(rng, 4, 4)
    for name, process in (('', stability.ProcessDamping()), (', process damping', FLANK)):
        spent = _median(
            lambda process=process: stability.rightmost_roots(
                machine, SPEEDS, DEPTHS[:, None], seated=False, process=process
            ),
            repeats,
        )
        figures.append(Figure(f'growth map 111 x 38 of 4+4 modes{name}', spent, 's'))
    return [*figures, *_textbook()]


FLANK = stability.ProcessDamping(1e3, 0.05)


def _textbook() -> list[Figure]:
    """Errors against 2 k zeta (1 + zeta) / K, for one mode and for one among rigid others."""
    mode, coefficient = Mode(2.0, 1885.0, 0.03), 1.5e9
    machine = Machine(
        mode, Mode(1e6, 1e6, 0.05), bearing_stiffness=1.0, cutting_coefficient=coefficient
    )
    zeta = mode.damping_ratio
    lowest = 2.0 * mode.stiffness * zeta * (1.0 + zeta) / coefficient
    ratio = np.sqrt(1.0 + 2.0 * zeta)
    angle = np.arctan2(-2.0 * zeta * ratio, 1.0 - ratio**2)
    phases = 2.0 * np.pi * np.arange(30) + 3.0 * np.pi + 2.0 * angle
    speeds = 60.0 * mode.natural_frequency * ratio / phases
    found = stability.critical_depths(machine, speeds, seated=False)
    error = float(np.abs(found / lowest - 1.0).max())
    return [Figure('relative error of the textbook limit of one mode, 30 lobes', error, '')]


def slow_variation() -> list[Figure]:
    """A slow spindle that swings slowly, also with a mode a hundred times stiffer."""
    figures = []
    for name, frequency in (('', 775.0), (', one mode a hundred times stiffer', 7750.0)):
        script = (
            'import resource, time; from lathe_chatter.model import *; '
            'from lathe_chatter.stability import floquet; '
            f'm = Machine(Mode(0.05, {frequency}, 0.05)); '
            'c = Cut(60.0, 1e-3, speed_variation_amplitude=0.2, speed_variation_frequency=0.05); '
            'floquet(Machine(), c.with_changes(spindle_speed_rpm=6000.0), seated=False); '
            'before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss; '
            'then = time.process_time(); floquet(m, c, seated=False); '
            'print(time.process_time() - then, '
            'resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)'
        )
        told = subprocess.check_output([sys.executable, '-c', script])  # noqa: S603 -- our own
        spent, memory = (float(word) for word in told.split())
        what = f'speed variation, 60 rev/min at 0.05 Hz{name}'
        figures += [Figure(what, spent, 's'), Figure(f'... its memory{name}', memory / 1e3, 'MB')]
    return figures


def _median(work: Callable[[], object], repeats: int) -> float:
    """CPU time, s, once everything is loaded."""
    work()
    spent = []
    for _ in range(repeats):
        then = time.process_time()
        work()
        spent.append(time.process_time() - then)
    return statistics.median(spent)


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
        *structures(options.repeats),
        *slow_variation(),
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
