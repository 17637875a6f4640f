"""Node `chatter_monitor`: listens to the samples of a lathe and flags chatter."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Bool, Float64, String

from lathe_chatter.array_types import Array
from lathe_chatter.detection import Advice, ChatterDetector, Estimate
from lathe_chatter.detection.estimate import FIGURES, HEARD, RECOMMENDED_SPEED, Mode
from lathe_chatter.errors import LatheChatterError
from lathe_chatter.model import Machine
from lathe_chatter.model.lathe_parameter_table import machine_in_cut
from lathe_chatter.model.machine_file import MachineDescription, narrowed
from lathe_chatter.nodes.diagnostics import ERROR, OK, WARN, Diagnostics, Status
from lathe_chatter.nodes.lathe_cut_watch import LatheCutWatch
from lathe_chatter.nodes.listening_clock import ListeningClock
from lathe_chatter.nodes.monitor_sentences import (
    SENTENCES,
    SILENCES,
    best_effort,
    clearance,
    details,
    onset,
    sensors,
    two_publishers,
    withdrawn,
)
from lathe_chatter.nodes.node_main import run_node
from lathe_chatter.nodes.parameter_node import ParameterNode
from lathe_chatter.nodes.parameter_tables import MONITOR, ModelSource
from lathe_chatter.nodes.real_time_loop import spin_in_ticks
from lathe_chatter.nodes.remote_parameters import RemoteMachine
from lathe_chatter.nodes.sample_receiver import SampleBatch, SampleSubscription, SendingPace
from lathe_chatter.precompile import DETECTOR_LOOP, precompile
from lathe_chatter.samples.continuity import BlockOrder, Continuity, times_of

_REST = 40_000_000
"""ns that the node lets samples come in before it looks at them together."""
_REST_ON_WATCH = 10_000_000
"""ns, likewise, while the vibration grows: an alarm may be due."""
_REPORT_PERIOD = 0.05
"""Simulated seconds from one set of figures to the next; a change of state waits for nothing."""
_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_LEVELS = {'chatter': ERROR, 'watch': WARN, 'forced': WARN}
_SILENCE = 1.0  # s
_UNKNOWN = 'unknown'
_FASTEST_PACE = 100.0
"""Simulated seconds that a lathe cuts in one; and those of a backlog."""
_MIXED = 1.0
"""s within which times that leap twice are those of two lathes."""
_IN_ORDER = 1.0
"""Simulated seconds from block to block that are in order."""


class MonitorNode(ParameterNode):
    """Feeds the samples of `lathe/samples` to a `ChatterDetector` and publishes what it says.

    It knows the machine as an impact test would tell it, and nothing of the cut but the
    samples. Columns are found by their labels. A figure that is not known is not published.
    Where no samples come the state is unknown, and the flag stays as it was.

    Args:
        by_timer: Whether a timer lets it look at the samples, so that any executor will do; else
            its loop calls `wake` (`real_time_loop.spin_in_ticks`).
        options: As for `rclpy.node.Node`.

    Raises:
        ParameterError: If a parameter given at the start is not allowed.
    """

    def __init__(self, *, by_timer: bool = True, **options: Any) -> None:
        """Begin with the flag down and nothing known."""
        super().__init__('chatter_monitor', MONITOR, **options)
        # Before the first sample comes.
        precompile(DETECTOR_LOOP, say=self.bounded_log.info)
        source = ModelSource(self.values['model'])
        self.machine: Machine | None = None
        if source is ModelSource.PARAMETERS:
            self.machine = machine_in_cut(self.values)
        self._asked: RemoteMachine | None = None
        if source is ModelSource.LATHE:
            self._asked = RemoteMachine(self, self._learn)
        self._speed_range = self._own_speeds()
        self._detector = self._new_detector()
        self._lathe_cut = LatheCutWatch(self, self._follow_depth, self._ask)
        self._continuity, self._pace = Continuity(), SendingPace()
        self._since, self._complaint = 'nothing yet', ''
        self._state, self._flag, self._flag_since = _UNKNOWN, False, math.nan
        self._logged_advice, self._mode, self._faults = Advice(), Mode.WAITING, tuple[str, ...]()
        self._senders, self._silence = list[str](), ''  # several senders: nothing is judged
        self._heard_at = self._leapt_at = self._newest = self._next_report = -math.inf
        self._figures, self._details = dict[str, float](), dict[str, object]()
        self._listening = ListeningClock()  # to the samples
        self._reported_lost = 0

        self._flag_publisher = self.advertise(Bool, '~/chatter', _LATCHED)
        self._state_publisher = self.advertise(String, '~/state', _LATCHED)
        self._figure_publishers = {
            name: self.advertise(Float64, f'~/{name}', QoSProfile(depth=1000)) for name in FIGURES
        }
        self._diagnostics = Diagnostics(self, 'chatter monitor')
        self._flag_publisher.publish(Bool(data=self._flag))
        self._state_publisher.publish(String(data=self._state))
        self._subscription = SampleSubscription(self, self._complain)
        self._wake_at = time.monotonic_ns()
        if by_timer:
            self.every(_REST_ON_WATCH / 1e9, self.wake)
        self.every(1.0, self._report)

    # -- listening -------------------------------------------------------------------------

    def next_wake(self) -> int:
        """When it looks at its samples next, ns of time.monotonic_ns()."""
        return self._wake_at

    def update_scheduling(self) -> None:
        """It needs no place of its own in the scheduling: late is not wrong."""

    def wake(self) -> None:
        """Take the blocks that have come."""
        rest = _REST_ON_WATCH if self._state == 'watch' else _REST
        self._wake_at = time.monotonic_ns() + rest
        self._listening.now()  # a clock that nobody reads takes that for a standstill
        for batch in self._subscription.take():
            self._take(batch)

    def _take(self, batch: SampleBatch) -> None:
        samples, columns = batch.samples, batch.columns
        try:
            if batch.evenly:
                times: Array = samples[:, columns.index('time')]
            else:
                times = times_of(samples, columns)
            if not self._follow(times, batch.sent):
                return
            estimate = self._detector.update(samples, columns)
        except LatheChatterError as error:
            self._complain(error)
            return
        self._complaint = ''
        # Of a machine that is yet to be told the spindle may not have the speed; one that has just
        # been told soon knows better.
        if estimate.request is not None and estimate.request.machine is None:
            asked, senders = self._asked, self._subscription.publishers()
            if estimate.mode.knows_machine or (asked is not None and asked.is_awaited(senders)):
                estimate = replace(estimate, request=None)
        self._publish(estimate)

    def _complain(self, error: LatheChatterError) -> None:
        self._complaint = str(error)
        self.bounded_log.error(self._complaint, 'complaint')

    def _follow(self, times: Array, sent: tuple[int, int]) -> bool:
        """Notice lost samples and another lathe; whether the samples can be judged."""
        now, heard_at = time.monotonic(), self._heard_at
        before, self._heard_at = self._continuity.last, now
        self._listening.hear()
        if self._senders:
            self._follow_mixture(times, now)
            return False
        # What a lathe cannot have cut meanwhile was not lost.
        possible = _FASTEST_PACE * (now - heard_at) + _FASTEST_PACE
        jumped = before is not None and times[0] - before > possible

        def is_another() -> bool:
            many = len(self._subscription.publishers()) > 1  # with one that was killed of late
            mixed = many and not self._pace.allows(times[0], sent[0])
            return jumped or mixed or self._subscription.has_new_publisher()

        order = self._continuity.join(times, is_another)
        self._pace.follow(times, sent, begins=order in {BlockOrder.FIRST, BlockOrder.RESTART})
        start = f'{times[0]:.6f} s'
        if order is BlockOrder.GAP:
            self._say('lost', f'At {before:.6f} s: the samples up to {start} did not come.')
        if order in {BlockOrder.CONTIGUOUS, BlockOrder.GAP}:
            self._end_silence(start)
            return True
        if order is BlockOrder.RESTART and self._is_mixture(now):
            return False
        self._subscription.remember_publishers()
        self._since = f'{times[0]:.6f}'
        if order is BlockOrder.FIRST:
            self._silence = ''
            self._say('listening', f'Listening from {start} on.')
            return True
        if jumped:
            why = 'more than a lathe can have cut meanwhile: I begin anew there'
            jump = f'the times of the samples jump to {start}, {why}'
            self._say('jump', f'At {before:.6f} s: {jump}.')
        else:
            again = f'the lathe started again, and I with it from {start} on'
            self._say('restart', f'At {before:.6f} s: {again}.')
        self._silence = ''
        self._flag_since = math.nan  # a time of the run before is none of this one
        if self._flag:
            self._say('withdrawn', withdrawn(times[0]))
            self._set_flag(times[0], raised=False)
        self._detector = self._new_detector()
        self._next_report = -math.inf
        self._lathe_cut.forget()
        self._ask()  # it may be another machine
        return True

    def _end_silence(self, start: str) -> None:
        if self._silence:
            self._silence = ''
            self._say('samples again', f'At {start}: samples come again.')

    def _is_mixture(self, now: float) -> bool:
        """Whether two lathes send at once: times leap again, within a second, and many publish."""
        leapt_at, self._leapt_at = self._leapt_at, now
        names = self._subscription.publishers()
        if len(names) < 2 or now - leapt_at > _MIXED:
            return False
        self._senders = names
        self._say('two publishers', two_publishers(names, self._subscription.topic))
        self._set_state(_UNKNOWN)
        self._diagnostics.publish_changes(self._statuses())
        return True

    def _follow_mixture(self, times: Array, now: float) -> None:
        """While two lathes send: wait until what comes is in order again."""
        newest, self._newest = self._newest, float(times[-1])
        if not 0.0 < times[0] - newest < _IN_ORDER:
            self._leapt_at = now
        many = len(self._subscription.publishers()) > 1
        if now - self._leapt_at > (2.0 * _MIXED if many else 0.0):
            self._senders = []
            self._continuity.last = None

    def _follow_depth(self, depth: float) -> None:
        self._detector.follow_depth(depth)

    def _ask(self) -> None:
        if self._asked is not None:
            self._asked.ask()

    def _learn(self, machine: Machine, file: MachineDescription | None) -> None:
        """Take the machine that the lathe says it is, with the speeds that its spindle has."""
        speeds = self._own_speeds()
        if file is not None:
            speeds = narrowed(speeds, file.speed_range) or (file.slowest_speed, file.fastest_speed)
        if (machine, speeds) != (self.machine, self._speed_range):
            self.machine, self._speed_range = machine, speeds
            turns = f', with speeds from {speeds[0]:g} to {speeds[1]:g} rev/min' if file else ''
            self._say('machine', f'The lathe has told what machine it is{turns}.')
            self._detector.set_machine(machine, speeds)

    def _own_speeds(self) -> tuple[float, float]:
        numbers: Mapping[str, Any] = self.values
        return numbers['slowest_speed'], numbers['fastest_speed']

    def _new_detector(self) -> ChatterDetector:
        numbers = {name: value for name, value in self.values.items() if isinstance(value, float)}
        return ChatterDetector(
            self.machine,
            speed_range=self._speed_range,
            lowest_frequency=numbers['lowest_frequency'],
            highest_frequency=numbers['highest_frequency'],
            nominal_rpm=numbers['spindle_speed_rpm'],
        )

    # -- what is said ----------------------------------------------------------------------

    def _say(self, kind: str, text: str) -> None:
        """Log a sentence of `monitor_sentences.SENTENCES`."""
        getattr(self.bounded_log, SENTENCES[kind].severity)(text, kind)

    def _publish(self, estimate: Estimate) -> None:
        """Publish what is new: the figures, the flag that they explain, and what to do."""
        flagged = estimate.chatter != self._flag
        changed = flagged or (estimate.state, estimate.faults) != (self._state, self._faults)
        if is_due := changed or estimate.time >= self._next_report:
            if math.isfinite(estimate.time):  # not before the first hop
                self._next_report = (estimate.time // _REPORT_PERIOD + 1.0) * _REPORT_PERIOD
            self._figures = {}
            self._publish_figures(estimate, *HEARD)
        self._set_state(estimate.state)
        if flagged:
            self._set_flag(estimate.time, raised=estimate.chatter)
        if is_due:  # no flag waits until a speed has been found
            self._publish_figures(estimate, RECOMMENDED_SPEED)
            self._details = details(estimate)
        self._say_what_is_new(estimate, flagged=flagged)
        if changed:
            self._diagnostics.publish_changes(self._statuses())

    def _say_what_is_new(self, estimate: Estimate, *, flagged: bool) -> None:
        if estimate.faults != self._faults:
            self._faults = estimate.faults
            self._say('sensors' if self._faults else 'sensors well', sensors(estimate))
        if estimate.mode is not self._mode:
            self._say_machine_fit(estimate)
        if flagged:
            kind, sentence = ('onset', onset) if self._flag else ('clearance', clearance)
            self._say(kind, sentence(estimate))
            self._logged_advice = estimate.advice
        elif advice := estimate.advice.after(self._logged_advice):
            self._say('advice', f'At {estimate.time:.6f} s: {advice}.')
            self._logged_advice = estimate.advice

    def _say_machine_fit(self, estimate: Estimate) -> None:
        """That the machine is believed no more, otherwise, or again."""
        before, self._mode = self._mode, estimate.mode
        if estimate.mode in {Mode.MISFIT, Mode.CORRECTED}:
            self._say('machine fit', f'At {estimate.time:.6f} s: {estimate.machine_fit}.')
        elif before is Mode.MISFIT and estimate.mode is Mode.FULL:
            fits = 'the machine fits what is heard, and is believed again'
            self._say('machine fits', f'At {estimate.time:.6f} s: {fits}.')

    def _set_flag(self, at: float, *, raised: bool) -> None:
        self._flag, self._flag_since = raised, at
        self._flag_publisher.publish(Bool(data=raised))

    def _set_state(self, state: str) -> None:
        if state != self._state:
            self._state = state
            self._state_publisher.publish(String(data=state))

    def _publish_figures(self, estimate: Estimate, *names: str) -> None:
        for name in names:
            if math.isfinite(value := float(getattr(estimate, name))):
                self._figures[name] = value
                self._figure_publishers[name].publish(Float64(data=value))

    # -- diagnostics -----------------------------------------------------------------------

    def _report(self) -> None:
        """Once a second; a second without samples means that nothing is known any more."""
        if self._subscription.adapt():
            self._say('best effort', best_effort(self._subscription.topic))
        if self._asked is not None and not self._asked.answered:
            self._asked.ask()
        last, silence = self._continuity.last, self._silence_kind()
        if silence and self._senders:
            self._senders, self._continuity.last = [], None
        elif silence and silence != self._silence and last is not None:
            self._figures, self._details = {}, {}
            self._set_state(_UNKNOWN)
            more = ' any more' if silence == 'silence' else ''
            self._say(silence, f'At {last:.6f} s: {SILENCES[silence]}{more}.')
        if not silence:
            self._subscription.remember_publishers()
        self._silence = silence
        self._diagnostics.publish(self._statuses())
        self._reported_lost = self._continuity.lost

    def _silence_kind(self) -> str:
        """Of `SILENCES`; what came while this node stood still waits, and is none."""
        if not self._listening.misses(_SILENCE):
            return ''
        stood = self._listening.stood_still_near(self._listening.heard_at, _SILENCE)
        return 'standstill' if stood else 'silence'

    def _statuses(self) -> list[Status]:
        since = {'flag since, s': self._flag_since} if math.isfinite(self._flag_since) else {}
        cut = {'state': self._state, 'flag': self._flag, **since, **self._figures, **self._details}
        # Whether the chatter of a flag that is up goes on is not known then.
        level = WARN if self._silence and self._flag else _LEVELS.get(self._state, OK)
        return [self._samples_status(), Status('cut', level, self._state, cut)]

    def _samples_status(self) -> Status:
        heard = self._continuity
        values = {
            'samples': heard.samples,
            'samples lost': heard.lost,
            'gaps': heard.gaps,
            'restarts of the lathe': heard.restarts,
            'simulated time, s': heard.last if heard.last is not None else 'none yet',
            'listening from, s': self._since,
        }
        if self._complaint:
            return Status('samples', ERROR, self._complaint, values)
        if self._senders:
            several = two_publishers(self._senders, self._subscription.topic)
            return Status('samples', ERROR, several, values)
        if self._silence:
            return Status('samples', WARN, SILENCES[self._silence], values)
        if self._faults:
            return Status('samples', WARN, ', '.join(self._faults), values)
        if heard.lost > self._reported_lost:
            return Status('samples', WARN, 'samples were lost', values)
        return Status('samples', OK, 'all samples came', values)


def main() -> None:
    """Run the node until it is told to end."""
    run_node(
        lambda own: MonitorNode(by_timer=False, cli_args=own['chatter_monitor']),
        {'chatter_monitor': MONITOR},
        spin=spin_in_ticks,
    )
