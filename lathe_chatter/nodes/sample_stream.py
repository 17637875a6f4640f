"""The samples of a lathe as a node takes them: some blocks at once, where they belong together."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from std_msgs.msg import Float64MultiArray

from lathe_chatter.arrays import Array
from lathe_chatter.errors import LatheChatterError
from lathe_chatter.nodes.polled_subscription import PolledSubscription
from lathe_chatter.samples.codec import SampleDecoder
from lathe_chatter.samples.continuity import follow_evenly

_TOPIC = 'lathe/samples'
_BACKLOG = 10_000
"""Blocks of samples that may wait here: 1 s of a lathe at 20 times real time."""
_AT_ONCE = 400
"""Samples that are handed on at once, if they wait: 40 ms of a lathe of 10 kHz."""


class Fed(NamedTuple):
    """Samples that came.

    Attributes:
        samples: One block, or several that follow each other (n, k), n > 0.
        columns: Names of the k columns.
        evenly: Whether their times are known to be numbers that follow each other evenly.
    """

    samples: Array
    columns: tuple[str, ...]
    evenly: bool


class SampleFeed:
    """Takes what has come of `lathe/samples`, when asked.

    Args:
        node: Which subscribes.
        complain: Takes what is wrong with a message that is no block of samples.
    """

    def __init__(self, node: Node, complain: Callable[[LatheChatterError], None]) -> None:
        """Subscribe."""
        self._complain = complain
        self._decoder = SampleDecoder()
        self._known: frozenset[tuple[int, ...]] = frozenset()
        self._messages = PolledSubscription(
            node,
            Float64MultiArray,
            _TOPIC,
            QoSProfile(depth=_BACKLOG),
            QoSOverridingOptions.with_default_policies(),
        )

    def know_lathe(self) -> None:
        """Remember who publishes now."""
        self._known = self._messages.publishers()

    def is_another_lathe(self) -> bool:
        """Whether somebody publishes who did not when the lathe was last known."""
        return not self._messages.publishers() <= self._known

    def take(self) -> Iterator[Fed]:
        """What has come since, in order."""
        blocks: list[Array] = []
        names: tuple[str, ...] = ()
        count = 0
        for serialised, _info in self._messages.take():
            try:
                samples, columns = self._decoder.decode(serialised)
            except LatheChatterError as error:
                self._complain(error)
                continue
            if columns != names or count >= _AT_ONCE:
                yield from together(blocks, names)
                blocks, names, count = [], columns, 0
            if len(samples):
                blocks.append(samples)
                count += len(samples)
        yield from together(blocks, names)


def together(blocks: list[Array], columns: tuple[str, ...]) -> Iterator[Fed]:
    """Blocks as one where they follow each other evenly, else one by one."""
    if not blocks:
        return
    if 'time' in columns:
        joined = np.concatenate(blocks)
        if follow_evenly(joined[:, columns.index('time')]):
            yield Fed(joined, columns, evenly=True)
            return
    for samples in blocks:
        yield Fed(samples, columns, evenly=False)
