"""From two tap tests to a chart, and a lathe of usual size by every verb.

    python benchmarks/machine.py [--nodes]

The first part writes two universal files and calls the two commands of the README. The second
has a lathe (tool 2 kg, 300 Hz, 3 %; workpiece 20 kg, 120 Hz, 3 %; C 1500 MPa; 0.2 mm/rev; its
spindle 60 to 3000 rev/min) cut deeper than it can, by `simulate`, with `--nodes` by `run` too, and
compares what the monitor and the report say with the characteristic roots.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).parents[1] / 'tests'))
from support.tap_tests import tap_test

from lathe_chatter.model.machine_file import load_machine
from lathe_chatter.stability import critical_depth, rightmost_root

TOOL = ((310.0, 0.03, 7.6e6), (820.0, 0.025, 4.5e7))
SHAFT = ((120.0, 0.03, 1.14e7), (480.0, 0.02, 6e7))
MACHINE = """
tool: {modes: [{frequency: 300 Hz, damping_ratio: 3 %, mass: 2 kg}]}
workpiece: {modes: [{frequency: 120 Hz, damping_ratio: 3 %, mass: 20 kg}]}
material: {cutting_coefficient: 1500 MPa, errors: {cutting_coefficient: 15 %}}
spindle: {slowest_speed: 60 rpm, fastest_speed: 3000 rpm, acceleration: 500 rpm/s}
cut: {spindle_speed: 1000 rpm, depth_of_cut: 0.2 mm, feed: 0.2 mm/rev}
"""
DEPTH = 3.2e-4
SCENARIO = f"""
duration: 12
parameters: {{machine: lathe.yaml}}
steps:
  - at: 2.0
    set: {{depth_of_cut: {DEPTH}}}
  - when: flagged
    after: 1.0
    set: {{spindle_speed_rpm: recommended}}
expect: {{flagged: true, cleared: true}}
"""


def call(folder: Path, *arguments: str) -> tuple[str, float, float]:
    """What a verb prints, and its time and processor time, s."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    begin = time.perf_counter()
    done = subprocess.run(  # noqa: S603 -- our own command
        [sys.executable, '-m', 'lathe_chatter.cli', *arguments],
        cwd=folder, capture_output=True, text=True, check=True,
    )  # fmt: skip
    spent = time.perf_counter() - begin
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return done.stdout, spent, cpu


def tap_tests_to_chart(folder: Path) -> None:
    """Two universal files, two commands."""
    import pyuff

    for name, modes in (('tool', TOOL), ('shaft', SHAFT)):
        test = tap_test(modes, floor=0.01, form='accelerance', seed=7)
        common = {'binary': 1, 'rsp_node': 1, 'ref_node': 1, 'rsp_dir': 3, 'ref_dir': 3,
                  'x': test.frequency, 'abscissa_spacing': 1, 'orddenom_spec_data_type': 13,
                  'ordinate_spec_data_type': 12}  # fmt: skip
        file = pyuff.UFF(str(folder / f'{name}.uff'))
        file.write_sets(pyuff.prepare_58(**common, func_type=4, data=test.response), 'add')
        file.write_sets(pyuff.prepare_58(**common, func_type=6, data=test.coherence), 'add')
    commands = (
        ('identify', 'tool=tool.uff', 'workpiece=shaft.uff', '--output', 'machine.yaml'),
        ('lobes', '--machine', 'machine.yaml', '--cutting-coefficient', '1500 MPa',
         '--uncertain', 'C=15%', '--to', '4000'),
    )  # fmt: skip
    walls, cpus = [], []
    for arguments in commands:
        said, wall, cpu = call(folder, *arguments)
        walls.append(wall)
        cpus.append(cpu)
        print(said)
    shown = ' + '.join(f'{wall:.1f}' for wall in walls)
    print(f'two universal files to lobes.png: {shown} = {sum(walls):.1f} s (goal 10), '
          f'CPU {sum(cpus):.1f} s\n')  # fmt: skip


def check(verb: str, said: dict[str, Any]) -> None:
    """Print what the monitor said against the roots."""
    described = load_machine(MACHINE)
    machine = described.machine
    flagged = next(o for o in said['occurrences'] if o['what'] == 'chatter flagged')
    truth = rightmost_root(machine, 1000.0, DEPTH, seated=False)
    frequency = truth.imag / (2.0 * math.pi)
    advice = [o['what'] for o in said['occurrences'] if o['what'].startswith('advice')]
    speed = float(advice[0].split()[1])
    at = rightmost_root(machine, speed, DEPTH, seated=False).real
    inside = described.slowest_speed <= speed <= described.fastest_speed
    chatter = next(m for m in said['moments'] if m['title'] == 'chatter')

    def beside(value: float, true: float) -> str:
        return f'{value:.3f} ({value / true - 1.0:+.3%})'

    print(
        f'{verb}: flagged at {flagged["time"]:.2f} s:\n'
        f'  frequency / Hz {beside(flagged["frequency"], frequency)} (goal 0.5 %), in the '
        f'spectrum of the report {beside(chatter["frequency"], frequency)}\n'
        f'  growth rate / (1/s) {beside(flagged["growth_rate"], truth.real)} (goal 10 %)\n'
        f'  advice {speed:g} rev/min, root there {at:+.1f} 1/s: '
        f'{"inside" if inside else "OUTSIDE"} the spindle, {"" if at < 0 else "NOT "}stable'
    )


def main() -> None:
    """See above."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--nodes', action='store_true', help='play the scenario with nodes too')
    nodes = parser.parse_args().nodes
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        tap_tests_to_chart(folder)
        (folder / 'lathe.yaml').write_text(MACHINE)
        (folder / 'cut.yaml').write_text(SCENARIO)
        scenario = ('--scenario', 'cut.yaml', '--json', '--output')
        check('simulate', json.loads(call(folder, 'simulate', '--report', *scenario, 'a')[0]))
        if nodes:
            check('run', json.loads(call(folder, 'run', *scenario, 'b')[0]))
        lobes = json.loads(
            call(folder, 'lobes', '--machine', 'lathe.yaml', '--json', '--force')[0]
        )
        machine = load_machine(MACHINE).machine
        worst = max(
            abs(depth / critical_depth(machine, speed, seated=False) - 1.0)
            for speed, depth in list(
                zip(lobes['spindle_speed_rpm'], lobes['open_limit'], strict=True)
            )[::50]
        )
        print(f'lobes: limits of the chart against single ones: within {worst:.1e}')
        said = call(folder, 'knock-map', '--machine', 'lathe.yaml', '--speeds', '900:1100:3',
                    '--depths', '0.2 mm:0.32 mm:4', '--json')  # fmt: skip
        points = json.loads(said[0])
        right = sum(
            (point['margin'] == 'unstable')
            == (point['depth_of_cut']
                >= critical_depth(machine, point['spindle_speed_rpm'], seated=False))
            for point in points
        )  # fmt: skip
        print(f'knock-map: {right} of {len(points)} points as the limit says')


if __name__ == '__main__':
    main()
