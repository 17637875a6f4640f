"""A subscription that is asked for its messages, and wakes nobody for each of them.

To be woken for every message costs an executor of rclpy more than the message: at 500 a second
a quarter of a core. Who takes what has come in one go, some times a second, pays for that only.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.topic_endpoint_info import TopicEndpointInfo

_NOT_KNOWN = '_NODE_NAME_UNKNOWN_'
"""What the middleware of ROS 2 calls a node that it has not heard of yet."""


def publisher_names(node: Node, topic: str) -> list[str]:
    """The full names of the nodes that publish a topic, one for each publisher, sorted.

    Args:
        node: That asks the graph.
        topic: As the node names it; remapped where it is.
    """
    offers = node.get_publishers_info_by_topic(node.resolve_topic_name(topic))
    return sorted(map(full_name, offers))


def node_gids(node: Node) -> defaultdict[str, frozenset[tuple[int, ...]]]:
    """By its full name, what DDS knows each node by: another one of that name has another gid.

    It is that of the publisher of parameter events, which every node has. A node that was killed
    is in the graph for a while.

    Args:
        node: That asks the graph.
    """
    gids = defaultdict[str, frozenset[tuple[int, ...]]](frozenset)
    for offer in node.get_publishers_info_by_topic('/parameter_events'):
        gids[full_name(offer)] |= {tuple(offer.endpoint_gid)}
    return gids


def full_name(offer: TopicEndpointInfo) -> str:
    """Of the node that publishes; DDS may tell of a publisher before it tells of its node."""
    if offer.node_name == _NOT_KNOWN:
        return 'a node of unknown name'
    return f'{offer.node_namespace.rstrip("/")}/{offer.node_name}'


def several_publish(names: Sequence[str], topic: str) -> str:
    """That several nodes, by their full names, publish what only one may, without a stop."""
    return f'{", ".join(names[:-1])} and {names[-1]} publish {topic}, not one lathe'


class _NeverReady(CallbackGroup):  # type: ignore[misc]  # rclpy has no type information
    """Marks what is polled; keeps it out of what an executor waits for, but for one by events."""

    def can_execute(self, _entity: Any) -> bool:
        return False

    def beginning_execution(self, _entity: Any) -> bool:
        return False

    def ending_execution(self, _entity: Any) -> None:
        return


def is_polled(subscription: Any) -> bool:
    """Whether it is the subscription of a `PolledSubscription`."""
    return isinstance(subscription.callback_group, _NeverReady)


class PolledSubscription:
    """The serialised messages of a topic, when they are asked for.

    Args:
        node: Who subscribes.
        kind: Class of the messages.
        topic: Its name.
        qos: Its depth is how many messages may wait here.
        overrides: What of it may be chosen at the start.
    """

    def __init__(
        self,
        node: Node,
        kind: Any,
        topic: str,
        qos: QoSProfile,
        overrides: QoSOverridingOptions | None = None,
    ) -> None:
        """Subscribe."""
        self._node, self._kind, self._most = node, kind, qos.depth
        self._subscription = node.create_subscription(
            kind,
            topic,
            _unused,
            qos,
            callback_group=_NeverReady(),
            raw=True,
            qos_overriding_options=overrides,
        )

    def take(self) -> Iterator[tuple[bytes, Mapping[str, Any]]]:
        """What has come, and what the middleware says of each; no more than may wait here."""
        handle = self._subscription.handle
        with handle:
            for _ in range(self._most):
                found = handle.take_message(self._kind, True)  # noqa: FBT003 -- raw
                if found is None:
                    return
                yield found

    def publishers(self) -> frozenset[tuple[int, ...]]:
        """The marks that DDS gives to those that publish the topic."""
        offers = self._node.get_publishers_info_by_topic(self._subscription.topic_name)
        return frozenset(tuple(offer.endpoint_gid) for offer in offers)

    def end(self) -> None:
        """Unsubscribe."""
        self._node.destroy_subscription(self._subscription)


def _unused(_data: bytes) -> None:
    """Stands where rclpy wants a callback: messages are taken by `take`."""
