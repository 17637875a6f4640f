"""A lathe, its detector and a supervisor of the core as one loop in simulated time."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from lathe_chatter.detection import ChatterDetector, Estimate
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import Cut, Machine
from lathe_chatter.supervisor import Action, Limits, Mode, Seen, Supervisor

BLOCK = 100
"""Samples from one look to the next: 10 ms."""
Disturb = Callable[['SupervisedLathe', Seen], Seen | None]
"""What becomes of what is seen; None: the supervisor does not look."""


def undisturbed(_there: SupervisedLathe, seen: Seen) -> Seen | None:
    """As it is."""
    return seen


class SupervisedLathe:
    """A cut that is supervised.

    Args:
        cut: At the start.
        machine: The true one.
        told: What the detector and the supervisor know of it; None for the truth.
        limits: Of the supervisor.
        mode: Of the supervisor.
        disturb: Comes between what is so and what the supervisor sees.
        seed: Of the noise.
        options: Of the supervisor.

    Attributes:
        lathe: That cuts.
        known: The newest estimate.
        supervisor: That watches.
        actions: All that it said and did, with their times, and what it saw then.
        changed: Every change of the cut, with its time.
        vibration: Of the tool, of each block, m.
        latency: s from what is decided to when the lathe does it: a service call and a tick.
        refuse: Says why a change is refused; empty where it is not.
        stopped: Whether it had the lathe paused.
        hands: When somebody else changed something and it was told.
        hands_off: s after that in which nothing may be done.
    """

    def __init__(
        self,
        cut: Cut,
        machine: Machine | None = None,
        *,
        told: Machine | None = None,
        limits: Limits | None = None,
        mode: Mode = Mode.ACT,
        disturb: Disturb = undisturbed,
        seed: int = 0,
        **options: Any,
    ) -> None:
        self.machine = machine or Machine()
        self.told = told or self.machine
        self.limits = limits or Limits()
        self.lathe = VirtualLathe(self.machine, cut, seed=seed)
        self.detector = ChatterDetector(
            self.told, speed_range=(self.limits.slowest_speed, self.limits.fastest_speed)
        )
        self.supervisor = Supervisor(self.limits, mode, **options)
        self.known = Estimate()
        self.actions: list[tuple[float, Action, Seen]] = []
        self.changed: list[tuple[float, Cut]] = []
        self.vibration: list[float] = []
        self.latency: Callable[[], float] = lambda: 0.02
        self.refuse: Callable[[Action], str] = lambda _action: ''
        self.stopped = False
        self.hands: list[float] = []
        self.hands_off = float(options.get('hands_off', 2.0))
        self._disturb = disturb
        self._due: list[tuple[float, Action]] = []

    @property
    def time(self) -> float:
        """Simulated, s."""
        return self.lathe.time

    @property
    def said(self) -> list[str]:
        """Its sentences."""
        return [action.sentence for _, action, _ in self.actions if action.sentence]

    @property
    def moves(self) -> list[tuple[float, Action, Seen]]:
        """The actions that began something, not the steps of a ramp."""
        acts = [entry for entry in self.actions if entry[1].changes or entry[1].stop]
        return [entry for entry in acts if entry[1].sentence]

    def set_by_hand(self, *, told: bool = True, **changes: Any) -> None:
        """Somebody else changes the cut; `told`: and the supervisor hears of it."""
        self.lathe.retune(self.lathe.cut.with_changes(**changes))
        self.changed.append((self.time, self.lathe.cut))
        if told:
            self.hands.append(self.time)
            self._note(self.supervisor.hand_moved(self.time), self.seen())

    def seen(self) -> Seen:
        """What a supervisor sees where nothing disturbs."""
        known = self.known
        return Seen(
            self.time, self.lathe.cut, known.chatter, known.growth_rate, known.frequency,
            known.amplitude, known.margin, known.cutting_stiffness, known.tool_frequency,
            lasted=self.time - self.changed[-1][0] if self.changed else math.inf,
        )  # fmt: skip

    def accept(self) -> tuple[bool, str]:
        """A person says yes."""
        seen = self.seen()
        done, message, action = self.supervisor.accept(seen)
        self._note(action, seen)
        return done, message

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> None:
        """Cut on, as long as the lathe does."""
        end = self.time + seconds
        while self.time < end and not (self.stopped or self.lathe.guard or until()):
            self._step()

    def _step(self) -> None:
        while self._due and self._due[0][0] <= self.time:
            self._carry_out(self._due.pop(0)[1])
        samples = self.lathe.advance(BLOCK)
        self.vibration.append(float(np.std(samples[:, 2])))
        self.known = self.detector.update(samples, self.lathe.columns)
        self.supervisor.machine = self.told if self.known.mode.knows_machine else None
        seen = self._disturb(self, self.seen())
        if seen is not None and not self._due:
            self._note(self.supervisor.look(seen), seen)

    def _note(self, action: Action | None, seen: Seen) -> None:
        if action is None:
            return
        self.actions.append((self.time, action, seen))
        if action.changes or action.stop:
            self._due.append((self.time + self.latency(), action))

    def _carry_out(self, action: Action) -> None:
        if reason := self.refuse(action):
            self._note(self.supervisor.refused(f'the lathe refused: {reason}'), self.seen())
            return
        self.stopped = self.stopped or action.stop
        if action.changes:
            self.lathe.retune(self.lathe.cut.with_changes(**action.changes))
            self.changed.append((self.time, self.lathe.cut))


def faults_of(there: SupervisedLathe, start: Cut) -> list[str]:
    """What a supervisor did that it must never do, in words."""
    limits, found = there.limits, []
    for time, action, seen in there.actions:
        if not action.changes:
            continue
        before, new = seen.cut, seen.cut.with_changes(**action.changes)
        swing = 1.0 + np.array([-1.0, 1.0]) * new.speed_variation_amplitude
        slow, fast = new.spindle_speed_rpm * swing
        step = abs(new.spindle_speed_rpm - before.spindle_speed_rpm)
        checks = {
            'a speed outside the range': limits.slowest_speed - 0.5 <= slow or step == 0.0,
            'a speed outside of the range': fast <= limits.fastest_speed + 0.5 or step == 0.0,
            'a step of the speed beyond the ramp': step <= limits.ramp * 0.1 + 1.0,
            'a depth below the smallest': new.depth_of_cut
            >= min(limits.smallest_depth, before.depth_of_cut) - 1e-12,
            'a greater depth': new.depth_of_cut <= start.depth_of_cut + 1e-12,
            'a feed below the smallest': new.feed
            >= min(limits.smallest_feed, before.feed) - 1e-12,
            'an action though hindered': not (seen.hindrance and action.sentence),
            'an action amid a hand': not any(
                0.0 < time - hand < there.hands_off - 1e-6 for hand in there.hands
            ),
            'something that is no number': all(map(math.isfinite, action.changes.values())),
        }
        found += [f'{time:.2f} s: {what}' for what, well in checks.items() if not well]
    if len([move for move in there.moves if not move[1].stop]) > limits.most_moves:
        found.append('more than most_moves')
    return found
