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

from lathe_chatter.errors import LatheChatterError
from lathe_chatter.nodes.messages import samples_from_message
from lathe_chatter.scenario import CLEARED, FLAGGED, RECOMMENDED, Scenario, Step

_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
_ESTIMATES = ('growth_rate', 'frequency', 'amplitude', 'recommended_speed_rpm')


class ScenarioFailedError(LatheChatterError):
    """The lathe refused a step of the scenario; the text says which and why."""


class Operator(Node):  # type: ignore[misc]  # rclpy has no type information on Jazzy
    """Plays the steps of a scenario and notes what the monitor says meanwhile.

    Args:
        scenario: What to play.
        tell: Called with a sentence for everything that happens.
        options: As for `rclpy.node.Node`.

    Attributes:
        scenario: What is played.
        time: Simulated time of the newest sample, s.
        amplitude: Largest displacement of the tool in the newest block of samples, m.
        state: The monitor's word for the cut.
        said: What the monitor has said so far: FLAGGED and CLEARED.
        failure: Why the scenario cannot go on, or None.
        playing: Whether samples are those of the lathe to play on; nothing is done before.
    """

    def __init__(self, scenario: Scenario, tell: Callable[[str], None], **options: Any) -> None:
        """Listen; nothing is changed before the lathe cuts."""
        super().__init__('lathe_operator', **options)
        self.scenario = scenario
        self.time = 0.0
        self.state = 'waiting'
        self.said: list[str] = []
        self.failure: ScenarioFailedError | None = None
        self.playing = False
        self._tell = tell
        self._steps = list(scenario.steps)
        self._heard_before_step = 0
        self._heard_at = 0.0
        self._in_flight = False
        self._estimates = dict.fromkeys(_ESTIMATES, math.nan)
        self._client = self.create_client(
            SetParametersAtomically, 'lathe/set_parameters_atomically'
        )
        self.create_subscription(Float64MultiArray, 'lathe/samples', self._on_samples, _NEWEST)
        # The monitor publishes its figures before the flag that they explain. Of what is ready
        # together the executor serves first what was subscribed to first.
        for name in _ESTIMATES:
            self.create_subscription(
                Float64, f'chatter_monitor/{name}', self._estimate_taker(name), QoSProfile(depth=1)
            )
        self.create_subscription(Bool, 'chatter_monitor/chatter', self._on_flag, _LATCHED)
        self.create_subscription(String, 'chatter_monitor/state', self._on_state, _LATCHED)

    @property
    def idle(self) -> bool:
        """Whether every step was played."""
        return not self._steps and not self._in_flight

    # -- listening -------------------------------------------------------------------------

    def _on_samples(self, message: Float64MultiArray) -> None:
        if not self.playing:
            return
        samples, columns = samples_from_message(message)
        self.time = float(samples[-1, columns.index('time')])
        if self._steps and not self._in_flight and self._is_due(self._steps[0]):
            self._play(self._steps.pop(0))

    def _on_state(self, message: String) -> None:
        self.state = message.data

    def _estimate_taker(self, name: str) -> Callable[[Float64], None]:
        def take(message: Float64) -> None:
            self._estimates[name] = message.data

        return take

    def _on_flag(self, message: Bool) -> None:
        if message.data:
            self.said.append(FLAGGED)
            known = self._estimates
            self._tell(
                f'{self.time:7.2f} s  chatter flagged: {known["frequency"]:.1f} Hz, '
                f'growth {known["growth_rate"]:+.1f} 1/s'
            )
        elif FLAGGED in self.said:
            self.said.append(CLEARED)
            self._tell(f'{self.time:7.2f} s  flag cleared: the cut is stable')
        self._heard_at = self.time

    # -- acting ----------------------------------------------------------------------------

    def _is_due(self, step: Step) -> bool:
        """Whether a step's time has come, or what it waits for has been said long enough."""
        if step.at is not None:
            return self.time >= step.at
        if step.when not in self.said[self._heard_before_step :]:
            return False
        wanted = RECOMMENDED in step.changes.values()
        if wanted and not math.isfinite(self._estimates['recommended_speed_rpm']):
            return False
        return self.time >= self._heard_at + step.after

    def _play(self, step: Step) -> None:
        changes = {name: self._resolved(value) for name, value in step.changes.items()}
        shown = ', '.join(f'{name} = {value}' for name, value in changes.items())
        self._tell(f'{self.time:7.2f} s  {shown}{step.because and f"  ({step.because})"}')
        request = SetParametersAtomically.Request(
            parameters=[
                Parameter(name, value=value).to_parameter_msg() for name, value in changes.items()
            ]
        )
        self._in_flight = True
        self._heard_before_step = len(self.said)
        future = self._client.call_async(request)
        future.add_done_callback(lambda done: self._on_answer(shown, done))

    def _resolved(self, value: Any) -> Any:
        """The speed that the monitor recommends, rounded to what a machinist would set."""
        if value == RECOMMENDED:
            return float(round(self._estimates['recommended_speed_rpm']))
        return value

    def _on_answer(self, shown: str, future: Any) -> None:
        self._in_flight = False
        result = future.result().result
        if not result.successful:
            self.failure = ScenarioFailedError(f'The lathe refused {shown}: {result.reason}')


def parameter_arguments(parameters: Mapping[str, Any]) -> list[str]:
    """Command line arguments that give a node its parameters."""
    arguments = [f'{name}:={_yaml(value)}' for name, value in parameters.items()]
    return [word for argument in arguments for word in ('-p', argument)]


def _yaml(value: Any) -> str:
    """A value as the parser of ROS arguments reads it back with the same type."""
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value) if isinstance(value, float) else str(value)
