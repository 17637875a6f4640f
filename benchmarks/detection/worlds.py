"""Outside the laboratory: machines told wrong, machines of other sizes, other sensors, a start."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from delays import quantiles
from scenarios import MACHINE, NOISES, STATES
from simulator import ACCELERATIONS, COLUMNS, Stretch, Surroundings, simulate

from lathe_chatter.array_types import Array
from lathe_chatter.detection import ChatterDetector
from lathe_chatter.detection.estimate import Mode
from lathe_chatter.executors import spread
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import Cut, Machine
from lathe_chatter.model import Mode as Vibration
from lathe_chatter.stability import critical_depth, rightmost_root

_NODE = 0.02
"""s of samples at once, as the node gets them."""
_UNTUNED = 40_000
"""Where the seeds that are reported begin: nothing was tuned on them."""
_HERTZ_AFTER = 0.1
"""s after the flag at which its frequency is looked at."""


class World(NamedTuple):
    """A cut that becomes unstable, and what the detector is told and hears.

    Attributes:
        told: The machine that the detector is told.
        heard: `displacements`, `accelerations`, `one`, `sound`.
        around: What cuts and disturbs.
        rpm: Spindle speed, rev/min.
        stable: Depths of the stable cuts, m.
        lasting: How long each is cut, s.
        unstable: Depth of the last, m; 0 for none.
        seed: Of the noise.
    """

    told: Machine | None
    heard: str
    around: Surroundings
    rpm: float
    stable: tuple[float, ...]
    lasting: float
    unstable: float
    seed: int


class Found(NamedTuple):
    """What the detector made of a world.

    Attributes:
        delay: From the change to the flag, revolutions; inf where it is missed.
        false: Stable stretches in which the flag was raised.
        misfit: Whether it said, before the onset, that the machine does not fit.
        off: Error of the frequency 0.1 s after the flag, Hz.
    """

    delay: float
    false: int
    misfit: bool
    off: float


def hear(world: World) -> Found:
    """Cut and listen."""
    rate = world.around.rate
    begins = [0.0]
    plan = [Stretch(world.lasting, world.rpm, depth) for depth in world.stable]
    onset = world.lasting * len(plan)
    if world.unstable:
        plan.append(Stretch(5.0, world.rpm, world.unstable))
    samples = simulate(plan, world.around, world.seed, accelerations=True)
    table = dict(zip((*COLUMNS, *ACCELERATIONS), samples.T, strict=True))
    table['sound'] = table[ACCELERATIONS[0]] + 0.6 * table[ACCELERATIONS[1]]
    names = {
        'displacements': COLUMNS,
        'accelerations': (*COLUMNS[:2], *ACCELERATIONS),
        'one': (*COLUMNS[:2], ACCELERATIONS[0]),
        'sound': (*COLUMNS[:2], 'sound'),
    }[world.heard]
    block = np.column_stack([table[name] for name in names])
    detector, size = ChatterDetector(world.told), max(1, round(_NODE * rate))
    flagged, misfit, off = math.inf, False, math.nan
    false = np.zeros(len(world.stable), bool)
    begins = [world.lasting * k for k in range(len(world.stable))]
    for start in range(0, len(block), size):
        known = detector.update(block[start : start + size], names)
        if known.time <= onset:
            misfit |= known.mode in {Mode.MISFIT, Mode.CORRECTED}
            if known.chatter:
                false[np.searchsorted(begins, known.time) - 1] = True
        elif known.chatter and math.isinf(flagged):
            flagged = known.time
        if flagged + _HERTZ_AFTER < known.time and math.isnan(off) and world.unstable:
            off = known.frequency - _root(world).imag / (2.0 * math.pi)
    return Found((flagged - onset) * world.rpm / 60.0, int(false.sum()), misfit, off)


def _root(world: World) -> complex:
    return rightmost_root(world.around.machine, world.rpm, world.unstable, seated=False)


def _line(label: str, found: Sequence[Found], base: Sequence[Found] | None = None) -> str:
    delay = np.array([each.delay for each in found])
    half, most = quantiles(delay)
    steps = sum(each.false for each in found)
    text = f'  {label:34s} {half:6.1f} /{most:6.1f} rev, missed {int(np.isinf(delay).sum())}, '
    text += f'{steps} false, said not to fit {100.0 * np.mean([f.misfit for f in found]):3.0f} %, '
    text += f'{np.nanmedian(np.abs([f.off for f in found])):.2f} Hz off'
    if base is not None:
        other = quantiles(np.array([each.delay for each in base]))
        text += f'; {half / other[0]:.2f} / {most / other[1]:.2f} times the delay of none'
    return text


def _scaled(part: Any, *, mass: float = 1.0, frequency: float = 1.0, damping: float = 1.0) -> Any:
    return replace(
        part,
        mass=part.mass * mass,
        natural_frequency=part.natural_frequency * frequency,
        damping_ratio=part.damping_ratio * damping,
    )


def _told(**factors: float) -> Machine:
    return replace(
        MACHINE,
        tool=_scaled(MACHINE.tool, **factors),
        workpiece=_scaled(MACHINE.workpiece, **factors),
    )


def _paper_world(told: Machine | None, heard: str, seed: int, lasting: float) -> World:
    """An onset on the paper's machine, in force noise, after three stable cuts."""
    rng = np.random.default_rng((11, seed))
    rpm = STATES[seed % 4][0]
    limit = critical_depth(MACHINE, rpm, seated=False)
    depths = tuple(float(d) for d in rng.uniform(0.4 * limit, 0.9 * limit, 3))
    unstable = float(rng.uniform(1.05 * limit, max(1.2e-3, 1.5 * limit)))
    return World(told, heard, NOISES['S1'], rpm, depths, lasting, unstable, seed)


def wrong(options: Any) -> list[str]:
    """Machines told wrong beside none told."""
    number = options.onsets or (2 if options.quick else 24)
    told: dict[str, Machine | None] = {'none': None, 'right': MACHINE}
    for percent in (3, 5, 10, 20):
        for sign in (-1, 1):
            factor = 1.0 + sign * percent / 100.0
            told[f'frequencies {sign * percent:+d} %'] = _told(frequency=factor)
    told |= {f'damping x {factor:g}': _told(damping=factor) for factor in (0.5, 2.0)}
    told |= {f'masses x {factor:g}': _told(mass=factor) for factor in (0.7, 1.3)}
    worlds = [
        _paper_world(machine, 'displacements', _UNTUNED + k, 5.0)
        for machine in told.values()
        for k in range(number)
    ]
    found = spread(hear, worlds, executor=options.executor)
    groups = [found[k * number : (k + 1) * number] for k in range(len(told))]
    lines = [f'machines told wrong: {number} onsets each, after 3 stable cuts of 5 s']
    return lines + [
        _line(label, group, groups[0] if k else None)
        for k, (label, group) in enumerate(zip(told, groups, strict=True))
    ]


@lru_cache
def ten_machines() -> tuple[tuple[Machine, float], ...]:
    """Machines from 50 Hz to 2 kHz, 0.2 to 500 kg, each with its sample rate, Hz."""
    rng = np.random.default_rng(10)
    made = []
    for k in range(10):
        share = k / 9.0
        hertz, mass = 50.0 * 40.0**share, 500.0 * (0.2 / 500.0) ** share
        parts = [
            Vibration(
                mass=mass * factor,
                natural_frequency=2.0 * math.pi * hertz * rng.uniform(0.8, 1.25),
                damping_ratio=rng.uniform(0.01, 0.04),
            )
            for factor in (1.0, rng.uniform(0.7, 1.5))
        ]
        machine = Machine(
            tool=parts[0], workpiece=parts[1], bearing_stiffness=0.5 * parts[1].stiffness,
            cutting_coefficient=1e9,
        )  # fmt: skip
        made.append((machine, 2000.0 * 25.0**share))
    return tuple(made)


def _world_of_size(k: int, seed: int, *, told: bool) -> World:
    """An onset on the k-th machine after two stable cuts, in noise that suits its stiffness."""
    machine, rate = ten_machines()[k]
    rng = np.random.default_rng((12, seed))
    hertz = machine.tool.natural_frequency / (2.0 * math.pi)
    rpm = float(60.0 * hertz / rng.uniform(2.0, 6.0))
    limit = critical_depth(machine, rpm, seated=False)
    micron = 1e-6 * machine.tool.stiffness  # N that push the tool by a micrometre
    around = Surroundings(
        force_noise=(0.02 * micron) ** 2 / hertz, sensor_noise=3e-8, chip=5e-5,
        runout=(2e-6, 1e-6),
        unbalance=0.0, rate=rate, machine=machine,
    )  # fmt: skip
    depths = tuple(float(d) for d in rng.uniform(0.4 * limit, 0.9 * limit, 2))
    unstable = float(rng.uniform(1.1, 1.6) * limit)
    lasting = max(3.0, 500.0 / hertz)
    return World(
        machine if told else None, 'displacements', around, rpm, depths, lasting, unstable, seed
    )


def machines(options: Any) -> list[str]:
    """Machines of ten sizes, told and not told."""
    number = options.onsets or (2 if options.quick else 24)
    lines = [f'ten machines, {number} onsets each, after 2 stable cuts each']
    everything: dict[bool, list[Found]] = {True: [], False: []}
    for k, (machine, rate) in enumerate(ten_machines()):
        for told in (True, False):
            worlds = [_world_of_size(k, _UNTUNED + n, told=told) for n in range(number)]
            found = spread(hear, worlds, executor=options.executor)
            everything[told] += found
            hertz = machine.tool.natural_frequency / (2.0 * math.pi)
            label = f'{hertz:.0f} Hz, {machine.tool.mass:.3g} kg, {rate / 1e3:.1f} kHz'
            lines.append(_line(f'{label}, {"told" if told else "not told"}', found))
    for told, found in everything.items():
        steps = sum(each.false for each in found)
        share = 100.0 * steps / (2 * len(found))
        label = 'all, told' if told else 'all, not told'
        lines.append(f'{_line(label, found)}, {share:.1f} % of the stable cuts')
    return lines


def sensors(options: Any) -> list[str]:
    """Other sensors on the same cuts."""
    number = options.onsets or (2 if options.quick else 24)
    lines, base = [f'sensors: {number} onsets each on the same cuts, machine told'], None
    for heard in ('displacements', 'accelerations', 'one', 'sound'):
        worlds = [_paper_world(MACHINE, heard, _UNTUNED + k, 3.0) for k in range(number)]
        found = spread(hear, worlds, executor=options.executor)
        lines.append(_line(heard, found, base))
        base = base or found
    return [each.replace('of none', 'of displacements') for each in lines]


def air(options: Any) -> list[str]:
    """Nothing is cut: the spindle turns, and noise is all there is."""
    number = options.onsets or (2 if options.quick else 24)
    lines = ['air cutting, 20 s each']
    for told in (MACHINE, None):
        worlds = [
            World(told, 'displacements', NOISES['S1'], STATES[k % 4][0], (0.0,), 20.0, 0.0, k)
            for k in range(number)
        ]
        found = spread(hear, worlds, executor=options.executor)
        name = 'told' if told else 'not told'
        lines.append(f'  machine {name}: {sum(f.false for f in found)} of {number} flagged')
    return lines


def history(_options: Any) -> list[str]:
    """A stable cut that starts from the paper's history, quiet, with the machine told."""
    parts = (
        Vibration(mass=479.6, natural_frequency=2.0 * math.pi * 150.0, damping_ratio=0.01),
        Vibration(mass=10.0, natural_frequency=2.0 * math.pi * 2000.0, damping_ratio=0.03),
    )
    machine = Machine(tool=parts[0], workpiece=parts[1], bearing_stiffness=0.0,
                      cutting_coefficient=1e9)  # fmt: skip
    lines = ['a stable cut from the history of the paper on']
    for rate in (10_000.0, 20_000.0, 50_000.0):
        cut = Cut(spindle_speed_rpm=12_094.0, depth_of_cut=0.005, bearing_contact='none')
        lathe = VirtualLathe(machine, cut=cut, sample_rate=rate)
        detector, flags = ChatterDetector(machine), 0
        for _ in range(100):
            samples: Array = lathe.advance(round(_NODE * rate))
            flags += detector.update(samples, lathe.columns).chatter
        lines.append(f'  {rate / 1e3:g} kHz: flagged in {flags} of 100 blocks')
    return lines
