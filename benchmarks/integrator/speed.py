"""What a step costs, beside the least that it does in C."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import lru_cache
from statistics import median

from cases import DURATION, RATE, Case
from figures import Figure, Line, Missing, tracked
from floor import Floor, NoCompilerError

from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.model import Cut, Machine

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
    """Nanoseconds a step by what happens in it, medians, in turns with the C loop's."""
    runs = {name: _Run(*given) for name, given in _cases().items()}
    try:
        floor: Floor | None = Floor()
        reason = ''
    except NoCompilerError as problem:
        floor, reason = None, str(problem)
    least = []
    for _ in tracked(range(_TURNS), 'steps of all kinds, in turns'):
        for run in runs.values():
            run.once()
        if floor is not None:
            least.append(floor.nanoseconds(1))
    lines: list[Line] = [
        Missing('the least that a quiet step costs in C', reason)
        if floor is None
        else Figure('the least that a quiet step costs in C, one by one', median(least), 'ns')
    ]
    for name, run in runs.items():
        note = f'best {min(run.costs):.1f}; {run.events} events in 10,000 steps'
        lines.append(Figure(f'step, {name}', median(run.costs), 'ns', run.goal, note=note))
    return [*lines, _tick(), *_changes()]


_TURNS = 41
_SAMPLES = 10_000
_QUIET = Cut(3000.0, 4e-4, 5e-5)
_CHATTER = Cut(3000.0, 1e-3, 5e-6)


def _split(parts: int) -> Machine:
    """The paper's machine, each mode in so many equal ones: the same motion."""
    usual = Machine()
    tool, work = usual.tool.modes[0], usual.workpiece.modes[0]
    return Machine(
        [replace(tool, mass=tool.mass * parts)] * parts,
        [replace(work, mass=work.mass * parts)] * parts,
        bearing_stiffness=usual.bearing_stiffness,
    )


def _cases() -> dict[str, tuple[Machine, Cut, float]]:
    """Machine, cut and goal, ns, of each line."""
    one, odd = Machine(), {'spindle_speed_rpm': 3001.7}
    varied = {'speed_variation_amplitude': 0.1, 'speed_variation_frequency': 2.0}
    force, sensor = {'force_noise': 1e-3}, {'sensor_noise': 1e-7}
    return {
        'quiet, whole turns': (one, _QUIET, 13.0),
        'quiet, any speed': (one, _QUIET.with_changes(**odd), 25.0),
        'quiet, 2+2 modes': (_split(2), _QUIET, 22.0),
        'quiet, 4+4 modes': (_split(4), _QUIET, 40.0),
        'quiet, 8+8 modes': (_split(8), _QUIET, 80.0),
        'chatter with contact and loss of cut': (one, _CHATTER, 45.0),
        'the same at any speed': (one, _CHATTER.with_changes(**odd), 45.0),
        'sensor noise': (one, _QUIET.with_changes(**sensor), 35.0),
        'force noise': (one, _QUIET.with_changes(**force), 80.0),
        'force noise, any speed': (one, _QUIET.with_changes(**force, **odd), 80.0),
        'speed variation': (one, _QUIET.with_changes(**varied), 60.0),
        'all three in chatter': (one, _CHATTER.with_changes(**varied, **force, **sensor), 150.0),
    }


class _Run:
    """The same second of cutting again and again."""

    def __init__(self, machine: Machine, cut: Cut, goal: float) -> None:
        """Cut until it is as it stays."""
        self.goal, self.costs, self.events = goal, list[float](), 0
        self._lathe = VirtualLathe(machine, cut)
        self._lathe.advance(round(_SETTLED * RATE))
        self._begin = self._lathe.snapshot()

    def once(self) -> None:
        """Add the CPU time of a step."""
        self._lathe.restore(self._begin)
        then = time.thread_time()
        self._lathe.advance(_SAMPLES)
        self.costs.append(1e9 * (time.thread_time() - then) / _SAMPLES)
        self.events = len(self._lathe.events)


def _tick() -> Line:
    """What a node pays for a tick."""
    lathe, costs = VirtualLathe(), []
    for _ in range(201):
        then = time.thread_time()
        for _ in range(100):
            lathe.advance(20)
        costs.append(1e6 * (time.thread_time() - then) / 100)
    return Figure(
        'a tick of 20 samples, called from Python', median(costs), 'us', 3.0,
        note=f'best {min(costs):.2f}',
    )  # fmt: skip


def _changes() -> list[Line]:
    """What a change of the cut costs between two ticks, each to a value that it never had."""
    lines: list[Line] = []
    for name in ('depth_of_cut', 'spindle_speed_rpm'):
        lathe, costs = VirtualLathe(), []
        lathe.advance(1000)
        for k in range(201):
            cut = lathe.cut.with_changes(**{name: getattr(Cut(), name) * (1.1 + 1e-6 * k)})
            then = time.thread_time()
            lathe.retune(cut)
            costs.append(1e6 * (time.thread_time() - then))
            lathe.advance(20)
        note = f'best {min(costs):.0f}'
        lines.append(Figure(f'a change of {name}', median(costs), 'us', note=note))
    return lines
