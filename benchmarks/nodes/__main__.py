"""The nodes' figures on this machine: CPU, lateness of the ticks, delay of a parameter.

    python benchmarks/nodes [--seconds 60] [cpu] [lateness] [parameter] [lathes]
    python benchmarks/nodes [--seconds 60] [requests] [factor]
    python benchmarks/nodes [--simulated 3600] hour
    python benchmarks/nodes [--repeats 200] repeats
    python benchmarks/nodes [--minutes 40] [--seed 1] chaos

Everything is measured from outside, on the real nodes over real DDS: CPU from the kernel's
accounts of the processes, lateness from the time at which DDS was handed each block of samples,
losses from the times in the payload. Lateness is counted from the earliest in a hundred ticks:
the tick after one that came late may be made up to half a period early, which is told too.
`hour`, `repeats` (of all node tests, two at a time beside a burner) and `chaos` (kills, stops,
floods and jumps of /clock at random, of all nodes and the cell; it ends with 1 if one crashed or
hung, said what was not so, or did not tell of a loss once) only run if asked for.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Sequence
from typing import Any

os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')

import domain_coordinator
import figures
import rclpy
from answers import measure_requests
from chaos import measure_chaos
from factor import measure_factor
from repeats import repeats

from lathe_chatter.cli.bench import this_machine
from lathe_chatter.precompile import precompile

FIGURES: dict[str, Callable[[Any], None]] = {
    'cpu': lambda options: figures.measure_cpu(options.seconds),
    'lateness': lambda options: figures.measure_lateness(options.seconds),
    'parameter': lambda _options: figures.measure_parameter(),
    'lathes': lambda options: figures.measure_lathes(options.seconds),
    'factor': lambda options: measure_factor(options.seconds / 6.0),
    'requests': lambda options: measure_requests(options.seconds / 6.0),
}
LONG: dict[str, Callable[[Any], None]] = {
    'hour': lambda options: figures.measure_hour(options.simulated),
    'repeats': lambda options: repeats(options.repeats),
    'chaos': lambda options: measure_chaos(options.minutes, options.seed),
}


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure what was asked for."""
    known = FIGURES | LONG
    parser = argparse.ArgumentParser(
        prog='python benchmarks/nodes',
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('--seconds', type=float, default=60.0, help='of each measurement')
    parser.add_argument('--simulated', type=float, default=3600.0, help='seconds of the hour')
    parser.add_argument('--repeats', type=int, default=200, help='of the node tests')
    parser.add_argument('--minutes', type=float, default=40.0, help='of the chaos')
    parser.add_argument('--seed', type=int, default=1, help='of the chaos')
    parser.add_argument('figures', nargs='*', help=', '.join(known), metavar='figure')
    options = parser.parse_args(arguments)
    unknown = set(options.figures) - set(known)
    if unknown:
        parser.error(f'no such figure: {", ".join(sorted(unknown))}')
    precompile()  # what is measured is not how long the machine compiles
    with domain_coordinator.domain_id() as domain:
        os.environ['ROS_DOMAIN_ID'] = str(domain)
        rclpy.init()
        print(f'{this_machine()}, {rclpy.get_rmw_implementation_identifier()}')
        for name in options.figures or FIGURES:
            known[name](options)
        rclpy.shutdown()


if __name__ == '__main__':
    main()
