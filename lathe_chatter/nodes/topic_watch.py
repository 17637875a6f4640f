"""The topics of one recording: found when they appear, and followed from then on."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable

from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rosbags.typesys import Stores, get_typestore

from lathe_chatter.nodes.recorded_topic import RecordedTopic, Write, topic_of
from lathe_chatter.recording import RunWriter
from lathe_chatter.recording.provenance import PUBLISHERS


class TopicWatch:
    """Subscribes to wanted topics that appear, and hands on what comes.

    Args:
        node: Which subscribes.
        wanted: Names of topics, as a user writes them.
        writer: Of the run; it is told which topics there are, and how many publish them.
        write: Takes every message.

    Attributes:
        topics: Those that have appeared, by their full names.
    """

    def __init__(self, node: Node, wanted: Iterable[str], writer: RunWriter, write: Write) -> None:
        """Begin with none found."""
        self.topics: dict[str, RecordedTopic] = {}
        self._node, self._writer, self._write = node, writer, write
        self._types = get_typestore(Stores.ROS2_JAZZY)
        self._wanted = [node.resolve_topic_name(name) for name in wanted]
        self._refused: set[str] = set()
        self._most_publishers: dict[str, int] = {}

    def look(self, on_publisher: Callable[[str, str], None]) -> None:
        """Subscribe to what has appeared, and follow the others.

        Args:
            on_publisher: Takes namespace and name of every node that publishes a wanted topic.
        """
        for name in self._wanted:
            if name in self._refused:
                continue
            offers = self._node.get_publishers_info_by_topic(name)
            if name in self.topics:
                self.topics[name].look(offers)
            elif offers:
                self._join(name, offers)
            for offer in offers:
                on_publisher(offer.node_namespace, offer.node_name)
            if len(offers) > self._most_publishers.get(name, 0):
                self._most_publishers[name] = len(offers)
                counts = {each: str(count) for each, count in self._most_publishers.items()}
                self._writer.note(PUBLISHERS, counts)

    def take(self) -> None:
        """Take what has arrived."""
        for topic in self.topics.values():
            topic.take()

    def end(self) -> None:
        """Take what has arrived, and unsubscribe."""
        for topic in self.topics.values():
            topic.end()

    def reception(self) -> dict[str, str]:
        """What came of each topic, and what did not, as JSON."""
        return {name: json.dumps(topic.reception()) for name, topic in self.topics.items()}

    def _join(self, name: str, offers: list[TopicEndpointInfo]) -> None:
        """Record a topic from now on."""
        topic = topic_of(name, offers, self._types)
        if topic is None:
            self._refused.add(name)
            self._node.get_logger().warning(
                f'{name} is not recorded: its type {offers[0].topic_type} is not known.'
            )
            return
        self._writer.add_topic(topic)
        self.topics[name] = RecordedTopic(self._node, topic, offers, self._write)
