"""The recording's figures on this machine, and what faults cost.

    python benchmarks/recording [writing] [reading] [report] [kills] [programs] [power] [disk]
                                [flips] [truncation] [stalls] [pace] [--kills 50] [--cuts 10]
                                [--flips 200] [--truncations 50] [--seconds 60] [--factor 30]
                                [--simulated 3600]

All parts by default, about eight minutes; --flips 2000 --truncations 500 are ten more, and
--seconds 600 has the recorder stand still 0.3 s in every
second for ten minutes. Everything is written to and read from the folder for temporary files.
`power` and `disk` mount small disks, which root can.
"""

from __future__ import annotations

import argparse
import os
import platform
from collections.abc import Callable, Sequence

from damage import flips, truncation
from endings import disk, kills, power, record_for_ever
from pace import pace
from programs import programs
from speed import read_here, reading, report, writing
from stalls import stalls


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--kills', type=int, default=50, help='how many')
    parser.add_argument('--cuts', type=int, default=10, help='of the power')
    parser.add_argument('--flips', type=int, default=200, help='how many bits')
    parser.add_argument('--truncations', type=int, default=50, help='how many ends')
    parser.add_argument('--seconds', type=float, default=60.0, help='of the stalls')
    parser.add_argument('--factor', type=float, default=30.0, help='of real time')
    parser.add_argument('--simulated', type=float, default=3600.0, help='s of the report')
    parser.add_argument('--record', help=argparse.SUPPRESS)
    parser.add_argument('--read', nargs=2, help=argparse.SUPPRESS)
    parser.add_argument('parts', nargs='*', metavar='part')
    options = parser.parse_args(arguments)
    if options.record:
        record_for_ever(options.record)
        return
    if options.read:
        read_here(*options.read)
        return
    parts: dict[str, Callable[[], None]] = {
        'writing': writing,
        'reading': reading,
        'report': lambda: report(options.simulated),
        'kills': lambda: kills(options.kills),
        'programs': lambda: programs(options.kills),
        'power': lambda: power(options.cuts),
        'disk': disk,
        'flips': lambda: flips(options.flips),
        'truncation': lambda: truncation(options.truncations),
        'stalls': lambda: stalls(options.seconds),
        'pace': lambda: pace(options.factor, options.seconds / 4.0),
    }
    unknown = set(options.parts) - set(parts)
    if unknown:
        parser.error(f'no such part: {", ".join(sorted(unknown))}; there are {", ".join(parts)}')
    print(f'{os.cpu_count()} cores, {platform.release()}, Python {platform.python_version()}')
    for name in options.parts or parts:
        parts[name]()


if __name__ == '__main__':
    main()
