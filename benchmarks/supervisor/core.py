"""One trial in simulated time: lathe, detector and supervisor of the core, no ROS."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from trials import FASTEST, SLOWEST, Trial, true_growth

from lathe_chatter.arrays import Array
from lathe_chatter.detection import ChatterDetector, Estimate
from lathe_chatter.detection.estimate import Mode as Works
from lathe_chatter.detection.speed_advice import rule_of_thumb
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import Cut
from lathe_chatter.supervisor import Mode, Seen, Supervisor
from lathe_chatter.supervisor.moves import removal_rate

_BLOCK, _RATE = 100, 1e4
_LATENCY = 0.02
"""s from what is decided to when the lathe does it: a service call and a tick."""
_CALM, _AFTER = 2.0, 8.0
"""s of a stable cut before, and s that are given from the alarm on."""
_ALARM = 6.0
"""s in which an alarm must come."""
_RULE_WAIT, _RULE_TRIES = 1.0, 5
_DOWN, _QUIET = 0.3, 4.0
"""Part of its greatest value, and times its value in the stable cut before, to one of which
vibration must be down at the end."""

Change = dict[str, float]
Answer = Callable[[float, Cut, Estimate], tuple[Change, bool]]
"""What is done about an estimate at a time: parameters to set, and whether to stop."""


class Outcome(NamedTuple):
    """What came of a trial.

    Attributes:
        alarmed: Whether there was an alarm, else nothing else counts.
        possible: Whether a stable cut within the limits exists.
        ended: Whether the cut is stable at the end, and its vibration down.
        stopped: Whether the lathe was stopped.
        time: From alarm to the last change that left it stable, s.
        moves: That were made.
        kept: Removal rate at the end over that of the best stable cut in the limits.
        unsafe: Moves to a cut that is truly unstable.
        said: What the supervisor said.
    """

    alarmed: bool
    possible: bool = False
    ended: bool = False
    stopped: bool = False
    time: float = math.nan
    moves: int = 0
    kept: float = math.nan
    unsafe: int = 0
    said: tuple[str, ...] = ()


class Supervised:
    """A supervisor in the mode `act`, told what a node would be told."""

    def __init__(self, trial: Trial) -> None:
        """It has seen nothing."""
        self._supervisor = Supervisor(trial.limits, Mode.ACT)
        self._told = trial.told
        self.said: list[str] = []
        self.targets: list[Cut] = []

    def __call__(self, time: float, cut: Cut, known: Estimate) -> tuple[Change, bool]:
        """See `Answer`."""
        believed = known.mode in {Works.FULL, Works.CORRECTED}
        self._supervisor.machine = self._told if believed else None
        seen = Seen(
            time, cut, known.chatter, known.growth_rate, known.frequency, known.amplitude,
            known.margin, known.cutting_stiffness,
        )  # fmt: skip
        action = self._supervisor.look(seen)
        if action is None:
            return {}, False
        if action.sentence:
            self.said.append(f'{time:.2f} s: {action.sentence}')
        return dict(action.changes), action.stop


class Rule:
    """60 f/k with the fewest waves a turn that the range allows, again and again."""

    def __init__(self, _trial: Trial) -> None:
        """It has tried nothing."""
        self.said: list[str] = []
        self._next, self._tries = -math.inf, 0

    def __call__(self, time: float, _cut: Cut, known: Estimate) -> tuple[Change, bool]:
        """See `Answer`."""
        if not known.chatter:
            return {}, False
        if self._next == -math.inf:
            self._next = time + 0.1  # for the frequency
        if time < self._next or self._tries == _RULE_TRIES:
            return {}, False
        speeds = rule_of_thumb(known.frequency, (SLOWEST, FASTEST)).speeds
        if not speeds:
            return {}, False
        self._tries, self._next = self._tries + 1, time + _RULE_WAIT
        return {'spindle_speed_rpm': speeds[0].spindle_speed_rpm}, False


def nothing(_trial: Trial) -> Answer:
    """No action."""
    return lambda _time, _cut, _known: ({}, False)


class _Course(NamedTuple):
    """Every change of the cut and its time, the alarm's time, vibration, and how it ended."""

    changed: list[tuple[float, Cut]]
    alarm: float
    level: list[float]
    stopped: bool
    said: tuple[str, ...]


def play(trial: Trial, make: Callable[[Trial], Answer]) -> Outcome:
    """Let a cut chatter, and see what an answer makes of it."""
    calm = trial.cut.with_changes(depth_of_cut=0.45 * trial.cut.depth_of_cut)
    lathe = VirtualLathe(trial.machine, calm, seed=trial.seed)
    detector = ChatterDetector(trial.told, speed_range=(SLOWEST, FASTEST))
    answer = make(trial)
    due: list[tuple[float, Change]] = []
    alarm, stopped, level = math.nan, False, list[float]()
    changed: list[tuple[float, Cut]] = []
    while True:
        time = lathe.time
        if changed == [] and time >= _CALM - 1e-9:
            lathe.retune(trial.cut)
            changed.append((time, trial.cut))
        if math.isnan(alarm) and time > _CALM + _ALARM:
            return Outcome(alarmed=False)
        if time > alarm + _AFTER or stopped or lathe.guard:
            break
        while due and due[0][0] <= time:
            lathe.retune(lathe.cut.with_changes(**due.pop(0)[1]))
            changed.append((time, lathe.cut))
        samples = lathe.advance(_BLOCK)
        known = detector.update(samples, lathe.columns)
        level.append(_vibration(samples))
        if math.isnan(alarm) and known.chatter:
            if not changed:
                return Outcome(alarmed=False)  # a false alarm is another benchmark's
            alarm = lathe.time
        change, stopped = answer(lathe.time, lathe.cut, known)
        if change:
            due.append((lathe.time + _LATENCY, change))
    said = tuple(getattr(answer, 'said', ()))
    return _judged(trial, _Course(changed, alarm, level, stopped, said))


def _vibration(samples: Array) -> float:
    """Of the tool within a block, m."""
    return float(np.std(samples[:, 2]))


def _judged(trial: Trial, course: _Course) -> Outcome:
    changed, alarm, level, stopped, said = course
    # The steps of one ramp are one move.
    moves = [
        (time, cut)
        for k, (time, cut) in enumerate(changed)
        if k and (k + 1 == len(changed) or changed[k + 1][0] - time > 0.2)
    ]
    growth = [true_growth(trial.machine, cut) for _, cut in moves]
    best = trial.best_rate()
    final = changed[-1][1]
    stable = true_growth(trial.machine, final) < 0.0
    before = round(_CALM * _RATE / _BLOCK)
    quiet, end = np.mean(level[before // 2 : before]), np.mean(level[-50:])
    down = end < max(_DOWN * max(level[before:]), _QUIET * quiet)
    return Outcome(
        alarmed=True,
        possible=best > 0.0,
        ended=stable and down and not stopped,
        stopped=stopped,
        time=moves[-1][0] - alarm if moves else math.nan,
        moves=len(moves),
        kept=removal_rate(final) / best if best else math.nan,
        unsafe=sum(rate >= 0.0 for rate in growth),
        said=said,
    )
