"""A subscription that is asked for its messages: no executor of its node takes any."""

from __future__ import annotations

import time

import pytest
from rclpy.context import Context
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.qos import QoSProfile
from rclpy.topic_endpoint_info import TopicEndpointInfo
from std_msgs.msg import Float64
from std_srvs.srv import SetBool

from lathe_chatter.nodes.node_main import make_executor
from lathe_chatter.nodes.parameter_node import ParameterNode
from lathe_chatter.nodes.parameter_tables import PAGE
from lathe_chatter.nodes.polled_subscription import PolledSubscription, full_name

PATIENCE = 60.0


@pytest.mark.parametrize('make', [make_executor, lambda _: None])
def test_messages_wait_until_they_are_asked_for(context: Context, make: object) -> None:
    node = ParameterNode('listener', PAGE, context=context)
    executor: Executor = make(node) or SingleThreadedExecutor(context=context)  # type: ignore[operator]
    executor.add_node(node)
    polled = PolledSubscription(node, Float64, 'numbers', QoSProfile(depth=10))
    called: list[bool] = []
    node.create_service(SetBool, 'call', lambda _, answer: called.append(True) or answer)
    client = node.create_client(SetBool, 'call')
    publisher = node.create_publisher(Float64, 'numbers', 10)
    end = time.monotonic() + PATIENCE
    try:
        while not (publisher.get_subscription_count() and client.service_is_ready()):
            assert time.monotonic() < end
            executor.spin_once(timeout_sec=0.01)
        for value in (1.0, 2.0, 3.0):
            publisher.publish(Float64(data=value))
        # The executor is at work meanwhile.
        answer = client.call_async(SetBool.Request())
        while not answer.done():
            assert time.monotonic() < end
            executor.spin_once(timeout_sec=0.01)
        taken: list[bytes] = []
        while len(taken) < 3:
            assert time.monotonic() < end, f'{len(taken)} of 3 were left'
            taken += [data for data, _info in polled.take()]
            executor.spin_once(timeout_sec=0.01)
        assert called == [True]
    finally:
        executor.remove_node(node)
        executor.shutdown()
        node.destroy_node()


@pytest.mark.parametrize(
    ('namespace', 'name', 'expected'),
    [
        ('/', 'lathe', '/lathe'),
        ('/cell', 'lathe', '/cell/lathe'),
        ('_NODE_NAMESPACE_UNKNOWN_', '_NODE_NAME_UNKNOWN_', 'a node of unknown name'),
    ],
)
def test_a_publisher_has_the_name_of_its_node_or_is_said_to_be_unknown(
    namespace: str, name: str, expected: str
) -> None:
    assert full_name(TopicEndpointInfo(node_namespace=namespace, node_name=name)) == expected
