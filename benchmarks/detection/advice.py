"""How often a speed that the detector recommends is stable: known states and random machines."""

from __future__ import annotations

import sys
from concurrent.futures import Executor
from pathlib import Path
from typing import NamedTuple

import numpy as np
from simulator import COLUMNS, Stretch, Surroundings, simulate

from lathe_chatter.detection import ChatterDetector
from lathe_chatter.detection.speed_advice import rule_of_thumb
from lathe_chatter.executors import spread
from lathe_chatter.model import Machine
from lathe_chatter.stability import critical_depth, rightmost_root, rightmost_roots

sys.path.append(str(Path(__file__).parents[2] / 'tests'))

from support.machines import random_machine

SLOW, FAST = 1000.0, 12000.0
_WAVES = range(1, 9)
_SCAN = 60.0 / np.linspace(60.0 / SLOW, 60.0 / FAST, 300)


class Trial(NamedTuple):
    """A cut that chatters, and what is known of it."""

    machine: Machine
    rpm: float
    depth: float
    seated: bool
    seed: int


class Outcome(NamedTuple):
    """What became of it."""

    flagged: bool
    possible: bool
    stable: bool
    advised: bool


def _trials(random: int) -> list[Trial]:
    """The 8 states (open or seated, two speeds, two depths), then random machines."""
    known = [
        Trial(Machine(), rpm, depth, seated, 0)
        for rpm in (3000.0, 10000.0)
        for seated in (False, True)
        for depth in (0.8e-3, 1.1e-3)
    ]
    rng = np.random.default_rng(9)
    for seed in range(random):
        machine, seated = random_machine(rng), bool(rng.integers(2))
        rpm = float(rng.uniform(2000.0, 11000.0))
        depth = critical_depth(machine, rpm, seated=seated) * rng.uniform(1.1, 1.8)
        known.append(Trial(machine, rpm, min(float(depth), 0.01), seated, seed + 1))
    return known


def judge(trial: Trial) -> Outcome:
    """Let it chatter, and try the speed that is recommended in the end."""
    machine, depth, seated = trial.machine, trial.depth, trial.seated
    around = Surroundings(force_noise=2e-7, sensor_noise=1e-7, chip=1e-4, machine=machine)
    limit = critical_depth(machine, trial.rpm, seated=seated)
    plan = (
        Stretch(2.0, trial.rpm, 0.5 * min(limit, depth), seated),
        Stretch(3.0, trial.rpm, depth, seated),
    )
    samples = simulate(plan, around, trial.seed)
    detector = ChatterDetector(machine, speed_range=(SLOW, FAST))
    speed, flagged = np.nan, False
    for start in range(0, len(samples), 100):
        estimate = detector.update(samples[start : start + 100], COLUMNS)
        if estimate.chatter and estimate.time > 2.0:
            flagged = True
            if np.isfinite(estimate.recommended_speed_rpm):
                speed = estimate.recommended_speed_rpm
    growth = rightmost_roots(machine, _SCAN, depth, seated=seated).real
    advised = bool(np.isfinite(speed))
    stable = advised and rightmost_root(machine, speed, depth, seated=seated).real < 0.0
    return Outcome(flagged, bool(growth.min() < 0.0), bool(stable), advised)


def _rule_figures(trials: list[Trial]) -> list[str]:
    """How often a speed of the rule of thumb is stable, the frequency known exactly."""
    held, tried = 0, 0
    by_waves = dict.fromkeys(_WAVES, 0)
    for machine, rpm, depth, seated, _ in trials:
        frequency = rightmost_root(machine, rpm, depth, seated=seated).imag / (2.0 * np.pi)
        for speed in rule_of_thumb(frequency, (SLOW, FAST)).speeds[:1]:
            tried += 1
            root = rightmost_root(machine, speed.spindle_speed_rpm, depth, seated=seated)
            held += root.real < 0.0
        for waves in _WAVES:
            root = rightmost_root(machine, 60.0 * frequency / waves, depth, seated=seated)
            by_waves[waves] += root.real < 0.0
    shares = ', '.join(f'{k}: {100.0 * n / len(trials):.0f} %' for k, n in by_waves.items())
    return [
        f'60 f/k, random machines: stable in {held} of {tried} = {100.0 * held / tried:.0f} %',
        f'60 f/k by k, the spindle as fast as need be: {shares}',
    ]


def advice_figures(random: int, executor: Executor) -> list[str]:
    """Both tables."""
    trials = _trials(random)
    outcomes = spread(judge, trials, executor=executor)
    lines = []
    for label, found in (
        ('8 machine states', outcomes[:8]),
        (f'{random} random machines', outcomes[8:]),
    ):
        flagged = [o for o in found if o.flagged]
        possible = [o for o in flagged if o.possible]
        held = sum(o.stable for o in possible)
        wrong = sum(o.advised and not o.stable for o in possible)
        share = 100.0 * held / max(len(possible), 1)
        lines.append(
            f'recommended speed, {label}: {len(flagged)} flagged, a stable speed exists for '
            f'{len(possible)}, recommended one is stable for {held} = {share:.1f} % '
            f'({wrong} unstable, {len(possible) - held - wrong} none found)'
        )
    return [*lines, *_rule_figures(trials[8:])]
