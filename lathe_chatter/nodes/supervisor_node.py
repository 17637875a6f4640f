"""Node `chatter_supervisor`: acts on chatter through public topics, parameters and services."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message
from std_msgs.msg import Bool, Float64, String
from std_srvs.srv import SetBool, Trigger

from lathe_chatter.detection.estimate import CHATTER, HEARD, UNKNOWN
from lathe_chatter.detection.estimate import Mode as Works
from lathe_chatter.errors import LatheChatterError, ParameterError
from lathe_chatter.model import Cut, Machine
from lathe_chatter.model.lathe_parameter_table import (
    checked_parameters,
    cut_from,
    described_by,
    machine_from,
)
from lathe_chatter.model.machine_file import narrowed
from lathe_chatter.model.parameter_table import Value
from lathe_chatter.nodes.diagnostics import OK, WARN, Diagnostics, DiagnosticsListener, Status
from lathe_chatter.nodes.listening_clock import DISCOVERY, ListeningClock
from lathe_chatter.nodes.monitor_sentences import TOOL_FREQUENCY
from lathe_chatter.nodes.node_main import run_node
from lathe_chatter.nodes.parameter_node import ParameterNode
from lathe_chatter.nodes.parameter_tables import SUPERVISOR, ModelSource
from lathe_chatter.nodes.polled_subscription import PolledSubscription, node_gids
from lathe_chatter.nodes.remote_parameters import RemoteParameters
from lathe_chatter.nodes.supervisor_limits import limits_from, unsuited
from lathe_chatter.precompile import LATHE_LOOP, MOVE_LOOPS, precompile
from lathe_chatter.supervisor import NO_MACHINE, Action, Limits, Mode, Seen, Supervisor

_LOOK_PERIOD = 0.02
_SILENCE = 1.0
"""s without a word of the monitor after which it is taken for silent."""
_LOSS = 2.0
"""s after lost samples in which nothing is done."""
_NO_ANSWER = 2.0
"""s in which the lathe has to answer."""
_STOOD_STILL = 'this node stood still, and does not hear the monitor yet'
_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_SENTENCES = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Two may come at once; who comes late has the newest."""
_NOT_JUDGED = {'', UNKNOWN, CHATTER}
"""States in which a flag that falls is no end of the chatter: the flag is that of another cut."""
_BELIEVED = {Works.FULL.value, Works.CORRECTED.value}


class SupervisorNode(ParameterNode):
    """Tells a `Supervisor` what it hears, and carries out what that decides.

    It knows the machine as the monitor was told it, and the cut as the lathe has it. It keeps
    no promise that its own end would break: a lathe whose supervisor was killed cuts on as it is.

    Args:
        options: As for `rclpy.node.Node`.

    Raises:
        ParameterError: If a parameter given at the start is not allowed.
    """

    def __init__(self, **options: Any) -> None:
        """Listen, and hold still until it is known who else is there."""
        super().__init__('chatter_supervisor', SUPERVISOR, **options)
        self._began = time.monotonic()
        # Before there is any hurry: moves are rehearsed on a virtual lathe.
        precompile(LATHE_LOOP, MOVE_LOOPS, say=self.bounded_log.info)
        self._figures: dict[str, tuple[float, float]] = {}  # with the time of each
        self._state = ''
        self._chatter: bool | None = None  # until the monitor has said
        self._listening = ListeningClock()  # of what is missed, and of answers
        self._heard_at = self._lost_at = -math.inf
        self._lost = self._restarts = self._cut_end = -1.0
        self._gids: frozenset[tuple[int, ...]] = frozenset()  # of the lathe
        self._reports = DiagnosticsListener()
        self._told: dict[str, dict[str, Any]] = {}  # of lathe and monitor
        self._cut_is_new = False  # for the monitor's figures
        self._sent: dict[str, Any] = {}
        self._cut: Cut | None = None
        self._machine: Machine | None = None
        self._no_speed = ''
        self._warned_of: set[str] = set()
        self._answer: tuple[Any, float] | None = None
        self._answered_at = 0.0  # by a clock that began with the machine
        self._newest = 'nothing was done yet'
        self._set = self.create_client(SetParametersAtomically, 'lathe/set_parameters_atomically')
        self._pause = self.create_client(SetBool, 'lathe/pause')
        self._lathe, self._monitor = map(self.full_name_of, ('lathe', 'chatter_monitor'))
        self._core = self._new_core()
        self._remote = RemoteParameters(self, self._take_parameters)
        for name in HEARD:
            take = partial(self._on_figure, name)
            self.create_subscription(Float64, f'chatter_monitor/{name}', take, QoSProfile(depth=1))
        for kind, topic, qos, hear in (
            (String, 'chatter_monitor/state', _LATCHED, self._on_state),
            (DiagnosticArray, '/diagnostics', QoSProfile(depth=10), self._on_diagnostics),
            (ParameterEvent, '/parameter_events', QoSProfile(depth=100), self._on_event),
        ):
            self.create_subscription(kind, topic, hear, qos)
        self._flags = PolledSubscription(self, Bool, 'chatter_monitor/chatter', _LATCHED)
        self._action = self.advertise(String, '~/action', _SENTENCES)
        self._diagnostics = Diagnostics(self, 'chatter supervisor')
        self.create_service(Trigger, '~/accept', self._on_accept)
        self.every(_LOOK_PERIOD, self._look)
        self.every(1.0, self._report)

    def _refusal(self, parameters: list[Parameter]) -> str:
        """Also where limits would contradict each other."""
        given = {p.name: p.value for p in parameters if p.name in self._table}
        if refusal := super()._refusal(parameters):
            return refusal
        try:
            limits_from({**self.values, **given})
        except ParameterError as error:
            return str(error)
        return ''

    def _new_core(self) -> Supervisor:
        values: Mapping[str, Any] = self.values
        names = ('machine_error', 'margin_limit', 'move_early', 'hands_off')
        options = {name: values[name] for name in names}
        return Supervisor(self._limits(), Mode(values['mode']), **options, begun=time.monotonic())

    def _limits(self) -> Limits:
        """Its own, and those of the spindle as far as the lathe's or the monitor's machine tells.

        Raises:
            LatheChatterError: If that machine is none.
        """
        limits, self._no_speed = limits_from(self.values), ''
        files = (described_by(self._told.get(name, {})) for name in (self._lathe, self._monitor))
        spindle = next((f.speed_range for f in files if f and f.speed_range), None)
        if self._cut is not None:
            for sentence in unsuited(limits, self._cut, spindle):
                if sentence not in self._warned_of:
                    self._warned_of.add(sentence)
                    self.bounded_log.warning(sentence, 'limits')
        speeds = narrowed((limits.slowest_speed, limits.fastest_speed), spindle)
        if speeds is None:
            self._no_speed = 'the spindle has no speed from slowest_speed to fastest_speed'
            return limits
        return replace(limits, slowest_speed=speeds[0], fastest_speed=speeds[1])

    def parameters_accepted(self, changed: Mapping[str, Value]) -> None:
        """Begin anew with what was set."""
        self._core = self._new_core()
        self._say(f'From now on: {", ".join(f"{n} = {v}" for n, v in changed.items())}.', 'set')

    # -- listening -----------------------------------------------------------------------------

    def _on_figure(self, name: str, message: Float64) -> None:
        self._heard_at = self._listening.now()
        self._figures[name] = message.data, time.monotonic()

    def _newest_flag(self) -> bool | None:
        """The flag as it is now, also in the middle of a decision; None until it was heard."""
        for data, _ in self._flags.take():
            self._chatter = deserialize_message(data, Bool).data
        return self._chatter

    def _on_state(self, message: String) -> None:
        self._state, self._heard_at = message.data, self._listening.now()

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        self._reports.take(message)
        end = self._reports.number(self._lathe, 'cut', 'simulated time, s', self._cut_end)
        if end < self._cut_end:  # also where the monitor has not heard both runs
            self._begin_again()
        self._cut_end = end
        if not any(status.name.startswith(f'{self._monitor}: ') for status in message.status):
            return
        self._cut_is_new = False
        number = partial(self._reports.number, self._monitor, 'samples')
        lost = number('samples lost', self._lost)
        if lost > self._lost >= 0:
            self._lost_at = time.monotonic()
        restarts = number('restarts of the lathe', 0.0)
        if restarts > self._restarts >= 0:
            self._begin_again()
        self._lost, self._restarts = lost, restarts

    def _begin_again(self) -> None:
        """Another run, of what may be another machine with another cut."""
        self._say_of(self._core.another_run())
        self._ask_again()

    def _follow_lathe(self) -> bool:
        """Ask another lathe that has come what it is; whether none has."""
        known = node_gids(self)[self._lathe] <= self._gids
        if not known:
            self._begin_again()
        return known

    def _ask_again(self) -> None:
        """What the lathe is, is not known any more."""
        self._cut = None
        self._told.pop(self._lathe, None)
        self._remote.want_again(self._lathe)

    def _on_event(self, event: ParameterEvent) -> None:
        """Follow the lathe; what this node has not set somebody else has."""
        known = self._told.get(event.node)
        if event.node != self._lathe or not known:
            return
        entries = (*event.new_parameters, *event.changed_parameters)
        values = {p.name: parameter_value_to_python(p.value) for p in entries}
        try:
            changed = {n: v for n, v in checked_parameters(values).items() if known.get(n) != v}
            if any(self._sent.get(name) != value for name, value in changed.items()):
                self._say_of(self._core.hand_moved(time.monotonic()))
            self._take_changes(changed)
        except LatheChatterError as error:  # of somebody else, for the lathe takes no such value
            self._doubt(self._lathe, error)
            self._ask_again()

    def _take_changes(self, changed: Mapping[str, Any]) -> None:
        """The lathe has changed."""
        if changed:
            self._told[self._lathe] |= changed
            self._cut = cut_from(self._told[self._lathe])
            self._cut_is_new = True

    def _take_parameters(self, name: str, values: dict[str, Any]) -> None:
        known = {n: v for n, v in values.items() if v is not None}
        try:
            self._told[name] = checked_parameters(known) if name == self._lathe else known
        except LatheChatterError as error:
            self._doubt(name, error)
            return
        told = self._told.get(self._monitor, {})
        source = told.get('model', ModelSource.NONE.value)
        if source == ModelSource.LATHE.value:
            told = self._told.get(self._lathe, {})
        try:
            if name == self._lathe:
                self._gids = node_gids(self)[name]
                self._take_changes(self._told[name])
            self._core.limits = self._limits()
            if told and source != ModelSource.NONE.value:
                self._machine = machine_from(told)
        except LatheChatterError as error:
            self._doubt(name, error)

    def _doubt(self, name: str, error: LatheChatterError) -> None:
        self.bounded_log.error(f'{name} does not say what it is: {error}', name)

    # -- acting --------------------------------------------------------------------------------

    def _seen(self, cut: Cut) -> Seen:
        now, flag = time.monotonic(), self._newest_flag()
        # What is not known any more is not published any more.
        fresh = {n: value for n, (value, at) in self._figures.items() if now < at + _SILENCE}
        works_with = self._reports.values(self._monitor, 'cut').get('works with')
        self._core.machine = self._machine if works_with in _BELIEVED else None
        number = partial(self._reports.number, self._monitor, 'cut')
        stiffness = math.nan if self._cut_is_new else number('C w, N/m')
        return Seen(
            now,
            cut,
            bool(flag),
            **fresh,
            cutting_stiffness=stiffness,
            tool_frequency=number(TOOL_FREQUENCY),
            spindle_acceleration=float(self._told[self._lathe].get('spindle_acceleration', 0.0)),
            lasted=self._lasted(now),
            hindrance=self._hindrance(),
            judged=self._state not in _NOT_JUDGED
            and not self._listening.is_silent(self._heard_at, _SILENCE),
            flag_stays=lambda: self._newest_flag() == flag,
        )

    def _lasted(self, now: float) -> float:
        """s that the newest change has been in force: from the tick after the answer at latest."""
        told = self._told[self._lathe]
        reached = self._reports.number(self._lathe, 'pace', 'real-time factor', 1.0)
        pace = min(reached, float(told.get('real_time_factor') or 1.0), 1.0)
        return pace * (now - self._answered_at) - 1.0 / float(told.get('tick_rate', math.inf))

    def _hindrance(self) -> str:
        """Why nothing may be done, as the end of a sentence; empty where it may."""
        silent = self._listening.is_silent(self._heard_at, _SILENCE)
        reasons = {
            'it is not known yet who else is there': time.monotonic() < self._began + DISCOVERY,
            _STOOD_STILL: silent and self._listening.stood_still_near(self._heard_at, _SILENCE),
            'nothing comes from the monitor': silent,
            'the monitor does not know the state of the cut': self._state == UNKNOWN,
            'samples were lost': time.monotonic() < self._lost_at + _LOSS,
            'there is another supervisor': self.count_publishers('~/action') > 1,
            'the lathe cannot be reached': not self._set.service_is_ready(),
        }
        return next((reason for reason, holds in reasons.items() if holds), self._no_speed)

    def _look(self) -> None:
        if self._answer is not None:
            asked = self._answer[1], _NO_ANSWER
            silent = self._listening.is_silent(*asked)
            if silent and not self._listening.stood_still_near(*asked):
                self._answer = None
                self._say_of(self._core.refused('the lathe does not answer'))
        elif self._cut is not None and self._newest_flag() is not None:
            seen = self._seen(self._cut)
            # After a standstill the monitor soon speaks again.
            action = self._core.look(seen) if seen.hindrance != _STOOD_STILL else None
            if action is not None and self._follow_lathe():
                self._do(action)

    def _on_accept(self, _request: Any, response: Any) -> Any:
        response.message = 'The lathe is not known yet.'
        if self._follow_lathe() and self._cut is not None:
            done, message, action = self._core.accept(self._seen(self._cut))
            response.success, response.message = done, message
            self._do(action)
        return response

    def _do(self, action: Action | None) -> None:
        if action is None:
            return
        self._say_of(action)
        if action.stop:
            self._wait(self._pause.call_async(SetBool.Request(data=True)))
        elif action.changes:
            self._sent |= action.changes
            entries = [Parameter(n, value=v) for n, v in action.changes.items()]
            request = SetParametersAtomically.Request(
                parameters=[entry.to_parameter_msg() for entry in entries]
            )
            self._wait(self._set.call_async(request), action.changes)

    def _wait(self, future: Any, changes: Mapping[str, float] | None = None) -> None:
        """Until the lathe has answered; nothing else is decided meanwhile."""
        self._answer = future, self._listening.now()

        def answered(done: Any) -> None:
            if self._answer is None or self._answer[0] is not done:
                return  # given up
            self._answer, self._answered_at = None, time.monotonic()
            result = done.result()
            result = getattr(result, 'result', result)
            success = getattr(result, 'successful', getattr(result, 'success', False))
            if not success:
                reason = getattr(result, 'reason', getattr(result, 'message', ''))
                self._say_of(self._core.refused(f'the lathe refused: {reason}'))
            elif changes is not None:
                self._take_changes(changes)

        future.add_done_callback(answered)

    # -- what is said --------------------------------------------------------------------------

    def _say_of(self, action: Action | None) -> None:
        if action is not None and action.sentence:
            self._say(action.sentence)

    def _say(self, sentence: str, kind: str = 'action') -> None:
        self._newest = sentence
        self.bounded_log.info(sentence, kind)
        self._action.publish(String(data=sentence))
        self._diagnostics.publish(self._statuses())

    def _report(self) -> None:
        """Once a second."""
        self._follow_lathe()
        self._remote.ask(self._lathe)
        self._remote.ask(self._monitor)
        self._remote.look()
        self._diagnostics.publish(self._statuses())

    def _statuses(self) -> list[Status]:
        hindrance = self._hindrance()
        if self._core.machine is None:
            hindrance = hindrance or NO_MACHINE
        values = {
            'mode': self._core.mode.value,
            'moves against the present chatter': self._core.moves,
            'newest sentence': self._newest,
        }
        able = f'nothing can be done: {hindrance}' if hindrance else 'ready'
        return [Status('action', WARN if hindrance else OK, able, values)]


def main() -> None:
    """Run the node until it is told to end."""
    name = 'chatter_supervisor'
    run_node(lambda own: SupervisorNode(cli_args=own[name]), {name: SUPERVISOR})
