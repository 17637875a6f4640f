"""A topic that is being recorded: a raw subscription that asks for all its publishers have."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

from rclpy.duration import Infinite
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

from lathe_chatter.nodes.polled_subscription import PolledSubscription, node_gids
from lathe_chatter.nodes.topic_types import MessageType
from lathe_chatter.recording import Topic
from lathe_chatter.recording.ros_messages import LOG_TYPE, PARAMETER_EVENT_TYPE
from lathe_chatter.recording.sequence_gaps import Numbering
from lathe_chatter.samples.codec import SAMPLES_TYPE

_BACKLOG = 50_000
"""Messages that may wait here: 3 s of a lathe at 30 times real time."""
_BACKLOG_HERE = 5000
"""Of a publisher in this process, from whom Fast DDS takes nothing any more where so many wait."""
_OF_PROCESS = 8
"""Bytes of a gid that all of a process have: vendor, host and process."""
_STREAMS = (SAMPLES_TYPE, LOG_TYPE, PARAMETER_EVENT_TYPE)
"""Types of which the latest message alone says nothing."""
_INFINITE = {'sec': 9223372036, 'nsec': 854775807}

Write = Callable[[Topic, bytes, int, int, int], None]
"""Takes topic, message, log time and publish time in ns, and the publisher's number."""


class RecordedTopic:
    """Hands every message on as it came, and follows what is lost on the way.

    Messages wait in the middleware until `take` takes them all: to be woken for each would
    cost ten times as much as to take it.

    Args:
        node: Which subscribes.
        topic: What it is.
        message_class: Of its type.
        offers: What its publishers offer.
        write: Where messages go.

    Attributes:
        messages: How many came.
        paused: Whether what comes is left out; its numbers are followed.
        numbering: Says which did not come.
    """

    def __init__(
        self,
        node: Node,
        topic: Topic,
        message_class: Any,
        offers: list[TopicEndpointInfo],
        write: Write,
    ) -> None:
        """Subscribe."""
        self.topic = topic
        self.messages = 0
        self.paused = False
        self.numbering = Numbering()
        self._node = node
        self._write = write
        self._class = message_class
        self._met = len(offers)
        own = node_gids(node)[node.get_fully_qualified_name()]
        self._process = {gid[:_OF_PROCESS] for gid in own}
        self._subscribe(self._matching(offers))

    @property
    def lost(self) -> int:
        """Messages that are missing between others: what was before the first is no loss.

        A publisher does not say how many it keeps for who comes late.
        """
        return self.numbering.lost

    def reception(self) -> dict[str, int]:
        """What came, what is known to be lost, and how many were before the first."""
        numbering = self.numbering
        return {'messages': self.messages, 'lost': numbering.lost, 'before': numbering.before}

    def is_of(self, offers: list[TopicEndpointInfo]) -> bool:
        """Whether somebody still publishes the type that is being recorded, or nobody any."""
        kinds = {offer.topic_type for offer in offers}
        return not kinds or self.topic.type in kinds

    def look(self, offers: list[TopicEndpointInfo], met: int) -> None:
        """Follow the graph: new publishers may offer less than those before.

        Args:
            offers: Of those that publish its type now.
            met: How many publishers the topic has had so far, those that went included: what one
                of them had sent before it was heard is no loss of another.
        """
        self._met = met
        self.numbering.settle(met, time.monotonic())
        wanted = self._matching(offers) if offers else self._qos
        if _asks_less(wanted, self._qos):
            self.take()
            self._subscription.end()
            self._subscribe(wanted)

    def end(self) -> None:
        """Take what has arrived and was not yet served, and unsubscribe."""
        self.take()
        self.numbering.settle(self._met, math.inf)
        self._subscription.end()

    def _matching(self, offers: list[TopicEndpointInfo]) -> QoSProfile:
        """The most demanding profile that every publisher can serve, and a deep queue."""
        profiles = [offer.qos_profile for offer in offers]
        reliable, kept = all(map(_reliable, profiles)), all(map(_latched, profiles))
        here = any(tuple(each.endpoint_gid)[:_OF_PROCESS] in self._process for each in offers)
        return QoSProfile(
            depth=_BACKLOG_HERE if here else _BACKLOG,
            reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if kept else DurabilityPolicy.VOLATILE,
        )

    def _subscribe(self, qos: QoSProfile) -> None:
        self._qos = qos
        self._subscription = PolledSubscription(self._node, self._class, self.topic.name, qos)

    def take(self) -> None:
        """Take everything that has arrived."""
        taken, numbering, topic, write = 0, self.numbering, self.topic, self._write
        steady = time.monotonic()
        for data, info in self._subscription.take():
            number = info['publication_sequence_number'] or 0  # None where there is none
            if number:
                numbering.take(number, steady)
            published = info['source_timestamp']
            taken += 1
            if not self.paused:
                received = info['received_timestamp'] or time.time_ns()
                write(topic, data, received, published or received, number)
        if not self.paused:
            self.messages += taken


def topic_of(name: str, kind: MessageType, offers: list[TopicEndpointInfo]) -> Topic:
    """What a topic is, by its type and its publishers."""
    profiles = tuple(_profile(offer.qos_profile) for offer in offers)
    latched = all(_latched(offer.qos_profile) for offer in offers)
    # How many messages a publisher keeps is not said: of a stream or a log no part is repeated.
    repeated = len(offers) if latched and kind.name not in _STREAMS else 0
    return Topic(name, kind.name, kind.definition, kind.type_hash, profiles, repeated=repeated)


def _latched(qos: QoSProfile) -> bool:
    return bool(qos.durability == DurabilityPolicy.TRANSIENT_LOCAL)


def _reliable(qos: QoSProfile) -> bool:
    return bool(qos.reliability == ReliabilityPolicy.RELIABLE)


def _asks_less(qos: QoSProfile, than: QoSProfile) -> bool:
    """Whether the one profile asks for less than the other, in whatever respect."""
    less = (_reliable(than) and not _reliable(qos)) or (_latched(than) and not _latched(qos))
    return less or qos.depth < than.depth


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
