"""What the detector is judged on: onsets, stable cutting, and what only looks like chatter."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from simulator import Stretch, Surroundings

from lathe_chatter.model import Machine
from lathe_chatter.stability import critical_depth

MACHINE = Machine()
STATES = tuple((rpm, seated) for rpm in (3000.0, 10000.0) for seated in (False, True))
NOISES = {
    'S0': Surroundings(force_noise=2e-14, sensor_noise=1e-9, chip=1e-4),
    'S1': Surroundings(force_noise=2e-7, sensor_noise=1e-7),
    'S2': Surroundings(force_noise=2e-10, sensor_noise=1e-6),
    'S3': Surroundings(force_noise=2e-7, sensor_noise=1e-7, chip=1e-4),
}
"""Force noise in N2 s, sensor noise in m, mean chip in m; unbalance and runout throughout."""
BEFORE, SETTLED = 6.0, 2.0
"""Stable cutting before an onset, and what of a recording is not counted, s."""
STEP = 2.0
"""Time between stable-to-stable steps, s."""


@dataclass(frozen=True)
class Case:
    """One recording.

    Attributes:
        kind: What is shown.
        seed: Of its random numbers.
        plan: What is cut.
        around: What disturbs it.
        onset: When the cut becomes unstable, s; None if it never does.
        events: When something happens that is no chatter, s.
        begin: From when on alarms count, s.
    """

    kind: str
    seed: int
    plan: tuple[Stretch, ...]
    around: Surroundings
    onset: float | None = None
    events: tuple[float, ...] = ()
    begin: float = SETTLED
    skipped: float = field(default=0.0)


def critical(rpm: float, *, seated: bool) -> float:
    """Critical depth of the machine, m."""
    return critical_depth(MACHINE, rpm, seated=seated)


def _around(noise: str, rng: np.random.Generator) -> tuple[Surroundings, float]:
    """Surroundings, and what is added to times of steps: in S0 they may fall anywhere in a hop."""
    if noise != 'S0':
        return NOISES[noise], 0.0
    runout = float(rng.uniform(0.0, 5e-6))
    return replace(NOISES[noise], tool_runout=runout), 1e-4 * int(rng.integers(100))


def onset(noise: str, seed: int) -> Case:
    """A step from at most 0.9 to at least 1.05 times the critical depth."""
    rng = np.random.default_rng((1, seed))
    rpm, seated = STATES[seed % 4]
    limit = critical(rpm, seated=seated)
    before, after = rng.uniform(0.3e-3, 0.9 * limit), rng.uniform(1.05 * limit, 1.2e-3)
    around, later = _around(noise, rng)
    plan = (Stretch(BEFORE + later, rpm, before, seated), Stretch(5.0, rpm, after, seated))
    return Case(f'onset {noise}', seed, plan, around, onset=BEFORE + later)


def stable(noise: str, seed: int, duration: float = 60.0) -> Case:
    """Nothing happens."""
    rng = np.random.default_rng((2, seed))
    rpm, seated = STATES[seed % 4]
    depth = rng.uniform(0.3e-3, 0.95 * critical(rpm, seated=seated))
    plan = (Stretch(duration, rpm, depth, seated),)
    return Case(f'stable {noise}', seed, plan, NOISES[noise])


def steps(noise: str, seed: int, count: int = 20) -> Case:
    """From one stable depth to another, again and again."""
    rng = np.random.default_rng((3, seed))
    rpm, seated = STATES[seed % 4]
    limit = 0.95 * critical(rpm, seated=seated)
    depths = rng.uniform(0.3e-3, limit, count + 2)
    around, later = _around(noise, rng)
    step = STEP + later
    plan = tuple(Stretch(step, rpm, float(depth), seated) for depth in depths)
    times = tuple(step * (1 + k) for k in range(1, count + 1))
    return Case(f'steps {noise}', seed, plan, around, events=times, begin=times[0])


def ramp(seed: int) -> Case:
    """The speed runs through the resonances of both, which an unbalance excites."""
    rng = np.random.default_rng((4, seed))
    seated = bool(seed % 2)
    depth = rng.uniform(0.3, 0.9) * (0.417e-3 if seated else 0.596e-3)
    slow, fast = rng.uniform(3000.0, 4500.0), rng.uniform(8500.0, 11000.0)
    time = 10 ** rng.uniform(-0.5, 0.5)
    plan = (
        Stretch(4.0, slow, depth, seated),
        Stretch(time, fast, depth, seated, ramp=time),
        Stretch(4.0, fast, depth, seated),
    )
    around = replace(NOISES['S1'], unbalance=0.3)
    return Case('speed ramp', seed, plan, around, events=(4.0,))


def forced(seed: int) -> Case:
    """A harmonic of the spindle meets a resonance."""
    rng = np.random.default_rng((5, seed))
    seated, number = bool(seed % 2), int(rng.integers(2, 5))
    stiffness = MACHINE.workpiece_stiffness(seated=seated)
    natural = np.sqrt(stiffness / MACHINE.workpiece.mass) / (2.0 * np.pi)
    rpm = 60.0 * natural / number * rng.uniform(0.97, 1.03)
    depth = rng.uniform(0.3e-3, 0.9 * min(critical(rpm, seated=seated), 1.2e-3))
    plan = (Stretch(8.0, rpm, depth, seated),)
    around = replace(NOISES['S1'], harmonic_force=((float(number), rng.uniform(0.2, 1.0)),))
    return Case('forced resonance', seed, plan, around, events=(SETTLED,))


def knocks(seed: int, count: int = 5) -> Case:
    """Impulses on the tool that die out."""
    rng = np.random.default_rng((6, seed))
    rpm, seated = STATES[seed % 4]
    depth = rng.uniform(0.3e-3, 0.9 * critical(rpm, seated=seated))
    sizes = 10 ** rng.uniform(-4.0, -2.5, count)
    plan = (
        Stretch(3.0, rpm, depth, seated),
        *(Stretch(2.0, rpm, depth, seated, knock=float(size)) for size in sizes),
    )
    times = tuple(3.0 + 2.0 * k for k in range(count))
    return Case('knocks', seed, plan, NOISES['S1'], events=times)


def contact(seed: int) -> Case:
    """The workpiece comes to rest on its bearing, and leaves it; stable both ways."""
    rng = np.random.default_rng((7, seed))
    rpm = STATES[seed % 4][0]
    depth = rng.uniform(0.2e-3, 0.85 * critical(rpm, seated=True))
    plan = tuple(Stretch(3.0, rpm, depth, bool(k % 2)) for k in range(5))
    times = tuple(3.0 * k for k in range(1, 5))
    return Case('contact changes', seed, plan, NOISES['S3'], events=times)


def saturated(seed: int) -> Case:
    """The monitor comes when the chatter has grown as far as it can."""
    rng = np.random.default_rng((8, seed))
    rpm, seated = STATES[seed % 4]
    limit = critical(rpm, seated=seated)
    depth = rng.uniform(1.3 * limit, 1.2e-3)
    around = replace(NOISES['S1'], chip=10 ** rng.uniform(-4.6, -4.0))
    plan = (Stretch(7.0, rpm, depth, seated),)
    return Case('limit cycle', seed, plan, around, onset=0.0, begin=0.0, skipped=4.0)
