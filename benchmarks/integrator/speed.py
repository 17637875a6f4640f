"""What a step costs."""

from __future__ import annotations

import statistics
import time
from dataclasses import dataclass, replace
from functools import lru_cache

from cases import CHATTER, DURATION, LINEAR, RATE, TOUCHING, Case
from figures import Figure, Line, tracked

from lathe_chatter.lathe.integrator import state_layout as layout

_REPEATS = 200
_SETTLED = 2.0
"""s, after which chatter lasts."""


@dataclass(frozen=True)
class Cost:
    """Seconds of several runs of the same second of cutting: CPU time and by the clock."""

    cpu: tuple[float, ...]
    wall: tuple[float, ...]
    steps: int


@lru_cache
def cost(case: Case, settled: float = 0.0, repeats: int = _REPEATS) -> Cost:
    """What it costs to cut `DURATION`, again and again from the same state."""
    lathe = case.lathe()
    lathe.advance(round(settled * RATE))
    begin, samples = lathe.snapshot(), round(DURATION * RATE)
    cpu, wall = [], []
    for _ in range(repeats + 1):
        lathe.restore(begin)
        cpu_then, then = time.thread_time(), time.perf_counter()
        lathe.advance(samples)
        wall.append(time.perf_counter() - then)
        cpu.append(time.thread_time() - cpu_then)
    # The first call may have loaded machine code.
    return Cost(tuple(cpu[1:]), tuple(wall[1:]), samples * int(begin.counts[layout.STEPS]))


def speed() -> list[Line]:
    """Nanoseconds a step, and how much faster than time itself."""
    uneven = LINEAR.with_changes(spindle_speed_rpm=3001.7)
    varied = LINEAR.with_changes(speed_variation_amplitude=0.2)
    lines: list[Line] = []
    free = (
        ('without contact', LINEAR),
        ('without contact, 10000 rev/min', LINEAR.with_changes(spindle_speed_rpm=1e4)),
        ('without contact, 3001.7 rev/min', uneven),
    )
    for what, case in tracked(free, 'steps without contact'):
        lines += _lines(what, cost(case), 30.0, 3000.0)
    touching = (
        ('with contact, gap 60 um, linear', TOUCHING.with_changes(bearing_clearance=6e-5), 0.0),
        ('with contact, gap 5 um, linear', TOUCHING, 0.0),
        ('out of cut, none, total', replace(LINEAR, total_force=True), _SETTLED),
        ('contact and out of cut, gap 5 um, total', CHATTER, _SETTLED),
    )
    for what, case, settled in tracked(touching, 'steps with contact'):
        lines += _lines(what, cost(case, settled), 60.0)
    lines += _lines('without contact, speed varied', cost(varied))
    return lines


def _lines(
    what: str, found: Cost, goal: float | None = None, factor_goal: float | None = None
) -> list[Line]:
    per_step = 1e9 / found.steps
    note = (
        f'CPU median {per_step * statistics.median(found.cpu):.1f}; '
        f'clock best {per_step * min(found.wall):.1f}, '
        f'median {per_step * statistics.median(found.wall):.1f}'
    )
    return [
        Figure(
            f'step, {what}: best of {_REPEATS}', per_step * min(found.cpu), 'ns', goal, note=note
        ),
        Figure(
            '   simulated seconds per second', DURATION / min(found.wall),
            goal=factor_goal, at_least=True,
            note=f'median {DURATION / statistics.median(found.wall):.0f}',
        ),
    ]  # fmt: skip
