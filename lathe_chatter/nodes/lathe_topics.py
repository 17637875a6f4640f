"""The topics of the node `lathe`: what goes out after each tick."""

from __future__ import annotations

import time
from collections.abc import Callable

from rclpy.duration import Duration
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray

from lathe_chatter.array_types import Array
from lathe_chatter.nodes.joint_state_message import joint_states, time_message
from lathe_chatter.nodes.parameter_node import ParameterNode
from lathe_chatter.samples import SAMPLE_COLUMNS
from lathe_chatter.samples.codec import encode_block, encode_number

_SCALARS = {
    '~/tool/displacement': SAMPLE_COLUMNS.index('tool_displacement'),
    '~/tool/velocity': SAMPLE_COLUMNS.index('tool_velocity'),
    '~/workpiece/displacement': SAMPLE_COLUMNS.index('workpiece_displacement'),
    '~/workpiece/velocity': SAMPLE_COLUMNS.index('workpiece_velocity'),
}
_HISTORY = 4.0
"""Seconds, by the clock on the wall, that a reader may fall behind before it misses a tick."""
MAX_HISTORY = 10_000
"""Ticks that are kept at most, where they come faster than in real time."""
_ON_THE_WAY = 160_000
"""Bytes of samples that a lathe faster than real time has on the way to its readers at most: more
than the middleware's shared memory holds (0.5 MB in Fast DDS) are lost, and sent again and again.
"""
_SMALL = 1600
"""Bytes as which a smaller message counts: of those, too, only so many find room."""
_FAR_BEHIND = MAX_HISTORY // 4
"""Ticks after which a reader may soon lose some, or is stuck."""
_WAIT = Duration(nanoseconds=5_000_000)
"""For the readers in one go: then requests have their turn."""
_HICCUP = 0.01
"""s after which a reader that is not far behind has missed a message: the next tells it so."""
_TIME = SAMPLE_COLUMNS.index('time')
_SAME = 1000
"""ns by which the roundings of two times differ at most."""
_LOOK_AROUND = 0.05
"""s after which a new listener is noticed."""


class LatheTopics:
    """Publishers of the state, the samples, the joints and the clock.

    Nothing waits for a subscriber. The samples are kept for one that joins late and asks for
    them (transient local), so that a record has the first one; the rest costs nothing while
    nobody listens.

    Args:
        node: That they belong to.
        columns: Of the samples.
        tick_rate: Messages a simulated second, Hz.
        factor: Simulated seconds per second, 0 for as many as there are.
        publish_clock: Whether /clock is among them.

    Attributes:
        zero: What /clock shows at time 0 of the samples, ns; None where it is not followed.
    """

    def __init__(
        self,
        node: ParameterNode,
        columns: tuple[str, ...],
        tick_rate: float,
        factor: float,
        *,
        publish_clock: bool,
    ) -> None:
        """Create the publishers."""
        self._columns = columns
        in_real_time = max(10, round(_HISTORY * tick_rate))
        faster = round(in_real_time * factor) if factor else MAX_HISTORY
        deep = max(in_real_time, min(faster, MAX_HISTORY))
        kept = QoSProfile(depth=deep, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._samples = node.advertise(Float64MultiArray, '~/samples', kept)
        # Bytes need none of what rclpy asks of a message at each call.
        self._publish_samples = self._samples.handle.publish_raw
        self._scalars = [
            (node.advertise(Float64, topic, QoSProfile(depth=deep)), column)
            for topic, column in _SCALARS.items()
        ]
        # Without a /clock nobody knows simulated time: stamps are the node's then.
        self._follows = bool(node.get_parameter('use_sim_time').value)
        self._now = None if publish_clock or self._follows else node.get_clock().now
        self._log = node.bounded_log
        self.zero: int | None = None
        self._joints = node.advertise(JointState, '~/joint_states', QoSProfile(depth=10))
        self._clock = (
            node.advertise(Clock, '/clock', QoSProfile(depth=1)) if publish_clock else None
        )
        self._look_at = self._published_at = 0.0
        self._unread = 0  # ticks since every reader was known to have all of them
        self._size = 0  # bytes of the last
        self._heard_scalars: list[tuple[Publisher, int]] = []
        self._heard_joints = self._timed = False

    def publish(self, samples: Array, stamp_of_last: Callable[[], int]) -> None:
        """Publish what one tick brought, the state before the clock.

        Args:
            samples: (n, columns), n > 0.
            stamp_of_last: Asked for its simulated time, ns, where somebody wants it.
        """
        block = encode_block(samples, self._columns)
        self._publish_samples(block)
        self._published_at = now = time.monotonic()
        self._unread, self._size = self._unread + 1, len(block)
        if now >= self._look_at:
            self._look_at = now + _LOOK_AROUND
            self._look_around()
        for publisher, column in self._heard_scalars:
            publisher.publish(encode_number(samples[-1, column]))
        if not self._timed:
            return
        last, stamp = samples[-1], stamp_of_last()
        if self._follows:
            self._follow(stamp - round(last[_TIME] * 1e9))
        if self._heard_joints:
            when = stamp if self._now is None else self._now().nanoseconds
            self._joints.publish(joint_states(last, when))
        self.publish_clock(stamp)

    def _follow(self, zero: int) -> None:
        """Say where the samples are on another's /clock, ns, whenever that is new."""
        if self.zero is None or abs(zero - self.zero) > _SAME:
            self.zero = zero
            said = f'Time 0 of the samples is {zero / 1e9:.6f} s of /clock.'
            self._log.info(said, 'time zero')

    def _look_around(self) -> None:
        """See from time to time who listens: to ask at each tick costs as much as a sample."""
        self._heard_scalars = [s for s in self._scalars if s[0].get_subscription_count()]
        self._heard_joints = self._joints.get_subscription_count() > 0
        self._timed = self._follows or self._heard_joints or self._clock is not None

    def readers(self) -> int:
        """How many readers of the samples the publisher has met: they miss none from now on."""
        return int(self._samples.get_subscription_count())

    def readers_follow(self, patience: float) -> bool:
        """Whether the readers can take more; waits a while for the slowest.

        Args:
            patience: s without a tick after which the lathe goes on although one is far behind.
        """
        if self._unread * max(self._size, _SMALL) <= _ON_THE_WAY:
            return True
        if self._samples.wait_for_all_acked(_WAIT):
            self._unread = 0
            return True
        waits = patience if self._unread > _FAR_BEHIND else _HICCUP
        return time.monotonic() - self._published_at > waits

    def publish_clock(self, stamp: int) -> None:
        """Publish simulated time, ns, if this node drives the clock."""
        if self._clock is not None:
            self._clock.publish(Clock(clock=time_message(stamp)))
