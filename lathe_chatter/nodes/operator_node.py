"""The operator: plays a scenario on a running lathe, as a person at the machine would.

It changes parameters through the lathe's own parameter service and listens to the monitor.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from rcl_interfaces.srv import SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Bool, Float64, Float64MultiArray, String
from std_srvs.srv import Trigger

from lathe_chatter.detection.estimate import RECOMMENDED_SPEED
from lathe_chatter.errors import ScenarioFailedError
from lathe_chatter.samples.codec import SampleDecoder
from lathe_chatter.scenario import Scenario, Step
from lathe_chatter.scenario.player import ScenarioPlayer
from lathe_chatter.scenario.scenario import ASKED
from lathe_chatter.supervisor import ASKS

_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_SENTENCES = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
_ESTIMATES = ('growth_rate', 'frequency', RECOMMENDED_SPEED)


class Operator(Node):  # type: ignore[misc]  # rclpy has no type information on Jazzy
    """Plays the steps of a scenario and notes what the monitor says meanwhile.

    Args:
        scenario: What to play.
        tell: Called with a sentence for everything that happens.
        options: As for `rclpy.node.Node`.

    Attributes:
        scenario: What is played.
        time: Simulated time of the newest sample, s.
        state: The monitor's word for the cut.
        player: Knows what is due, and what the monitor has said.
        failure: Why the scenario cannot go on, or None.
        playing: Whether samples are those of the lathe to play on; nothing is done before.
    """

    def __init__(self, scenario: Scenario, tell: Callable[[str], None], **options: Any) -> None:
        """Listen; nothing is changed before the lathe cuts."""
        super().__init__('lathe_operator', **options)
        self.scenario = scenario
        self.time = 0.0
        self.state = 'waiting'
        self.player = ScenarioPlayer(scenario)
        self.failure: ScenarioFailedError | None = None
        self.playing = False
        self._log = tell
        self._in_flight = False
        self._estimates = dict.fromkeys(_ESTIMATES, math.nan)
        self._client = self.create_client(
            SetParametersAtomically, 'lathe/set_parameters_atomically'
        )
        self._accept = self.create_client(Trigger, 'chatter_supervisor/accept')
        self._decoder = SampleDecoder()
        self.create_subscription(
            Float64MultiArray, 'lathe/samples', self._on_samples, _NEWEST, raw=True
        )
        # The monitor publishes its figures before the flag that they explain, and after it the
        # speed that it recommends. Of what is ready together the executor serves first what was
        # subscribed to first.
        for name in _ESTIMATES:
            self.create_subscription(
                Float64, f'chatter_monitor/{name}', self._estimate_taker(name), QoSProfile(depth=1)
            )
        self.create_subscription(Bool, 'chatter_monitor/chatter', self._on_flag, _LATCHED)
        self.create_subscription(String, 'chatter_monitor/state', self._on_state, _LATCHED)
        self.create_subscription(String, 'chatter_supervisor/action', self._on_action, _SENTENCES)

    @property
    def idle(self) -> bool:
        """Whether every step was played."""
        return self.player.finished and not self._in_flight

    # -- listening -------------------------------------------------------------------------

    def _on_samples(self, data: bytes) -> None:
        samples, columns = self._decoder.decode(data)
        self.time = float(samples[-1, columns.index('time')])
        if self.playing and not self._in_flight:
            step = self.player.due(self.time, self._estimates[RECOMMENDED_SPEED])
            if step is not None:
                self._play(step)

    def _on_action(self, message: String) -> None:
        self._log(f'{self.time:7.2f} s  supervisor: {message.data}')
        if ASKS in message.data:
            self.player.notice(ASKED, self.time)

    def _on_state(self, message: String) -> None:
        self.state = message.data

    def _estimate_taker(self, name: str) -> Callable[[Float64], None]:
        def take(message: Float64) -> None:
            self._estimates[name] = message.data

        return take

    def _on_flag(self, message: Bool) -> None:
        known = self._estimates
        what = self.player.on_flag(
            self.time, known['frequency'], known['growth_rate'], up=message.data
        )
        if what and message.data:  # what was recommended before was for another chatter
            self._estimates[RECOMMENDED_SPEED] = math.nan
        if what:
            self._log(f'{self.time:7.2f} s  {what}')

    # -- acting ----------------------------------------------------------------------------

    def _play(self, step: Step) -> None:
        self._log(f'{self.time:7.2f} s  {step}')
        self._in_flight = True
        if step.accept:
            future = self._accept.call_async(Trigger.Request())
            future.add_done_callback(lambda done: self._on_answer(step, done))
            return
        request = SetParametersAtomically.Request(
            parameters=[
                Parameter(name, value=value).to_parameter_msg()
                for name, value in step.changes.items()
            ]
        )
        future = self._client.call_async(request)
        future.add_done_callback(lambda done: self._on_answer(step, done))

    def _on_answer(self, step: Step, future: Any) -> None:
        self._in_flight = False
        answer = future.result()
        if step.accept and not answer.success:
            self.failure = ScenarioFailedError(f'The supervisor refused: {answer.message}')
        elif not (step.accept or answer.result.successful):
            self.failure = ScenarioFailedError(f'The lathe refused {step}: {answer.result.reason}')


def parameter_arguments(parameters: Mapping[str, Any]) -> list[str]:
    """Command line arguments that give a node its parameters."""
    arguments = [f'{name}:={_yaml(value)}' for name, value in parameters.items()]
    return [word for argument in arguments for word in ('-p', argument)]


def _yaml(value: Any) -> str:
    """A value as the parser of ROS arguments reads it back with the same type."""
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value) if isinstance(value, float) else str(value)
