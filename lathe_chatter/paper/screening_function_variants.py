"""Four readings of the screening function of equation (9), each held against the verdicts.

The lathe of this package knows three of them. Here all four are stepped through alike: by the
classical Runge-Kutta rule with a cubic between the delayed samples, and the bearing engaged or
not for a whole step. Its force is zero where it engages, so that this costs little.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.compiled import compiled
from lathe_chatter.model import BearingContact, Machine, paper_initial_state
from lathe_chatter.paper.published_runs import AXES, PAPER_RUNS, PaperRun, run_named
from lathe_chatter.stability import rightmost_root

STEP = 1e-5
"""s, about: a whole number of them is a turn."""
_END, _WINDOW = 1.2, 0.2
"""s of simulation, and of each of the two windows whose sizes tell the growth."""
_SCANNED = 3.5 * 10.0 ** np.linspace(5.0, 7.5, 51)
"""C, N/m2, among which the range of a reading is looked for."""
_DIGITS = 1e-4
_TELLING = 'bc60-10000-1'
"""The run whose axes in Table 4 are met at other times by two readings."""
_WITHOUT = 'no-bc-10000-1'
"""The run at its speed that has no bearing, and so one reading."""
_VELOCITY, _WORKPIECE = 1, 2


class Reading(str, Enum):
    """When the bearing carries, in the runs with clearance."""

    NONE = 'none'
    """Never."""
    GAP = 'gap'
    """While x_wp >= gamma: as printed."""
    SEATED = 'seated'
    """Always."""
    REVERSED = 'reversed'
    """While x_wp < gamma: as printed, with its sign turned round."""


@dataclass(frozen=True)
class ScreeningReading:
    """One reading, and what it comes to.

    Attributes:
        reading: Which.
        verdicts: How many of the paper's hold with it.
        against: Names of the runs that it gets wrong.
        coefficient: From and to which C all of them hold with it, N/m2; None if with none of
            those between 3.5e5 and 1.1e8.
        axes_met: From and to when the largest velocities of the telling run are those of the
            axes in Table 4, s; None if never.
        same_as_seated: In how many of the runs with clearance the workpiece moves within their
            figure as with the bearing always engaged.
    """

    reading: Reading
    verdicts: int
    against: tuple[str, ...]
    coefficient: tuple[float, float] | None
    axes_met: tuple[float, float] | None
    same_as_seated: int


def screening_readings(
    machine: Machine, windows: dict[float, float]
) -> tuple[ScreeningReading, ...]:
    """Hold every reading against the verdicts.

    Args:
        machine: The paper's.
        windows: s that a figure spans, by speed in rev/min.
    """
    found = []
    for reading in Reading:
        holds = verdicts_with(reading, machine)
        found.append(
            ScreeningReading(
                reading,
                sum(holds),
                tuple(r.name for r, ok in zip(PAPER_RUNS, holds, strict=True) if not ok),
                _range_of_coefficient(reading, machine),
                axes_met(_TELLING, reading, machine),
                sum(
                    _same_as_seated(run, reading, machine, windows[run.spindle_speed_rpm])
                    for run in PAPER_RUNS
                    if run.has_bearing
                ),
            )
        )
    return tuple(found)


def axes_without_bearing(machine: Machine) -> tuple[float, float] | None:
    """When the run without bearing at the telling speed meets its axes, s."""
    return axes_met(_WITHOUT, Reading.NONE, machine)


def verdicts_with(reading: Reading, machine: Machine) -> list[bool]:
    """Whether each of the paper's verdicts holds with a reading."""
    return [_holds(run, reading, machine) for run in PAPER_RUNS]


def _holds(run: PaperRun, reading: Reading, machine: Machine) -> bool:
    """By the rightmost root where the machine is linear, else by the growth in time."""
    if run.has_bearing and reading in {Reading.GAP, Reading.REVERSED}:
        rate = growth(run, reading, machine)
    else:
        seated = run.has_bearing and reading is Reading.SEATED
        rate = rightmost_root(machine, run.spindle_speed_rpm, run.depth_of_cut, seated=seated).real
    return (rate > 0.0) == run.unstable


def growth(run: PaperRun, reading: Reading, machine: Machine) -> float:
    """Growth rate of a run's envelope at the end of its simulation, 1/s."""
    states = simulate(run, reading, machine, _END)
    count = round(_WINDOW / _END * len(states))
    before, after = (np.ptp(part[:, 3]) for part in (states[-2 * count : -count], states[-count:]))
    if not np.isfinite(after):
        return math.inf
    return float(np.log(after / before)) / _WINDOW


def simulate(run: PaperRun, reading: Reading, machine: Machine, duration: float) -> Array:
    """A run from the paper's history.

    Returns:
        Tool displacement and velocity, workpiece displacement and velocity (n, 4), m and m/s,
        every `STEP`, which is a whole part of a turn, from t = 0 on.
    """
    cut = run.cut(BearingContact.GAP)
    turn = round(cut.delay / STEP)
    step = cut.delay / turn
    regimes = [_runge_kutta(machine, run, step, seated=seated) for seated in (False, True)]
    push, *delayed = (np.array(parts) for parts in zip(*regimes, strict=True))
    states = np.empty((round(duration / step) + 1, 4))
    states[0] = paper_initial_state(cut)
    clearance = run.bearing_clearance or 0.0
    kind = [*Reading].index(reading if run.has_bearing else Reading.NONE)
    _follow(states, turn, step, kind, clearance, push, *delayed)
    return states


def _runge_kutta(
    machine: Machine, run: PaperRun, step: float, *, seated: bool
) -> tuple[Array, Array, Array, Array, Array]:
    """A step of x' = A x + b u + d: what it makes of x, of u at three times, and of nothing."""
    a, b, d = machine.matrices(run.depth_of_cut, seated=seated)
    one, h = np.eye(4), step
    # The delayed state acts by r alone: B is b (1, 0, -1, 0).
    force = b[:, 0]
    k1 = one
    k2 = one + h / 2 * a
    k3 = one + h / 2 * a @ k2
    k4 = one + h * a @ k3
    push = one + h / 6 * (a @ k1 + 2 * a @ k2 + 2 * a @ k3 + a @ k4)
    # The same of the parts that u and d have: each stage passes its own on to those after it.
    ha = h * a
    first = h / 6 * (one + ha + ha @ ha / 2 + ha @ ha @ ha / 4) @ force
    middle = h / 6 * (4 * one + 2 * ha + ha @ ha / 2) @ force
    last = h / 6 * force
    rest = (
        h * (one + ha / 2 + ha @ ha / 6 + ha @ ha @ ha / 24) @ (d * (run.bearing_clearance or 0))
    )
    return push, first, middle, last, rest


@compiled()
def _follow(  # noqa: PLR0913, PLR0917 -- plain arrays, as all that is compiled
    states: Array,
    turn: int,
    step: float,
    kind: int,
    clearance: float,
    push: Array,
    first: Array,
    middle: Array,
    last: Array,
    rest: Array,
) -> None:
    """Step through a run, from its first state on."""
    for k in range(len(states) - 1):
        x = states[k]
        above = x[2] >= clearance
        seated = kind == 2 or (kind == 1 and above) or (kind == 3 and not above)
        regime = 1 if seated else 0
        u0 = u1 = half = 0.0
        if k >= turn:
            then, after = states[k - turn], states[k - turn + 1]
            u0, u1 = then[0] - then[2], after[0] - after[2]
            slope0, slope1 = then[1] - then[3], after[1] - after[3]
            half = 0.5 * (u0 + u1) + step * (slope0 - slope1) / 8.0
        for i in range(4):
            total = rest[regime, i]
            for j in range(4):
                total += push[regime, i, j] * x[j]
            total += first[regime, i] * u0 + middle[regime, i] * half + last[regime, i] * u1
            states[k + 1, i] = total


def _range_of_coefficient(reading: Reading, machine: Machine) -> tuple[float, float] | None:
    """From and to which C every verdict holds, N/m2."""

    def hold(coefficient: float) -> bool:
        other = replace(machine, cutting_coefficient=coefficient)
        # Those without bearing first: a root is found sooner than a growth.
        runs = sorted(PAPER_RUNS, key=lambda run: run.has_bearing)
        return all(_holds(run, reading, other) for run in runs)

    inside = [value for value in _SCANNED.tolist() if hold(value)]
    if not inside:
        return None
    around = np.concatenate((_SCANNED[:1] / 10.0, _SCANNED, _SCANNED[-1:] * 10.0))
    below = float(around[around < inside[0]][-1])
    above = float(around[around > inside[-1]][0])
    ends = []
    for good, bad in ((inside[0], below), (inside[-1], above)):
        holds, fails = good, bad
        while abs(fails - holds) > _DIGITS * holds:
            middle = math.sqrt(holds * fails)
            holds, fails = (middle, fails) if hold(middle) else (holds, middle)
        ends.append(holds)
    return ends[0], ends[1]


def axes_met(name: str, reading: Reading, machine: Machine) -> tuple[float, float] | None:
    """From and to when the tool's largest velocities so far are those of a run's axes, s.

    An axis ends at the first tick beyond what it shows, so its last two ticks bound a velocity.
    """
    velocity = simulate(run_named(name), reading, machine, 0.3)[:, _VELOCITY]
    fits = np.ones(len(velocity), bool)
    for axis in AXES:
        if axis.run == name:
            reached = np.maximum.accumulate(axis.sign * velocity)
            fits &= (reached > axis.tick_before) & (reached <= axis.last_tick)
    times = np.flatnonzero(fits) * _step_of(run_named(name))
    return (float(times[0]), float(times[-1])) if times.size else None


def _step_of(run: PaperRun) -> float:
    delay = 60.0 / run.spindle_speed_rpm
    return delay / round(delay / STEP)


def _same_as_seated(run: PaperRun, reading: Reading, machine: Machine, window: float) -> bool:
    """Whether a run's figure cannot tell a reading from the bearing always engaged."""
    mine, other = (
        simulate(run, each, machine, window)[:, _WORKPIECE] for each in (reading, Reading.SEATED)
    )
    return bool(np.array_equal(mine, other))
