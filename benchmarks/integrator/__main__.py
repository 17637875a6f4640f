"""The integrator's figures on this machine, beside jitcdde and SciPy's DOP853.

    python benchmarks/integrator [PART ...] [--long] [--json]

The parts are accuracy, speed, peers, startup, sweep and memory: all by default, about two
minutes. --long takes the 10^9 steps of the memory part, which are some minutes more. CPU time is
what a busy machine leaves comparable; the clock's time stands beside it.
"""

from __future__ import annotations

import os

# One thread: the figures are those of one core.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict

import figures
from accuracy import accuracy
from many import many
from memory import cut, memory
from peers import peers
from speed import speed
from startup import startup

from lathe_chatter.cli.bench import this_machine


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('parts', nargs='*', metavar='part')
    parser.add_argument('--long', action='store_true', help='memory after 10^9 steps')
    parser.add_argument('--json', action='store_true', help='print the figures as JSON')
    parser.add_argument('--cut', nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.cut:
        name, samples = options.cut
        cut(name, int(samples))
        return
    parts: dict[str, Callable[[], list[figures.Line]]] = {
        'accuracy': accuracy,
        'speed': speed,
        'peers': peers,
        'startup': startup,
        'sweep': many,
        'memory': lambda: memory(10**9 if options.long else 10**7),
    }
    unknown = set(options.parts) - set(parts)
    if unknown:
        parser.error(f'no such part: {", ".join(sorted(unknown))}; there are {", ".join(parts)}')
    machine = this_machine()
    if not options.json:
        print(machine)
    found = {}
    for name in options.parts or parts:
        lines = parts[name]()
        found[name] = [asdict(line) for line in lines]
        if not options.json:
            figures.show(name, lines)
    if options.json:
        json.dump({'machine': machine, 'figures': found}, sys.stdout, indent=2)
        print()


if __name__ == '__main__':
    main()
