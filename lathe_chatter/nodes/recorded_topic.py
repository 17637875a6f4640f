"""A topic that is being recorded: a raw subscription that asks for all its publishers have."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

from rclpy.duration import Infinite
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

from lathe_chatter.nodes.polled_subscription import PolledSubscription
from lathe_chatter.recording import Topic
from lathe_chatter.recording.sequence_gaps import Numbering

_BACKLOG = 10_000
"""Messages that may wait here: 1 s of a lathe at 20 times real time."""
_INFINITE = {'sec': 9223372036, 'nsec': 854775807}

Write = Callable[[str, bytes, int, int, int], None]
"""Takes topic, message, log time and publish time in ns, and the publisher's number."""


class RecordedTopic:
    """Hands every message on as it came, and follows what is lost on the way.

    Messages wait in the middleware until `take` takes them all: to be woken for each would
    cost ten times as much as to take it.

    Args:
        node: Which subscribes.
        topic: What it is.
        offers: What its publishers offer.
        write: Where messages go.

    Attributes:
        messages: How many came.
        numbering: Says which did not.
    """

    def __init__(
        self, node: Node, topic: Topic, offers: list[TopicEndpointInfo], write: Write
    ) -> None:
        """Subscribe."""
        self.topic = topic
        self.messages = 0
        self.numbering = Numbering()
        self._kept = all(_keeps(offer.qos_profile) for offer in offers)
        self._node = node
        self._write = write
        self._class = _message_class(topic.type)
        self._subscribe(_matching(offers))

    @property
    def lost(self) -> int:
        """Messages that are missing: also before the first, where publishers keep them."""
        return self.numbering.lost + (self.numbering.before if self._kept else 0)

    def reception(self) -> dict[str, int]:
        """What came, what is known to be lost, and how many were before the first."""
        numbering = self.numbering
        return {'messages': self.messages, 'lost': numbering.lost, 'before': numbering.before}

    def look(self, offers: list[TopicEndpointInfo]) -> None:
        """Follow the graph: new publishers may offer less than those before."""
        self.numbering.settle(len(offers), time.monotonic())
        wanted = _matching(offers) if offers else self._qos
        if _asks_less(wanted, self._qos):
            self.take()
            self._subscription.end()
            self._subscribe(wanted)

    def end(self) -> None:
        """Take what has arrived and was not yet served, and unsubscribe."""
        self.take()
        self.numbering.settle(self._node.count_publishers(self.topic.name), math.inf)
        self._subscription.end()

    def _subscribe(self, qos: QoSProfile) -> None:
        self._qos = qos
        self._subscription = PolledSubscription(self._node, self._class, self.topic.name, qos)

    def take(self) -> None:
        """Take everything that has arrived."""
        for data, info in self._subscription.take():
            self._write_one(data, info)

    def _write_one(self, data: bytes, info: Mapping[str, Any]) -> None:
        number = info['publication_sequence_number'] or 0  # None where the middleware has none
        if number:
            self.numbering.take(number, time.monotonic())
        self.messages += 1
        now = time.time_ns()
        log_time = info['received_timestamp'] or now
        self._write(self.topic.name, data, log_time, info['source_timestamp'] or now, number)


def topic_of(name: str, offers: list[TopicEndpointInfo], types: Any) -> Topic | None:
    """What a topic is, by its publishers and rosbags' types; None where its type is unknown."""
    kind = offers[0].topic_type
    if kind not in types.fielddefs:
        return None
    definition, _ = types.generate_msgdef(kind, ros_version=2)
    profiles = tuple(_profile(offer.qos_profile) for offer in offers)
    return Topic(name, kind, definition, types.hash_rihs01(kind), profiles)


def _message_class(kind: str) -> Any:
    """The class of a type named as `std_msgs/msg/Bool`."""
    package, _, name = kind.split('/')
    return getattr(import_module(f'{package}.msg'), name)


def _keeps(qos: QoSProfile) -> bool:
    """Whether a publisher keeps messages for late readers, without end."""
    return _latched(qos) and bool(qos.lifespan == Infinite)


def _latched(qos: QoSProfile) -> bool:
    return bool(qos.durability == DurabilityPolicy.TRANSIENT_LOCAL)


def _reliable(qos: QoSProfile) -> bool:
    return bool(qos.reliability == ReliabilityPolicy.RELIABLE)


def _matching(offers: list[TopicEndpointInfo]) -> QoSProfile:
    """The most demanding profile that every publisher can serve, and a deep queue."""
    profiles = [offer.qos_profile for offer in offers]
    reliable, kept = all(map(_reliable, profiles)), all(map(_latched, profiles))
    return QoSProfile(
        depth=_BACKLOG,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if kept else DurabilityPolicy.VOLATILE,
    )


def _asks_less(qos: QoSProfile, than: QoSProfile) -> bool:
    """Whether there are publishers that serve the one profile and not the other."""
    return (_reliable(than) and not _reliable(qos)) or (_latched(than) and not _latched(qos))


def _profile(qos: QoSProfile) -> dict[str, Any]:
    """A profile as rosbag2 writes it."""

    def lasting(duration: Any) -> dict[str, int]:
        if duration == Infinite:
            return dict(_INFINITE)
        seconds, rest = divmod(duration.nanoseconds, 10**9)
        return {'sec': seconds, 'nsec': rest}

    return {
        'history': qos.history.name.lower(),
        'depth': qos.depth,
        'reliability': qos.reliability.name.lower(),
        'durability': qos.durability.name.lower(),
        'deadline': lasting(qos.deadline),
        'lifespan': lasting(qos.lifespan),
        'liveliness': qos.liveliness.name.lower(),
        'liveliness_lease_duration': lasting(qos.liveliness_lease_duration),
        'avoid_ros_namespace_conventions': qos.avoid_ros_namespace_conventions,
    }
