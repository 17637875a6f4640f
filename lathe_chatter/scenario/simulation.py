"""A scenario played without ROS, as fast as the machine allows, into a run like any other.

Lathe, monitor and record are those of the nodes; only the operator is a loop. Blocks end where
a step is due, so a change that has a time takes effect at the sample that it names.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from lathe_chatter.detection import Advice, ChatterDetector, Estimate
from lathe_chatter.detection.estimate import FIGURES
from lathe_chatter.detection.speed_adviser import speeds_to_recommend
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.lathe.change_and_knock_sentences import (
    BEGINNING,
    Knock,
    change_sentence,
    knock_sentence,
)
from lathe_chatter.lathe.config import LatheConfig, config_from
from lathe_chatter.model.lathe_parameter_table import LATHE, described_by, machine_in_cut
from lathe_chatter.model.machine_file import MachineDescription
from lathe_chatter.recording import LatheRun
from lathe_chatter.scenario.player import ScenarioPlayer
from lathe_chatter.scenario.scenario import CLEARED, FLAGGED, Scenario, Step

_BLOCK, _WATCHED_BLOCK = 0.05, 0.01
"""s of samples in one message, without a monitor and with one."""
_REPORT_PERIOD = 0.02
_MONITOR = '/chatter_monitor'

Tell = Callable[[float, str], None]
"""Takes simulated time, s, and what happened then."""


@dataclass(frozen=True)
class Simulated:
    """What came of a simulation.

    Attributes:
        folder: Of the run.
        samples: That it has.
        time: Simulated, s.
        flagged: Whether the monitor flagged chatter; None without a monitor.
        cleared: Whether its flag was down in the end after it had been up.
        guard: Why the lathe ended before the scenario did, as a sentence, or empty.
    """

    folder: Path
    samples: int
    time: float
    flagged: bool | None
    cleared: bool | None
    guard: str


def needs_monitor(scenario: Scenario) -> bool:
    """Whether a step waits for the monitor, or something is expected of it."""
    return bool(scenario.expect) or any(step.when is not None for step in scenario.steps)


def simulate(  # noqa: PLR0913 -- what is played, where to, who watches and who is told
    scenario: Scenario,
    folder: Path | str,
    *,
    knocks: Sequence[Knock] = (),
    monitor: bool = True,
    progress: Callable[[float], None] = lambda _time: None,
    tell: Tell = lambda _time, _what: None,
) -> Simulated:
    """Play a scenario on a lathe and record it.

    Args:
        scenario: Parameters, steps, duration.
        folder: Of the run, to make.
        knocks: On the tool.
        monitor: Whether a detector watches; steps that wait for it never come without.
        progress: Is told the simulated time now and then, s.
        tell: Is told what happens.

    Raises:
        ParameterError: If a parameter is unknown or not allowed.
        RunExistsError: If the folder exists.
        OSError: If it cannot be written.
    """
    folder, config = Path(folder), config_from(scenario.parameters)
    lathe = config.lathe()
    with LatheRun(folder, config.parameters(), simulated=True) as run:
        run.log(BEGINNING)
        simulation = _Simulation(lathe, run, scenario, knocks, tell)
        simulation.described = config.described
        if monitor:
            simulation.watch(_detector_for(config, scenario))
        simulation.log_doubts()
        while simulation.play_block():
            progress(lathe.time)
    said = simulation.player.said
    return Simulated(
        folder,
        lathe.samples_taken,
        lathe.time,
        FLAGGED in said if monitor else None,
        said[-1:] == [CLEARED] if monitor else None,
        lathe.guard,
    )


def _detector_for(config: LatheConfig, scenario: Scenario) -> ChatterDetector:
    """One that knows the machine, and recommends what its spindle can."""
    described = described_by(scenario.parameters)
    speeds = speeds_to_recommend(described.speed_range if described else None)
    steady = not any('bearing_contact' in step.changes for step in scenario.steps)
    machine = machine_in_cut(scenario.parameters) if steady else config.machine
    return ChatterDetector(machine, speed_range=speeds)


class _Simulation:
    """One scenario on one lathe."""

    def __init__(
        self,
        lathe: VirtualLathe,
        run: LatheRun,
        scenario: Scenario,
        knocks: Sequence[Knock],
        tell: Tell,
    ) -> None:
        self.player = ScenarioPlayer(scenario)
        self._lathe, self._run, self._log = lathe, run, tell
        self._end = self._sample_of(scenario.duration)
        self._knocks = sorted(knocks, key=lambda knock: knock.time)
        self._detector: ChatterDetector | None = None
        self._estimate = Estimate()
        self._next_report = 0.0
        self._flag, self._state = False, ''
        self._doubts: list[str] = []
        self.described: MachineDescription | None = None
        self._told_advice = Advice()

    def watch(self, detector: ChatterDetector) -> None:
        """Have a detector look at every block from now on."""
        self._detector = detector
        self._run.publish(f'{_MONITOR}/chatter', 'std_msgs/msg/Bool', data=False)

    def play_block(self) -> bool:
        """Do what is due and cut on for a block; whether there is more to do."""
        now = self._lathe.samples_taken
        while step := self._due():
            self._play(step)
        while self._knocks and self._sample_of(self._knocks[0].time) <= now:
            self._knock(self._knocks.pop(0).impulse)
        if now >= self._end:
            return False
        samples = self._lathe.advance(self._next_stop() - now)
        if len(samples):
            self._run.write(samples)
            if self._detector is not None:
                self._detector.follow_depth(self._lathe.cut.depth_of_cut)
                self._on_estimate(self._detector.update(samples, self._lathe.columns))
        return not self._lathe.guard

    def _sample_of(self, time: float) -> int:
        """The sample after which something happens that is to happen at a time, s."""
        return round(time * self._lathe.sample_rate)

    def _next_stop(self) -> int:
        """The sample at which the block ends: at once a block's length or the next event."""
        length = _BLOCK if self._detector is None else _WATCHED_BLOCK
        now = self._lathe.samples_taken
        times = [knock.time for knock in self._knocks[:1]]
        if math.isfinite(self.player.next_time):
            times.append(self.player.next_time)
        stops = [self._end, now + max(self._sample_of(length), 1), *map(self._sample_of, times)]
        return max(min(stops), now + 1)

    # -- acting ----------------------------------------------------------------------------

    def log_doubts(self) -> None:
        """Why the samples may not be what was meant; each sentence once."""
        speed = self.described.speed_doubt(self._lathe.cut) if self.described else ''
        lacking = ''
        if self.described:
            lacking = self.described.assumption(self._lathe.machine, self._lathe.cut)
        for sentence in (*self._lathe.doubts, speed, lacking):
            if sentence and sentence not in self._doubts:
                self._doubts.append(sentence)
                self._log(self._lathe.time, sentence)

    def _due(self) -> Step | None:
        """The next step, if its time is nearer to this sample than to the next."""
        time = self._lathe.time + 0.5 / self._lathe.sample_rate
        return self.player.due(time, self._estimate.recommended_speed_rpm)

    def _play(self, step: Step) -> None:
        meant = {n: v for n, v in step.changes.items() if n not in LATHE or not LATHE[n].node_only}
        cut = self._lathe.cut.with_changes(**meant)
        sentence = change_sentence(self._lathe.time, self._lathe.cut, cut)
        self._lathe.retune(cut)
        if sentence:
            self._run.log(sentence)
        self._log(self._lathe.time, str(replace(step, changes=meant)))
        self.log_doubts()

    def _knock(self, impulse: float) -> None:
        self._run.log(knock_sentence(self._lathe.time, impulse))
        self._lathe.knock(impulse)
        self._log(self._lathe.time, f'knock of {impulse:g} N s')

    # -- listening -------------------------------------------------------------------------

    def _on_estimate(self, estimate: Estimate) -> None:
        """Record what the detector says, the figures before the flag that they explain."""
        self._estimate = estimate
        changed = estimate.state != self._state or estimate.chatter != self._flag
        if changed or estimate.time >= self._next_report:
            self._next_report = estimate.time + _REPORT_PERIOD
            for name in FIGURES:
                value = float(getattr(estimate, name))
                if math.isfinite(value):
                    self._run.publish(f'{_MONITOR}/{name}', 'std_msgs/msg/Float64', data=value)
        if estimate.state != self._state:
            self._state = estimate.state
            self._run.publish(f'{_MONITOR}/state', 'std_msgs/msg/String', data=self._state)
        if estimate.chatter != self._flag:
            self._flag = estimate.chatter
            self._run.publish(f'{_MONITOR}/chatter', 'std_msgs/msg/Bool', data=self._flag)
        what = self.player.on_flag(
            self._lathe.time, estimate.frequency, estimate.growth_rate, up=estimate.chatter
        )
        if what:
            self._log(self._lathe.time, what)
            self._told_advice = Advice()
        if not estimate.chatter:
            return
        words = estimate.advice.after(self._told_advice, self._lathe.cut.depth_of_cut)
        if words:
            self._told_advice = estimate.advice
            self._log(self._lathe.time, f'advice: {words}')
