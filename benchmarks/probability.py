"""The chart of probability: what it costs, and whether 95 % means 95 %.

    python benchmarks/probability.py [--machines 400] [--taps 0]

Of cuts at the depth that is said to be safe with 95 %, each on a machine drawn from the same
errors (with other random numbers than those of the chart), the share is counted that a time
simulation finds to be stable; of ten times as many, the share that has its limit beyond. With
`--taps` the whole way is counted: a tool is identified from so many noisy tap tests, and each
time the chart of what was found says a depth for the one true machine.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path

os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
import numpy as np
from numpy.typing import NDArray

sys.path.append(str(Path(__file__).parents[1] / 'tests'))
from support.tap_tests import THREE_MODES, tap_test

from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import BearingContact, Cut, Machine, Mode
from lathe_chatter.model.machine_file import load_machine
from lathe_chatter.model.uncertainty import Uncertainty, uncertainty_from
from lathe_chatter.stability import critical_depth, critical_depths
from lathe_chatter.stability.probability import stability_probability
from lathe_chatter.tap_test import fit_modes

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
    parser.add_argument('--taps', type=int, default=0)
    options = parser.parse_args()
    machines, taps = options.machines, options.taps
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
        tell(f'{name}: said to be stable with 95 %, by simulation', stable)
        truths, _ = known.draw(described.machine, 10 * machines, seed=815)
        places = rng.integers(0, len(speeds), len(truths))
        limits = [
            critical_depth(truth, float(speeds[k]), seated=False)
            for truth, k in zip(truths, places, strict=True)
        ]
        tell(f'{name}: the same by the limit of each', np.array(limits) > depths[places])
    if taps:
        identified(taps)


def tell(what: str, stable: Sequence[float] | NDArray[np.bool_]) -> None:
    """Print the mean of independent shares with its standard error."""
    share = float(np.mean(stable))
    error = float(np.std(stable)) / math.sqrt(len(stable))
    print(f'{what}: {share:.1%} +- {error:.1%} are (goal 93-97)', flush=True)


def identified(taps: int) -> None:
    """Whether the depth that identified machines say is safe with 95 % is so on the true one."""
    stiff = Mode(1e3, 1e4, 0.5)

    def machine_of(modes: Sequence[tuple[float, float, float]]) -> Machine:
        tool = [Mode(k / (2 * math.pi * f) ** 2, 2 * math.pi * f, zeta) for f, zeta, k in modes]
        return Machine(tool, stiff, 0.0, 1.5e9)

    speeds = np.array([600.0, 1100.0, 1900.0, 2600.0])
    cut = Cut(bearing_contact=BearingContact.NONE)
    true = critical_depths(machine_of(THREE_MODES), speeds, seated=False)
    stable = []
    for seed in range(taps):
        fit = fit_modes([tap_test(floor=0.05, seed=5000 + seed)])
        found = machine_of([(m.frequency, m.damping_ratio, m.stiffness) for m in fit.modes])
        known = Uncertainty().with_covariance('tool', len(fit.modes), fit.covariance)
        chart = stability_probability(found, known, cut, speeds, machines=400)
        stable.append(float(np.mean(true > chart.safe_depth(0.95))))
    tell(f'{taps} tap tests with noise of 5 %, charts at 4 speeds', stable)


if __name__ == '__main__':
    main()
