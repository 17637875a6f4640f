"""One trial in simulated time: lathe, detector and supervisor of the core, no ROS."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from support.supervised_lathe import BLOCK, Disturb, SupervisedLathe, undisturbed
from trials import FASTEST, SLOWEST, Trial, true_growth

from lathe_chatter.detection.speed_advice import rule_of_thumb
from lathe_chatter.supervisor import Seen
from lathe_chatter.supervisor.move_search import removal_rate

_CALM, _ALARM, _AFTER = 2.0, 6.0, 8.0
"""s of a stable cut before, in which an alarm must come, and that are given from the alarm on."""
_PART = 0.45
"""Of the depth, in the stable cut before."""
_RULE_WAIT, _RULE_TRIES = 1.0, 5
_DOWN, _QUIET = 0.3, 4.0
"""Part of its greatest value, and times its value in the stable cut before, to one of which
vibration must be down at the end."""
_ONE_MOVE = 0.2
"""s within which changes are steps of one ramp."""


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


class Rule:
    """60 f/k with the fewest waves a turn that the range allows, again and again."""

    def __init__(self) -> None:
        """It has tried nothing."""
        self._next, self._tries = math.nan, 0

    def __call__(self, there: SupervisedLathe, seen: Seen) -> None:
        """Change the speed in place of a supervisor."""
        if not seen.chatter or self._tries == _RULE_TRIES:
            return
        if math.isnan(self._next):
            self._next = seen.time + 0.1  # for the frequency
        speeds = rule_of_thumb(seen.frequency, (SLOWEST, FASTEST)).speeds
        if seen.time >= self._next and speeds:
            self._tries, self._next = self._tries + 1, seen.time + _RULE_WAIT
            there.set_by_hand(told=False, spindle_speed_rpm=speeds[0].spindle_speed_rpm)


def answer_of(name: str) -> Disturb:
    """`supervisor`, `rule` or `nothing`."""
    if name == 'rule':
        return Rule()
    return undisturbed if name == 'supervisor' else lambda _there, _seen: None


def play(trial: Trial, answer: str = 'supervisor') -> Outcome:
    """Let a cut chatter, and see what an answer makes of it.

    The stock gets deeper, which is nobody's hand: the supervisor need not wait for any.
    """
    there = SupervisedLathe(
        trial.cut.with_changes(depth_of_cut=_PART * trial.cut.depth_of_cut),
        trial.machine,
        told=trial.told,
        limits=trial.limits,
        disturb=answer_of(answer),
        seed=trial.seed,
    )
    there.run(_CALM, lambda: there.known.chatter)
    if there.known.chatter:  # false alarms are another benchmark's
        return Outcome(alarmed=False)
    there.set_by_hand(told=False, depth_of_cut=trial.cut.depth_of_cut)
    there.run(_ALARM, lambda: there.known.chatter)
    if not there.known.chatter:
        return Outcome(alarmed=False)
    alarm = there.time
    there.run(_AFTER)
    changed = there.changed
    moves = [
        entry
        for k, entry in enumerate(changed)
        if k and (k + 1 == len(changed) or changed[k + 1][0] - entry[0] > _ONE_MOVE)
    ]
    growth = [true_growth(trial.machine, cut) for _, cut in moves]
    final, best = changed[-1][1], trial.best_rate()
    before = round(_CALM * there.lathe.sample_rate / BLOCK)
    quiet = float(np.mean(there.vibration[before // 2 : before]))
    down = np.mean(there.vibration[-50:]) < max(
        _DOWN * max(there.vibration[before:]), _QUIET * quiet
    )
    return Outcome(
        alarmed=True,
        possible=best > 0.0,
        ended=true_growth(trial.machine, final) < 0.0 and bool(down) and not there.stopped,
        stopped=there.stopped,
        time=moves[-1][0] - alarm if moves else math.nan,
        moves=len(moves),
        kept=removal_rate(final) / best if best else math.nan,
        unsafe=sum(rate >= 0.0 for rate in growth),
        said=tuple(there.said),
    )
