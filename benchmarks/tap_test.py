"""What a tap test gives: errors, coverage and the number of modes, over many seeds.

    python benchmarks/tap_test.py [--seeds 200]

Three modes (118, 310, 845 Hz), five averages, noise of a single response 0.2 % and 1 % of the
peak. The seeds are not those with which anything was tuned (0 to 20).
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')  # small matrices: threads only get in the way
import numpy as np

sys.path.append(str(Path(__file__).parents[1] / 'tests'))
from support.tap_tests import THREE_MODES, tap_test

from lathe_chatter.tap_test import fit_modes

FIRST_SEED = 1000
NORMAL_90 = 1.6449


def one(
    task: tuple[int, float, str],
) -> tuple[int, list[list[float]], list[list[float]], float, bool]:
    """Number of modes, relative errors, errors in standard errors, processor time, s, warned."""
    seed, floor, form = task
    begin = time.process_time()
    fit = fit_modes([tap_test(floor=floor, form=form, seed=seed)])
    spent = time.process_time() - begin
    relative, scaled = [], []
    if len(fit.modes) == len(THREE_MODES):
        for mode, truth in zip(fit.modes, THREE_MODES, strict=True):
            found = np.array([mode.frequency, mode.damping_ratio, mode.stiffness])
            relative.append((np.abs(found - truth) / truth).tolist())
            scaled.append((np.abs(found - truth) / mode.errors).tolist())
    return len(fit.modes), relative, scaled, spent, bool(fit.warnings)


def main() -> None:
    """See above."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--seeds', type=int, default=200)
    seeds = parser.parse_args().seeds
    print(
        'form         noise   f / %    zeta / %  k / %    90 % interval holds       modes  CPU / s'
        '  warned of'
    )
    with ProcessPoolExecutor() as pool:
        for form in ('receptance', 'accelerance'):
            for floor in (0.002, 0.01):
                tasks = [(FIRST_SEED + k, floor, form) for k in range(seeds)]
                found = list(pool.map(one, tasks))
                relative = np.array([r for _, rows, *_ in found for r in rows])
                scaled = np.array([s for _, _, rows, *_ in found for s in rows])
                f, zeta, k = 100.0 * np.median(relative, axis=0)
                holds = ' '.join(f'{h:.1%}' for h in (scaled < NORMAL_90).mean(axis=0))
                right = np.mean([count == len(THREE_MODES) for count, *_ in found])
                cpu = np.median([spent for *_, spent, _ in found])
                print(
                    f'{form:12} {floor:5.1%}  {f:.5f}  {zeta:.4f}    {k:.4f}   f, zeta, k {holds}'
                    f'  {right:.1%}  {cpu:.2f}     {sum(told for *_, told in found)}',
                    flush=True,
                )


if __name__ == '__main__':
    main()
