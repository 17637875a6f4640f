"""A node that listens to the measured ones, and notes when what it hears was sent."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Iterator

from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_msgs.msg import Float64MultiArray

from lathe_chatter.nodes.node_main import make_executor
from lathe_chatter.nodes.polled_subscription import PolledSubscription
from lathe_chatter.samples.codec import SampleDecoder
from lathe_chatter.samples.continuity import Continuity

DEEP = QoSProfile(depth=5000)
_DEEPEST = QoSProfile(depth=20_000)


class Ear:
    """A node that notes what comes and when it was sent."""

    def __init__(self, *, by_events: bool = False) -> None:
        """Begin deaf."""
        self.node = Node('benchmark')
        self.executor = make_executor(self.node, by_events=by_events)
        self.executor.add_node(self.node)
        self.heard = Continuity()
        self._decoder = SampleDecoder()
        self.sent: list[int] = []
        self.ends: list[float] = []

    def listen_to_samples(self, topic: str = '/lathe/samples') -> None:
        """Note every block of samples from now on."""
        self.node.create_subscription(Float64MultiArray, topic, self._note, DEEP, raw=True)

    def drain_samples(self, until: float, period: float = 0.01) -> Iterator[None]:
        """Follow the samples up to a simulated time, s; hands over after each look at them.

        At ten thousand blocks a second a callback for each is too slow.
        """
        samples = PolledSubscription(self.node, Float64MultiArray, '/lathe/samples', _DEEPEST)
        decoder = SampleDecoder()
        while (self.heard.last or 0.0) < until:
            for serialised, _info in samples.take():
                block, _columns = decoder.decode(serialised)
                self.heard.join(block[:, 0])
            yield
            time.sleep(period)
        samples.end()

    def _note(self, data: bytes, info: dict[str, int]) -> None:
        samples, _columns = self._decoder.decode(data)
        self.heard.join(samples[:, 0])
        self.sent.append(info['source_timestamp'])
        self.ends.append(float(samples[-1, 0]))

    def spin(self, until: Callable[[], object] = lambda: False, limit: float = 30.0) -> None:
        """Listen until something holds, `limit` s at most."""
        end = time.monotonic() + limit
        while time.monotonic() < end and not until():
            self.executor.spin_once(timeout_sec=0.1)

    def wait_for_samples(self) -> None:
        """Wait until a lathe cuts."""
        self.spin(lambda: len(self.sent) > 500)
        if not self.sent:
            sys.exit('no lathe came up')

    def close(self) -> None:
        """End the node."""
        self.executor.remove_node(self.node)
        self.node.destroy_node()


@contextlib.contextmanager
def ear(*, by_events: bool = False) -> Iterator[Ear]:
    """An `Ear` that is closed at the end."""
    listener = Ear(by_events=by_events)
    try:
        yield listener
    finally:
        listener.close()


def wait_for_node(name: str) -> None:
    """Wait until a node is found, and for one second of its life."""
    with ear() as listener:
        listener.spin(lambda: name in [n.replace('//', '/') for n in names(listener.node)])
        listener.spin(limit=1.0)


def names(node: Node) -> list[str]:
    """Full names of the nodes of the graph."""
    return [f'{space}/{name}' for name, space in node.get_node_names_and_namespaces()]
