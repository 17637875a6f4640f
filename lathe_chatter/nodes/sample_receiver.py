"""The samples of a lathe as a node takes them: some blocks at once, where they belong together."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.topic_endpoint_info import TopicEndpointInfo
from std_msgs.msg import Float64MultiArray

from lathe_chatter.array_types import Array
from lathe_chatter.errors import LatheChatterError
from lathe_chatter.nodes.polled_subscription import PolledSubscription, publisher_names
from lathe_chatter.samples.codec import SampleDecoder
from lathe_chatter.samples.continuity import follow_evenly

_TOPIC = 'lathe/samples'
_BACKLOG = 10_000
"""Blocks of samples that may wait here: 1 s of a lathe at 20 times real time."""
_AT_ONCE = 400
"""Samples that are handed on at once, if they wait: 40 ms of a lathe of 10 kHz."""


class SampleBatch(NamedTuple):
    """Samples that came.

    Attributes:
        samples: One block, or several that follow each other (n, k), n > 0.
        columns: Names of the k columns.
        evenly: Whether their times are known to be numbers that follow each other evenly.
    """

    samples: Array
    columns: tuple[str, ...]
    evenly: bool


class SampleSubscription:
    """Takes what has come of `lathe/samples`, when asked.

    Args:
        node: Which subscribes.
        complain: Takes what is wrong with a message that is no block of samples.

    Attributes:
        best_effort: Whether a publisher is heard that does not send again what gets lost.
    """

    def __init__(self, node: Node, complain: Callable[[LatheChatterError], None]) -> None:
        """Subscribe."""
        self._node, self._complain = node, complain
        self._decoder = SampleDecoder()
        self._known: frozenset[tuple[int, ...]] = frozenset()
        self.best_effort = False
        self._waiting: list[tuple[Array, tuple[str, ...]]] = []
        self._messages = PolledSubscription(
            node,
            Float64MultiArray,
            _TOPIC,
            QoSProfile(depth=_BACKLOG),
            QoSOverridingOptions.with_default_policies(),
        )

    def _endpoints(self) -> list[TopicEndpointInfo]:
        found: list[TopicEndpointInfo] = self._node.get_publishers_info_by_topic(
            self._node.resolve_topic_name(_TOPIC)
        )
        return found

    def remember_publishers(self) -> None:
        """Remember who publishes now."""
        self._known = self._messages.publishers()

    def has_new_publisher(self) -> bool:
        """Whether somebody publishes who did not when they were last remembered."""
        return not self._messages.publishers() <= self._known

    def publishers(self) -> list[str]:
        """Full names of the nodes that publish, sorted; one that does so twice stands twice."""
        return publisher_names(self._node, _TOPIC)

    def adapt(self) -> bool:
        """Ask for no more than every publisher offers; whether that made a difference."""
        offered = {each.qos_profile.reliability for each in self._endpoints()}
        if self.best_effort or ReliabilityPolicy.BEST_EFFORT not in offered:
            return False
        self._waiting += self._read()
        self._messages.end()
        qos = QoSProfile(depth=_BACKLOG, reliability=ReliabilityPolicy.BEST_EFFORT)
        self._messages = PolledSubscription(self._node, Float64MultiArray, _TOPIC, qos)
        self.best_effort = True
        return True

    def take(self) -> Iterator[SampleBatch]:
        """What has come since, in order."""
        blocks: list[Array] = []
        names: tuple[str, ...] = ()
        count = 0
        waiting, self._waiting = self._waiting, []
        for part in (waiting, self._read()):
            for samples, columns in part:
                if columns != names or count >= _AT_ONCE:
                    yield from join_blocks(blocks, names)
                    blocks, names, count = [], columns, 0
                if len(samples):
                    blocks.append(samples)
                    count += len(samples)
        yield from join_blocks(blocks, names)

    def _read(self) -> Iterator[tuple[Array, tuple[str, ...]]]:
        """Blocks and their columns, in order."""
        for serialised, _info in self._messages.take():
            try:
                yield self._decoder.decode(serialised)
            except LatheChatterError as error:  # noqa: PERF203 -- one bad message spoils no other
                self._complain(error)


def join_blocks(blocks: list[Array], columns: tuple[str, ...]) -> Iterator[SampleBatch]:
    """Blocks as one where they follow each other evenly, else one by one."""
    if not blocks:
        return
    if 'time' in columns:
        joined = np.concatenate(blocks)
        if follow_evenly(joined[:, columns.index('time')]):
            yield SampleBatch(joined, columns, evenly=True)
            return
    for samples in blocks:
        yield SampleBatch(samples, columns, evenly=False)
