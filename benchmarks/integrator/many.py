"""What a step of one lathe costs where many are cut in one call, and what two cores are worth."""

from __future__ import annotations

import os
import time
from concurrent.futures import ThreadPoolExecutor
from statistics import median

import numpy as np
from figures import Figure, Line, tracked
from numba import njit

from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.lathe.many_lathes import LatheSweep
from lathe_chatter.model import Cut

_LATHES = 48
_SAMPLES = 100_000
_REPEATS = 9


def _mix() -> list[VirtualLathe]:
    """As a training set has them: any speed, a third in chatter, all with noise."""
    rng = np.random.default_rng(1)
    depths = np.where(np.arange(_LATHES) % 3 == 0, 1.1e-3, 0.4e-3)
    cuts = [
        Cut(speed, depth, force_noise=0.01, sensor_noise=1e-7)
        for speed, depth in zip(rng.uniform(2000.0, 6000.0, _LATHES), depths, strict=True)
    ]
    return [VirtualLathe(cut=cut, seed=seed) for seed, cut in enumerate(cuts)]


def many() -> list[Line]:
    """Nanoseconds of a core for a step of a lathe, and how much faster all cores are."""
    cores = len(os.sched_getaffinity(0))
    one, gains, plain = [], [], []
    _arithmetic(1)
    for _ in tracked(range(_REPEATS), 'sweeps'):
        one.append(_seconds(1))
        gains.append(one[-1] / _seconds(cores))
        plain.append(_seconds_of_arithmetic(1) / _seconds_of_arithmetic(cores))
    per_step = 1e9 / (_LATHES * _SAMPLES)
    goal = 1.8 if cores == 2 else None
    what = f'sweep of {_LATHES} noisy lathes, a third in chatter'
    return [
        Figure(f'{what}: one core, median', per_step * median(one), 'ns'),
        Figure(
            f'{what}: {cores} cores are faster, median',
            median(gains),
            'times',
            goal,
            at_least=True,
        ),
        Figure(f'{cores} cores are faster with plain arithmetic, median', median(plain), 'times'),
    ]


def _seconds(workers: int) -> float:
    """By the clock, of a new sweep that has settled."""
    sweep = LatheSweep(_mix())
    sweep.advance(_SAMPLES // 10)
    with ThreadPoolExecutor(workers) as pool:
        then = time.perf_counter()
        sweep.advance(_SAMPLES, columns=['tool_displacement'], executor=pool)
        return time.perf_counter() - then


def _seconds_of_arithmetic(workers: int) -> float:
    """By the clock, of as many tasks that need no memory: what the cores are worth just now."""
    with ThreadPoolExecutor(workers) as pool:
        then = time.perf_counter()
        list(pool.map(_arithmetic, [1_000_000] * _LATHES))
        return time.perf_counter() - then


@njit(nogil=True)  # type: ignore[untyped-decorator]  # Numba has no types
def _arithmetic(steps: int) -> float:
    value = 0.1
    for step in range(steps):
        value = 0.999 * value + 0.001 * (step & 3)
    return value
