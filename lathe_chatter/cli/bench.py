"""`lathe-chatter bench`: the performance figures of the package on this machine.

These need nothing but the package. What needs more (other solvers to compare with, a graph of
nodes, a disk to fill) is in the scripts of benchmarks/ in the source tree, which use these too.
"""

from __future__ import annotations

import os
import platform
import statistics
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from lathe_chatter import stability
from lathe_chatter.cli.common_options import add_json
from lathe_chatter.cli.console import Screen
from lathe_chatter.code_identity import processor_name
from lathe_chatter.detection import ChatterDetector
from lathe_chatter.errors import ParameterError
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import BearingContact, Cut, Machine
from lathe_chatter.samples import SAMPLE_COLUMNS

EXAMPLE = 'lathe-chatter bench lathe stability'

_MOST = 1000
_RATE = 1e4
_BLOCK = 10_000
_TICK = 20
"""Samples of a tick of the node: 500 Hz at 10 kHz."""
MACHINE = Machine()
SPEEDS = np.linspace(1000.0, 12000.0, 111)
DEPTHS = np.linspace(0.05e-3, 2e-3, 38)
MANY_SPEEDS = np.linspace(1000.0, 12000.0, 300)
_VARIED = ((1000.0, 1.0), (3000.0, 5.0), (9000.0, 30.0))
"""Speeds, rev/min, and frequencies at which they are varied, Hz."""


@dataclass(frozen=True)
class Figure:
    """A line of the table.

    Attributes:
        name: What was measured.
        value: In `unit`.
        unit: Empty for a pure number.
    """

    name: str
    value: float
    unit: str = ''


def median_time(work: Callable[[], Any], repeats: int) -> float:
    """Median duration of some calls after a first one, s.

    CPU time, so that a busy machine tells the same as an idle one.
    """
    work()
    durations = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        durations.append(time.process_time() - start)
    return statistics.median(durations)


def this_machine() -> str:
    """The machine in one line: processor, cores, system, Python and how busy it is."""
    return (
        f'{processor_name()}, {os.cpu_count()} cores, {platform.system()} {platform.release()}, '
        f'Python {platform.python_version()}, load average {os.getloadavg()[0]:.1f}'
    )


def configure(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        'topics', nargs='*', metavar='TOPIC', help='lathe, detector or stability (default: all)'
    )
    parser.add_argument(
        '--repeats', type=int, default=7, metavar='N', help='of each call (default: %(default)s)'
    )
    add_json(parser)


def run(options: Namespace) -> int:
    """Measure and print."""
    unknown = next((topic for topic in options.topics if topic not in TOPICS), None)
    if unknown is not None:
        raise ParameterError('TOPIC', unknown, '', f'one of {", ".join(TOPICS)}')
    if not 1 <= options.repeats <= _MOST:
        raise ParameterError('--repeats', options.repeats, '', f'from 1 to {_MOST}')
    screen = Screen(json=options.json)
    screen.compile()
    topics = options.topics or list(TOPICS)
    found: dict[str, list[Figure]] = {}
    with screen.progress('measuring', len(topics)) as bar:
        for topic in topics:
            found[topic] = TOPICS[topic](options.repeats)
            bar.advance()
    rows = [
        (f'{topic}: {figure.name}', f'{figure.value:.4g}', figure.unit)
        for topic, figures in found.items()
        for figure in figures
    ]
    screen.table({'figure': 'text', 'median': 'right', 'unit': 'left'}, rows, this_machine())
    screen.say('CPU time in one thread. The scripts of benchmarks/ in the source measure more.')
    screen.json({'machine': this_machine(), 'figures': found})
    return 0


def lathe_figures(repeats: int) -> list[Figure]:
    """A quiet cut, chatter with contacts, the linear force, and a tick of the node."""
    cuts = {
        'a stable cut': (Cut(), True),
        'chatter with contacts': (Cut(depth_of_cut=1e-3), True),
        "the paper's linear cut": (Cut(bearing_contact=BearingContact.NONE), False),
    }
    figures = []
    for name, (cut, total) in cuts.items():
        lathe = VirtualLathe(cut=cut, tool_leaves_cut=total, sample_rate=_RATE)
        lathe.advance(2 * _BLOCK)
        spent = median_time(partial(lathe.advance, _BLOCK), repeats)
        figures += [
            Figure(f'{name}, 1 s at 10 kHz', 1e3 * spent, 'ms'),
            Figure(f'{name}, faster than real time', 1.0 / spent, 'times'),
        ]
    lathe = VirtualLathe(cut=Cut(depth_of_cut=1e-3))
    lathe.advance(2 * _BLOCK)

    def ticks() -> None:
        for _ in range(1000):
            lathe.advance(_TICK)

    figures.append(Figure('a tick of 20 samples', 1e3 * median_time(ticks, repeats), 'us'))
    return figures


def detector_figures(repeats: int) -> list[Figure]:
    """What the monitor's detector costs, tick by tick."""
    samples = VirtualLathe(cut=Cut(depth_of_cut=1e-3)).advance(_BLOCK)

    def watch() -> None:
        detector = ChatterDetector()
        for start in range(0, _BLOCK, _TICK):
            detector.update(samples[start : start + _TICK], SAMPLE_COLUMNS)

    spent = median_time(watch, max(repeats // 2, 1))
    return [
        Figure('watching 1 s at 10 kHz, in ticks of 20', 1e3 * spent, 'ms'),
        Figure('of one core while in real time', 100.0 * spent, '%'),
    ]


def growth_map() -> Any:
    """The roots of the map of the table: 111 speeds by 38 depths."""
    return stability.rightmost_roots(MACHINE, SPEEDS, DEPTHS[:, None], seated=False)


def varied_cuts() -> list[Cut]:
    """Cuts whose speed swings by 20 %."""
    return [
        Cut(rpm, 1e-3, speed_variation_amplitude=0.2, speed_variation_frequency=frequency)
        for rpm, frequency in _VARIED
    ]


def stability_figures(repeats: int) -> list[Figure]:
    """Times of everything that the stability core computes."""
    figures = [
        Figure('growth map 111 x 38, every point proven', median_time(growth_map, repeats), 's')
    ]

    def timed(name: str, work: Any) -> None:
        figures.append(Figure(name, 1e3 * median_time(work, repeats), 'ms'))

    for rpm in (60.0, 300.0, 3000.0, 12000.0):
        timed(
            f'rightmost root at {rpm:g} rev/min, proven',
            lambda rpm=rpm: stability.rightmost_root(MACHINE, rpm, 1e-3, seated=False),
        )
    timed(
        'lobe boundary, 200 000 points',
        lambda: stability.lobe_boundary(MACHINE, seated=False, lobes=20, points=10_000),
    )
    timed(
        'critical depth at one speed',
        lambda: stability.critical_depth(MACHINE, 3000.0, seated=False),
    )
    timed('safe region at 300 speeds', lambda: stability.safe_limit(MACHINE, Cut(), MANY_SPEEDS))
    for cut in varied_cuts():
        timed(
            f'speed variation, {cut.spindle_speed_rpm:g} rev/min at '
            f'{cut.speed_variation_frequency:g} Hz',
            lambda cut=cut: stability.floquet(MACHINE, cut, seated=False),
        )
    return figures


TOPICS: Mapping[str, Callable[[int], list[Figure]]] = {
    'lathe': lathe_figures,
    'detector': detector_figures,
    'stability': stability_figures,
}
"""By name, what measures with a number of repeats."""
