"""The topics of one recording: found when they appear, and followed from then on."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any, NamedTuple

from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo

from lathe_chatter.errors import LatheChatterError
from lathe_chatter.nodes.parameter_node import ParameterNode
from lathe_chatter.nodes.recorded_subscription import RecordedTopic, Write, topic_of
from lathe_chatter.nodes.recorder_parameters import RECORDED_TOPICS
from lathe_chatter.nodes.topic_types import MissingTypeError, message_type
from lathe_chatter.recording import RunWriter
from lathe_chatter.recording.provenance import PUBLISHERS
from lathe_chatter.recording.snapshot import SnapshotBuffer

ALWAYS = ('/rosout', '/parameter_events')
"""Topics that are recorded in a pause as well: without them its end would be a riddle."""
_LOOK_CLOSELY = 0.5
"""s after which the publishers of a topic are looked at even if they are as many as before."""
_EXPECTED = 5.0
"""s after the start of a recording by which somebody publishes what was asked for by name."""


Sink = RunWriter | SnapshotBuffer
"""Where a recording goes: into a run, or into the memory of the last seconds."""


class Selection(NamedTuple):
    """Which topics are recorded.

    Attributes:
        names: By their full names.
        asked: Those of them that are none of the default ones: who names a topic expects it.
        every: Whether all that there are.
        like: Whose names match; None where none is.
        unlike: Those whose names match are left out; None where none is.
        repeat: Whether each file repeats the latest message of topics that are latched.
    """

    names: frozenset[str]
    asked: frozenset[str]
    every: bool
    like: re.Pattern[str] | None
    unlike: re.Pattern[str] | None
    repeat: bool

    def among(self, there: Iterable[str]) -> Iterator[str]:
        """The topics to record, of all that there are."""
        for name in sorted({*self.names, *there}):
            hidden = any(part.startswith('_') for part in name.split('/'))
            chosen = name in self.names or (
                not hidden and (self.every or (self.like and self.like.search(name)))
            )
            if chosen and not (self.unlike and self.unlike.search(name)):
                yield name


def selection(node: Node, values: dict[str, Any]) -> Selection:
    """What the parameters of a recorder select.

    Raises:
        LatheChatterError: If an expression is none.
    """
    names = {node.resolve_topic_name(name): name for name in values['topics']}
    asked = frozenset(name for name, given in names.items() if given not in RECORDED_TOPICS)
    like, unlike = (_pattern(name, values[name]) for name in ('topics_like', 'exclude'))
    repeat = values['repeat_latched'] or values['snapshot'] > 0.0
    return Selection(frozenset(names), asked, values['all_topics'], like, unlike, repeat)


def _pattern(name: str, text: str) -> re.Pattern[str] | None:
    try:
        return re.compile(text) if text else None
    except re.error as error:
        raise LatheChatterError(
            f'{name} must be a regular expression, and {text!r} is none: {error}.'
        ) from None


class TopicWatch:
    """Subscribes to wanted topics that appear, and hands on what comes.

    Args:
        node: Which subscribes.
        wanted: Which topics.
        sink: Of the recording; it is told which topics there are, and how many publish them.
        write: Takes every message.

    Attributes:
        topics: Those that have appeared, by their full names.
        awaited: Those that were asked for by name, and that nobody has published so far.
        refused: Types that are not installed, by the names of topics that are not recorded.
        paused: Whether what comes is left out.
    """

    def __init__(self, node: ParameterNode, wanted: Selection, sink: Sink, write: Write) -> None:
        """Begin with none found."""
        self.topics: dict[str, RecordedTopic] = {}
        self.awaited: list[str] = []
        self.refused: dict[str, str] = {}
        self._node, self._sink, self._write = node, sink, write
        self._wanted = wanted
        self.paused = False
        self._former: dict[str, dict[str, int]] = {}
        self._met: dict[str, set[tuple[int, ...]]] = {}
        self._several: dict[str, str] = {}
        self._counts: dict[str, int] = {}
        self._look_closely, self._warned = 0.0, False
        self._began = time.monotonic()

    def look(self, on_publisher: Callable[[str, str], None], *, closely: bool = False) -> None:
        """Subscribe to what has appeared, and follow the others.

        Args:
            on_publisher: Takes namespace and name of every node that publishes a wanted topic.
            closely: Whether to ask who publishes, and not only how many do; sometimes it does.
        """
        open_ended = self._wanted.every or self._wanted.like
        there = self._node.get_topic_names_and_types() if open_ended else ()
        closely = closely or time.monotonic() >= self._look_closely
        if closely:
            self._look_closely = time.monotonic() + _LOOK_CLOSELY
        for name in self._wanted.among(name for name, _ in there):
            count = self._node.count_publishers(name)  # a tenth of what it costs to ask who
            if not closely and count == self._counts.get(name, 0):
                continue
            self._counts[name] = count
            offers = self._node.get_publishers_info_by_topic(name)
            met = self._met.setdefault(name, set())
            met.update(tuple(offer.endpoint_gid) for offer in offers)
            topic = self.topics.get(name)
            if topic is not None and topic.is_of(offers):
                same = [each for each in offers if each.topic_type == topic.topic.type]
                topic.look(same, len(met))
            elif offers and self.refused.get(name) != offers[0].topic_type:
                self._join(name, offers)
            for offer in offers:
                on_publisher(offer.node_namespace, offer.node_name)
        several = {name: str(len(met)) for name, met in self._met.items() if len(met) > 1}
        if several != self._several:
            self._several = several
            self._sink.note(PUBLISHERS, several)
        if closely and time.monotonic() >= self._began + _EXPECTED:
            self._await()

    def _await(self) -> None:
        """Notice what was asked for by name and never came: the name may be misspelt."""
        named = (name for name in self._wanted.among(()) if name in self._wanted.asked)
        self.awaited = [name for name in named if not self._met.get(name)]
        if self.awaited and not self._warned:
            self._node.bounded_log.warning(
                f'Nobody publishes {", ".join(self.awaited)} so far: nothing of it is recorded.'
            )
        self._warned = True

    def take(self) -> None:
        """Take what has arrived."""
        for topic in self.topics.values():
            topic.take()

    def pause(self, *, pause: bool) -> None:
        """Leave out what comes, from now on, or no longer."""
        self.take()
        self.paused = pause
        for name, topic in self.topics.items():
            topic.paused = pause and name not in ALWAYS

    def end(self) -> None:
        """Take what has arrived, and unsubscribe."""
        for topic in self.topics.values():
            topic.end()

    def reception(self) -> dict[str, str]:
        """What came of each topic, and what did not, as JSON."""
        return {
            name: json.dumps({**self._counted(topic), 'repeated': self._sink.repeated[name]})
            for name, topic in self.topics.items()
        }

    def _counted(self, topic: RecordedTopic) -> dict[str, int]:
        """What came of a topic, with what came of it under former types."""
        former = self._former.get(topic.topic.name, {})
        return {name: n + former.get(name, 0) for name, n in topic.reception().items()}

    def _join(self, name: str, offers: list[TopicEndpointInfo]) -> None:
        """Record a topic from now on, or its new type."""
        kind = offers[0].topic_type
        offers = [offer for offer in offers if offer.topic_type == kind]
        try:
            found = message_type(offers[0])
        except MissingTypeError as error:
            self.refused[name] = kind
            self._node.bounded_log.warning(f'{name} is not recorded: {error}.')
            return
        topic = topic_of(name, found, offers)
        if not self._wanted.repeat:
            topic = replace(topic, repeated=0)
        former = self.topics.get(name)
        if former is not None:
            former.end()
            self._former[name] = self._counted(former)
            self._node.bounded_log.info(f'{name} is now of type {kind}, and recorded as such.')
        try:
            recorded = RecordedTopic(self._node, topic, found.message_class, offers, self._write)
        except Exception as error:  # noqa: BLE001 -- of the middleware, about this topic alone
            self.refused[name] = kind
            said = ' '.join(str(error).split())
            self._node.bounded_log.warning(f'{name} is not recorded: {said}')
            return
        self._sink.add_topic(topic)
        recorded.paused = self.paused and name not in ALWAYS
        self.topics[name] = recorded
