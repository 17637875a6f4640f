"""A node on the test bench: an ordinary client that listens, asks and sets, all over DDS."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import serialize_message
from std_msgs.msg import Float64
from std_srvs.srv import SetBool, Trigger

from lathe_chatter.array_types import Array
from lathe_chatter.nodes.recorded_subscription import _BACKLOG_HERE
from lathe_chatter.samples.codec import SampleDecoder

DEEP = QoSProfile(depth=5000)
LATCHED = QoSProfile(depth=5000, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Bench:
    """Listens to topics and calls the services of nodes spun by the same test."""

    def __init__(self, context: Context, executor: SingleThreadedExecutor, spin: Any) -> None:
        self.node = Node('bench', context=context)
        self.executor = executor
        self.spin_until = spin
        self._clients: dict[str, Any] = {}
        executor.add_node(self.node)

    def another(self, name: str) -> Node:
        """Somebody else's node, which goes with the test, however that ends."""
        node = Node(name, context=self.node.context)
        self.executor.add_node(node)
        return node

    def let_go(self, node: Node) -> None:
        """End somebody else's node before the test ends."""
        self.executor.remove_node(node)
        node.destroy_node()

    def listen(self, kind: Any, topic: str, qos: QoSProfile = DEEP) -> list[Any]:
        """The messages of a topic, as they come; returns once its publisher is found."""
        messages: list[Any] = []
        subscription = self.node.create_subscription(kind, topic, messages.append, qos)
        self.spin_until(
            lambda: self.node.count_publishers(subscription.topic_name), f'a publisher of {topic}'
        )
        return messages

    def listen_first(self, kind: Any, topic: str, qos: QoSProfile = DEEP) -> list[Any]:
        """The messages of a topic that nobody publishes yet."""
        messages: list[Any] = []
        self.node.create_subscription(kind, topic, messages.append, qos)
        return messages

    def talk(self, kind: Any, topic: str) -> Any:
        """A publisher; returns once somebody listens."""
        publisher = self.node.create_publisher(kind, topic, DEEP)
        self.spin_until(publisher.get_subscription_count, f'a listener to {topic}')
        return publisher

    def talk_alone(self, kind: Any, topic: str) -> Any:
        """A publisher to whom nobody need listen."""
        return self.node.create_publisher(kind, topic, DEEP)

    def overflow(self, topic: str, first_came: Callable[[], object]) -> int:
        """Send a recorder more numbers than have room, after one that has come; how many."""
        publisher = self.talk(Float64, topic)
        publisher.publish(Float64())
        self.spin_until(first_came, 'the first')
        for _ in range(2 * _BACKLOG_HERE):
            publisher.publish(Float64())
        return 1 + 2 * _BACKLOG_HERE

    def call(self, kind: Any, service: str, request: Any) -> Any:
        """The answer of a service."""
        # Kept: a server may not have found a new client yet when it answers, and DDS drops that.
        client = self._clients.get(service) or self.node.create_client(kind, service)
        self._clients[service] = client
        self.spin_until(client.service_is_ready, service)
        future = client.call_async(request)
        self.spin_until(future.done, f'an answer of {service}')
        return future.result()

    def trigger(self, service: str) -> Any:
        return self.call(Trigger, service, Trigger.Request())

    def pause(self, node: str, *, pause: bool = True) -> Any:
        return self.call(SetBool, f'{node}/pause', SetBool.Request(data=pause))

    def steps(self, node: str, count: int) -> None:
        """Step a paused lathe."""
        client = self.node.create_client(Trigger, f'{node}/step')
        self.spin_until(client.service_is_ready, 'step')
        for _ in range(count):
            future = client.call_async(Trigger.Request())
            self.spin_until(future.done, 'a step')
            assert future.result().success, future.result().message
        self.node.destroy_client(client)

    def set(self, node: str, **values: Any) -> Any:
        """Set parameters one by one: the results."""
        request = SetParameters.Request(parameters=messages_of(values))
        return self.call(SetParameters, f'{node}/set_parameters', request).results

    def set_together(self, node: str, **values: Any) -> Any:
        """Set parameters all or none: the result."""
        request = SetParametersAtomically.Request(parameters=messages_of(values))
        service = f'{node}/set_parameters_atomically'
        return self.call(SetParametersAtomically, service, request).result


def messages_of(values: dict[str, Any]) -> list[ParameterMessage]:
    return [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]


def samples_of(message: Any) -> Array:
    """The samples (n, 8) of a message that ROS has decoded."""
    return SampleDecoder().decode(serialize_message(message))[0]
