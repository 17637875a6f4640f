"""`ScenarioPlayer`: what of a scenario is due, from time and from what the monitor says.

It knows neither ROS nor a lathe: the operator node and the simulation tell it what they hear,
ask it what is due, and carry that out, each in its own way.
"""

from __future__ import annotations

import math
from dataclasses import replace

from lathe_chatter.scenario.scenario import CLEARED, FLAGGED, RECOMMENDED, Scenario, Step


class ScenarioPlayer:
    """Plays the steps of a scenario in their order.

    Args:
        scenario: What is played.

    Attributes:
        said: What was said so far: FLAGGED and CLEARED by the monitor, ASKED by a supervisor.
    """

    def __init__(self, scenario: Scenario) -> None:
        """At the beginning."""
        self.said: list[str] = []
        self._is_up = False
        self._steps = list(scenario.steps)
        self._said_before_step = 0
        self._said_at = 0.0

    @property
    def finished(self) -> bool:
        """Whether every step was played."""
        return not self._steps

    @property
    def next_step(self) -> Step | None:
        """The next step, None after the last."""
        return self._steps[0] if self._steps else None

    @property
    def next_time(self) -> float:
        """Simulated time of the next step, s; infinite where it waits for the monitor."""
        at = self.next_step.at if self.next_step else None
        return math.inf if at is None else at

    def notice(self, word: str, time: float) -> None:
        """Take notice of a word that steps wait for, at a simulated time, s."""
        self.said.append(word)
        self._said_at = time

    def on_flag(self, time: float, frequency: float, growth_rate: float, *, up: bool) -> str:
        """Take notice of the monitor's flag.

        Args:
            time: Simulated, s.
            frequency: Of the chatter as the monitor has it, Hz; nan if it has none.
            growth_rate: The same, 1/s.
            up: Whether chatter is flagged.

        Returns:
            What that means, for people; empty where the flag is as it was.
        """
        if up == self._is_up:
            return ''
        self._is_up = up
        self.notice(FLAGGED if up else CLEARED, time)
        if not up:
            return 'flag cleared'
        figures = [f'{frequency:.1f} Hz'] if math.isfinite(frequency) else []
        figures += [f'growth {growth_rate:+.1f} 1/s'] if math.isfinite(growth_rate) else []
        return f'chatter flagged{": " if figures else ""}{", ".join(figures)}'

    def due(self, time: float, recommended_speed: float) -> Step | None:
        """The next step, if its time has come: it is played then.

        Args:
            time: Simulated, s.
            recommended_speed: That the monitor recommends, rev/min; nan where there is none. A
                step that wants it waits for it, and gets it as a machinist would set it.
        """
        step = self.next_step
        if step is None or not self._is_due(step, time):
            return None
        changes = dict(step.changes)
        if RECOMMENDED in changes.values():
            if not math.isfinite(recommended_speed):
                return None
            speed = float(round(recommended_speed))
            changes = {n: speed if v == RECOMMENDED else v for n, v in changes.items()}
        del self._steps[0]
        self._said_before_step = len(self.said)
        return replace(step, changes=changes)

    def _is_due(self, step: Step, time: float) -> bool:
        """Whether its time has come, or what it waits for was said long enough ago."""
        if step.at is not None:
            return time >= step.at
        heard = step.when in self.said[self._said_before_step :]
        return heard and time >= self._said_at + step.after
