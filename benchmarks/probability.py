"""The chart of probability: what it costs, and whether 95 % means 95 %.

    python benchmarks/probability.py [--machines 400]

Of cuts at the depth that is said to be safe with 95 %, each on a machine drawn from the same
errors (with other random numbers than those of the chart), the share is counted that a time
simulation finds to be stable.
"""

from __future__ import annotations

import argparse
import math
import os
import time

os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
import numpy as np

from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import BearingContact, Cut, Machine
from lathe_chatter.model.machine_file import load_machine
from lathe_chatter.model.uncertainty import uncertainty_from
from lathe_chatter.stability.probability import stability_probability

ERRORS = 'frequency=2%,damping=20%,stiffness=5%,C=15%'
TURNS = 120


def grows(machine: Machine, speed: float, depth: float) -> bool:
    """Whether a small disturbance is larger in the last third of a simulation than in the second.

    The linear force, without bearing clearance: it never saturates.
    """
    cut = Cut(spindle_speed_rpm=speed, depth_of_cut=depth, bearing_contact=BearingContact.NONE)
    highest = max(m.natural_frequency for m in (*machine.tool.modes, *machine.workpiece.modes))
    rate = max(40.0 * highest / (2.0 * math.pi), 2e3)
    lathe = VirtualLathe(machine, cut, sample_rate=rate, tool_leaves_cut=False)
    samples = lathe.advance(int(TURNS * 60.0 / speed * rate))
    relative = samples[:, 2] - samples[:, 4]
    third = len(relative) // 3
    return float(np.std(relative[2 * third :])) > float(np.std(relative[third : 2 * third]))


def main() -> None:
    """See above."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--machines', type=int, default=400)
    machines = parser.parse_args().machines
    for name in ('paper', 'chucked_shaft'):
        described = load_machine(name)
        known = uncertainty_from(ERRORS, described.machine)
        cut = described.cut.with_changes(bearing_contact=BearingContact.NONE)
        speeds = np.linspace(1000.0, 4000.0, 200)
        stability_probability(described.machine, known, cut, speeds[:9], machines=5)
        spent = []
        for _ in range(3):
            begin = time.process_time()
            chart = stability_probability(described.machine, known, cut, speeds)
            spent.append(time.process_time() - begin)
        print(f'{name}: 1000 machines x 200 speeds, CPU {np.median(spent):.2f} s (goal 3)')
        rng = np.random.default_rng(2)
        truths, _ = known.draw(described.machine, machines, seed=4711)
        depths = chart.safe_depth(0.95)
        places = rng.integers(0, len(speeds), machines)
        stable = [
            not grows(truth, float(speeds[k]), float(depths[k]))
            for truth, k in zip(truths, places, strict=True)
        ]
        share = np.mean(stable)
        error = math.sqrt(share * (1.0 - share) / machines)
        print(f'{name}: said to be stable with 95 %: {share:.1%} +- {error:.1%} are (goal 93-97)')


if __name__ == '__main__':
    main()
