"""What the operator's page costs, and how quick it is, on this machine.

    python benchmarks/page [--seconds 30] [--pairs 5] [--minutes 60] [--simulated 3600] [PART ...]
    python benchmarks/page --output docs pictures

Parts: bare feed disk files slider lateness memory recorded lines; `bare` is the least that a
browser takes for two plots, beside which that of the page in `feed` stands, and `disk` what the
run takes that is recorded meanwhile. Real nodes over real DDS, a real Chromium without a window;
processor time from the kernel's accounts. `pictures` takes those of the docs.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')

sys.path.append(str(Path(__file__).resolve().parents[2] / 'tests'))
sys.path.append(str(Path(__file__).resolve().parents[1] / 'nodes'))

import bare
import domain_coordinator
import files
import live
import pictures
import rclpy
import recorded

from lathe_chatter.cli.bench import this_machine

PARTS: dict[str, Callable[[Any], Iterator[str]]] = {
    'bare': lambda options: bare.bare(options.seconds),
    'feed': lambda options: live.feed(options.seconds),
    'disk': lambda options: live.disk(options.seconds),
    'files': lambda _options: files.sizes(),
    'slider': lambda _options: live.slider(),
    'lateness': lambda options: live.lateness(options.seconds, options.pairs),
    'memory': lambda options: live.memory(options.minutes),
    'recorded': lambda options: recorded.opened(options.simulated),
    'lines': lambda _options: files.lines(),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure what was asked for."""
    known = {**PARTS, 'pictures': lambda options: pictures.take(Path(options.output))}
    parser = argparse.ArgumentParser(
        prog='python benchmarks/page',
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('parts', nargs='*', metavar='PART', help=f'of {", ".join(known)}')
    parser.add_argument('--seconds', type=float, default=30.0, help='of each measurement')
    parser.add_argument('--pairs', type=int, default=5, help='of lateness with and without')
    parser.add_argument('--minutes', type=float, default=60.0, help='of watching')
    parser.add_argument('--simulated', type=float, default=3600.0, help='s of the recorded run')
    parser.add_argument('--output', default='docs', metavar='FOLDER', help='of the pictures')
    options = parser.parse_args(arguments)
    unknown = [part for part in options.parts if part not in known]
    if unknown:
        parser.error(f'{unknown[0]} is no part: it must be one of {", ".join(known)}')
    with domain_coordinator.domain_id() as domain:
        os.environ['ROS_DOMAIN_ID'] = str(domain)
        rclpy.init()
        print(f'{this_machine()}, {rclpy.get_rmw_implementation_identifier()}')
        for part in options.parts or PARTS:
            for line in known[part](options):
                print(line, flush=True)
        rclpy.try_shutdown()
    return 0


if __name__ == '__main__':
    sys.exit(main())
