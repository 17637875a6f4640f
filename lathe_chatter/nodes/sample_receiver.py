"""The samples of a lathe as a node takes them: some blocks at once, where they belong together."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from std_msgs.msg import Float64MultiArray

from lathe_chatter.array_types import Array
from lathe_chatter.errors import LatheChatterError
from lathe_chatter.nodes.polled_subscription import PolledSubscription, publisher_names
from lathe_chatter.samples.codec import SampleDecoder
from lathe_chatter.samples.continuity import follow_evenly

_TOPIC = 'lathe/samples'
_BACKLOG = 10_000
"""Blocks of samples that may wait here: 1 s of a lathe at 20 times real time."""
_PACES = 3.0
"""Times as fast as so far that a lathe may cut."""
_AT_ONCE = 400
"""Samples that are handed on at once, if they wait: 40 ms of a lathe of 10 kHz."""


class SampleBatch(NamedTuple):
    """Samples that came.

    Attributes:
        samples: One block, or several that follow each other (n, k), n > 0.
        columns: Names of the k columns.
        evenly: Whether their times are known to be numbers that follow each other evenly.
        sent: When the first and the last block of them was sent, ns by the clock of who sent it.
    """

    samples: Array
    columns: tuple[str, ...]
    evenly: bool
    sent: tuple[int, int] = (0, 0)


class SampleSubscription:
    """Takes what has come of `lathe/samples`, when asked.

    Args:
        node: Which subscribes.
        complain: Takes what is wrong with a message that is no block of samples.

    Attributes:
        topic: Its name, remapped where it is.
        best_effort: Whether a publisher is heard that does not send again what gets lost.
    """

    def __init__(self, node: Node, complain: Callable[[LatheChatterError], None]) -> None:
        """Subscribe."""
        self._node, self._complain = node, complain
        self.topic = node.resolve_topic_name(_TOPIC)
        self._decoder = SampleDecoder()
        self._known: frozenset[tuple[int, ...]] = frozenset()
        self.best_effort = False
        self._waiting: list[tuple[Array, tuple[str, ...], int]] = []
        self._messages = PolledSubscription(
            node,
            Float64MultiArray,
            _TOPIC,
            QoSProfile(depth=_BACKLOG),
            QoSOverridingOptions.with_default_policies(),
        )

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
        offers = self._node.get_publishers_info_by_topic(self.topic)
        offered = {offer.qos_profile.reliability for offer in offers}
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
        sent: list[int] = []
        names: tuple[str, ...] = ()
        count = 0
        waiting, self._waiting = self._waiting, []
        for part in (waiting, self._read()):
            for samples, columns, at in part:
                if columns != names or count >= _AT_ONCE:
                    yield from join_blocks(blocks, names, sent)
                    blocks, sent, names, count = [], [], columns, 0
                if len(samples):
                    blocks.append(samples)
                    sent.append(at)
                    count += len(samples)
        yield from join_blocks(blocks, names, sent)

    def _read(self) -> Iterator[tuple[Array, tuple[str, ...], int]]:
        """Blocks, their columns and when they were sent, in order."""
        for serialised, info in self._messages.take():
            try:
                yield *self._decoder.decode(serialised), info['source_timestamp'] or 0
            except LatheChatterError as error:  # noqa: PERF203 -- one bad message spoils no other
                self._complain(error)


class SendingPace:
    """How fast a lathe has cut so far, by when it has sent its samples."""

    def __init__(self) -> None:
        """Nothing was sent yet."""
        self._first = self._last = 0.0, 0

    def follow(self, times: Array, sent: tuple[int, int], *, begins: bool) -> None:
        """Samples of times (n,), s, have come, the first and last of which were sent at, ns."""
        if begins:
            self._first = float(times[0]), sent[0]
        self._last = float(times[-1]), sent[1]

    def allows(self, start: float, sent: int) -> bool:
        """Whether it can have cut what is missing before a sample: another's comes at once.

        Args:
            start: Simulated time of the sample, s.
            sent: When it was sent, ns.
        """
        (first, first_at), (last, last_at) = self._first, self._last
        passed = last_at - first_at
        return passed > 0 and (start - last) * passed < _PACES * (sent - last_at) * (last - first)


def join_blocks(
    blocks: list[Array], columns: tuple[str, ...], sent: Sequence[int] = ()
) -> Iterator[SampleBatch]:
    """Blocks as one where they follow each other evenly, else one by one."""
    if not blocks:
        return
    when = sent or [0] * len(blocks)
    if 'time' in columns:
        joined = np.concatenate(blocks)
        if follow_evenly(joined[:, columns.index('time')]):
            yield SampleBatch(joined, columns, evenly=True, sent=(when[0], when[-1]))
            return
    for samples, at in zip(blocks, when, strict=True):
        yield SampleBatch(samples, columns, evenly=False, sent=(at, at))
