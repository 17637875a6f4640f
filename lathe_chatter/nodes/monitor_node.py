"""Node `chatter_monitor`: listens to the samples of a lathe and flags chatter."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from functools import partial
from typing import Any, NamedTuple

from rclpy.clock import Clock, ClockType
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Bool, Float64, String

from lathe_chatter.arrays import Array
from lathe_chatter.detection import Advice, ChatterDetector, Estimate
from lathe_chatter.errors import LatheChatterError
from lathe_chatter.model import Machine
from lathe_chatter.model.parameters import machine_from
from lathe_chatter.nodes.diagnostics import ERROR, OK, WARN, Diagnostics, Status
from lathe_chatter.nodes.monitor_sentences import clearance, details, onset
from lathe_chatter.nodes.node_main import run_node
from lathe_chatter.nodes.parameter_node import ParameterNode
from lathe_chatter.nodes.parameters import MONITOR, ModelSource
from lathe_chatter.nodes.qos_overrides import publisher_overrides
from lathe_chatter.nodes.real_time import spin_in_ticks
from lathe_chatter.nodes.remote_parameters import RemoteMachine
from lathe_chatter.nodes.sample_stream import Fed, SampleFeed
from lathe_chatter.precompile import precompile
from lathe_chatter.samples.continuity import BlockOrder, Continuity, times_of

_REST = 40_000_000
"""ns that the node lets samples come in before it looks at them together."""
_REST_ON_WATCH = 10_000_000
"""ns, likewise, while the vibration grows: an alarm may be due."""
_SERVE_PERIOD = 40_000_000
"""ns from one look for requests to the next: a look costs more than the samples of a rest."""
_REPORT_PERIOD = 0.05
"""Simulated seconds from one set of figures to the next; a change of state waits for nothing."""
_FIGURES = ('growth_rate', 'frequency', 'amplitude', 'recommended_speed_rpm')
_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_LEVELS = {'chatter': ERROR, 'watch': WARN, 'forced': WARN}
_UNKNOWN = 'unknown'


class MonitorNode(ParameterNode):
    """Feeds the samples of `lathe/samples` to a `ChatterDetector` and publishes what it says.

    It knows the machine as an impact test would tell it, and nothing of the cut but the
    samples. Columns are found by their labels. A figure that is not known is not published.
    Where no samples come the state is unknown, and the flag stays as it was.

    Args:
        by_timer: Whether a timer lets it look at the samples, so that any executor will do; else
            its loop calls `wake` (`real_time.spin_in_ticks`).
        options: As for `rclpy.node.Node`.

    Raises:
        ParameterError: If a parameter given at the start is not allowed.
    """

    def __init__(self, *, by_timer: bool = True, **options: Any) -> None:
        """Begin with the flag down and nothing known."""
        super().__init__('chatter_monitor', MONITOR, **options)
        precompile()  # compiled before the first sample comes
        source = ModelSource(self.values['model'])
        self.machine: Machine | None = None
        if source is ModelSource.PARAMETERS:
            self.machine = machine_from(self.values)
        self._asked: RemoteMachine | None = None
        if source is ModelSource.LATHE:
            self._asked = RemoteMachine(self, self._learn)
        self._detector = self._new_detector()
        self._continuity, self._since = Continuity(), 'nothing yet'
        self._complaint = ''
        self._state, self._flag = _UNKNOWN, False
        self._told_advice = Advice()
        self._figures: Mapping[str, float] = {}
        self._details: Mapping[str, object] = {}
        self._next_report = -math.inf
        self._counted = _Counted(0, 0)

        self._flag_publisher = self._publisher(Bool, 'chatter', _LATCHED)
        self._state_publisher = self._publisher(String, 'state', _LATCHED)
        self._figure_publishers = {
            name: self._publisher(Float64, name, QoSProfile(depth=10)) for name in _FIGURES
        }
        self._diagnostics = Diagnostics(self, 'chatter monitor')
        self._flag_publisher.publish(Bool(data=self._flag))
        self._state_publisher.publish(String(data=self._state))
        self._feed = SampleFeed(self, self._complain)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._wake_at = time.monotonic_ns()
        if by_timer:
            self.create_timer(_REST_ON_WATCH / 1e9, self.wake, clock=steady)
        self.create_timer(1.0, self._report, clock=steady)

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
        for fed in self._feed.take():
            self._take(fed)

    def _take(self, fed: Fed) -> None:
        samples, columns = fed.samples, fed.columns
        try:
            if fed.evenly:
                self._follow(samples[:, columns.index('time')])
            else:
                self._follow(times_of(samples, columns))
            estimate = self._detector.update(samples, columns)
        except LatheChatterError as error:
            self._complain(error)
            return
        self._complaint = ''
        self._tell(estimate)

    def _complain(self, error: LatheChatterError) -> None:
        self._complaint = str(error)
        self.get_logger().error(self._complaint, throttle_duration_sec=10.0)

    def _follow(self, times: Array) -> None:
        """Notice lost samples and a lathe that has started again."""
        before = self._continuity.last
        order = self._continuity.join(times, self._feed.is_another_lathe)
        if order in {BlockOrder.FIRST, BlockOrder.RESTART}:
            self._feed.know_lathe()
            self._since = f'{times[0]:.6f}'
        if order is BlockOrder.FIRST:
            self.get_logger().info(f'Listening from {self._since} s on.')
        elif order is BlockOrder.RESTART:
            again = f'the lathe started again, and I with it from {self._since} s on'
            self.get_logger().info(f'At {before:.6f} s: {again}.')
            self._begin_again()
            if self._asked is not None:
                self._asked.ask()  # it may be another machine
        elif order is BlockOrder.GAP:
            self.get_logger().warning(
                f'At {before:.6f} s: the samples up to {times[0]:.6f} s did not come.'
            )

    def _learn(self, machine: Machine) -> None:
        """Take the machine that the lathe says it is."""
        if machine != self.machine:
            self.machine = machine
            self.get_logger().info('The lathe has told what machine it is.')
            self._begin_again()

    def _begin_again(self) -> None:
        self._detector = self._new_detector()
        self._next_report = -math.inf

    def _new_detector(self) -> ChatterDetector:
        speeds = float(self.values['slowest_speed']), float(self.values['fastest_speed'])  # type: ignore[arg-type]  # numbers
        return ChatterDetector(self.machine, speed_range=speeds)

    # -- telling ---------------------------------------------------------------------------

    def _tell(self, estimate: Estimate) -> None:
        """Publish what is new, the figures before the flag that they explain."""
        changed = estimate.state != self._state or estimate.chatter != self._flag
        if changed or estimate.time >= self._next_report:
            if math.isfinite(estimate.time):  # not before the first hop
                self._next_report = (estimate.time // _REPORT_PERIOD + 1.0) * _REPORT_PERIOD
            self._publish_figures(estimate)
        if estimate.state != self._state:
            self._state = estimate.state
            self._state_publisher.publish(String(data=self._state))
        if estimate.chatter != self._flag:
            self._flag = estimate.chatter
            self._flag_publisher.publish(Bool(data=self._flag))
            # Two calls: rclpy allows each place in the code one severity.
            if self._flag:
                self.get_logger().warning(onset(estimate))
            else:
                self.get_logger().info(clearance(estimate))
            self._told_advice = estimate.advice
        elif estimate.advice.differs_from(self._told_advice):
            self.get_logger().info(f'At {estimate.time:.6f} s: {estimate.advice.in_words()}.')
            self._told_advice = estimate.advice
        if changed:
            self._diagnostics.publish_changes(self._statuses())

    def _publish_figures(self, estimate: Estimate) -> None:
        figures = {name: float(getattr(estimate, name)) for name in _FIGURES}
        self._figures = {name: value for name, value in figures.items() if math.isfinite(value)}
        self._details = details(estimate)
        for name, value in self._figures.items():
            self._figure_publishers[name].publish(Float64(data=value))

    def _publisher(self, kind: Any, name: str, qos: QoSProfile) -> Publisher:
        topic = f'~/{name}'
        options = publisher_overrides(self, topic)
        return self.create_publisher(kind, topic, qos, qos_overriding_options=options)

    # -- diagnostics -----------------------------------------------------------------------

    def _report(self) -> None:
        """Once a second; a second without samples means that nothing is known any more."""
        if self._asked is not None and not self._asked.answered:
            self._asked.ask()
        silent = self._continuity.samples == self._counted.samples
        if silent and self._state != _UNKNOWN:
            self._state = _UNKNOWN
            self._state_publisher.publish(String(data=self._state))
            self.get_logger().info(f'At {self._continuity.last:.6f} s: no samples come any more.')
        if not silent:
            self._feed.know_lathe()
        self._diagnostics.publish(self._statuses(silent=silent))
        self._counted = _Counted(self._continuity.samples, self._continuity.lost)

    def _statuses(self, *, silent: bool = False) -> list[Status]:
        cut = {'state': self._state, 'flag': self._flag, **self._figures, **self._details}
        return [
            self._samples_status(silent=silent),
            Status('cut', _LEVELS.get(self._state, OK), self._state, cut),
        ]

    def _samples_status(self, *, silent: bool) -> Status:
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
        if silent:
            return Status('samples', WARN, 'no samples come', values)
        if heard.lost > self._counted.lost:
            return Status('samples', WARN, 'samples were lost', values)
        return Status('samples', OK, 'all samples came', values)


class _Counted(NamedTuple):
    """Where the counters stood at the last report."""

    samples: int
    lost: int


def main() -> None:
    """Run the node until it is told to end."""
    # The executor driven by events would take the samples away.
    spin = partial(spin_in_ticks, serve_period=_SERVE_PERIOD)
    run_node(
        lambda: MonitorNode(by_timer=False),
        by_events=False,
        spin=spin,
        usage=MONITOR.usage('chatter_monitor'),
    )


if __name__ == '__main__':
    main()
