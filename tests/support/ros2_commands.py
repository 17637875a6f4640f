"""The few commands of `ros2` that the documentation shows, for machines that have no ros2cli.

    python -m support.ros2_commands param set /lathe depth_of_cut 0.001

The wheels of ROS 2 on the Python package index do not have the command line. What it does is done
here through rclpy: the same services and topics of the same nodes, over DDS.
"""

from __future__ import annotations

import sys
import time
from importlib import import_module
from typing import Any

import rclpy
import yaml
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.qos import QoSProfile, ReliabilityPolicy

PATIENCE = 120.0


def main(words: list[str]) -> int:
    """Do what `ros2` would with these words; its exit code."""
    rclpy.init()
    node = rclpy.create_node('ros2_commands')
    try:
        return _COMMANDS[tuple(words[:2])](node, *words[2:])
    finally:
        node.destroy_node()
        rclpy.shutdown()


def _param_set(node: Node, name: str, parameter: str, value: str) -> int:
    wanted = Parameter(parameter, value=yaml.safe_load(value)).to_parameter_msg()
    answer = _call(node, SetParameters, f'{name}/set_parameters', parameters=[wanted])
    result = answer.results[0]
    print('Set parameter successful' if result.successful else result.reason)  # noqa: T201
    return int(not result.successful)


def _param_get(node: Node, name: str, parameter: str) -> int:
    answer = _call(node, GetParameters, f'{name}/get_parameters', names=[parameter])
    print(parameter_value_to_python(answer.values[0]))  # noqa: T201
    return 0


def _topic_echo(node: Node, *words: str) -> int:
    topic = next(word for word in words if word.startswith('/'))
    received: list[Any] = []
    end = time.monotonic() + PATIENCE
    while not (offers := node.get_publishers_info_by_topic(topic)):
        _check(end, topic)
        rclpy.spin_once(node, timeout_sec=0.1)
    qos = QoSProfile(
        depth=10,
        durability=offers[0].qos_profile.durability,
        reliability=ReliabilityPolicy.RELIABLE,
    )
    node.create_subscription(_type(offers[0].topic_type), topic, received.append, qos)
    while not received:
        _check(end, topic)
        rclpy.spin_once(node, timeout_sec=0.1)
    print(received[0])  # noqa: T201
    return 0


def _service_call(node: Node, name: str, kind: str, values: str = '{}') -> int:
    answer = _call(node, _type(kind), name, **yaml.safe_load(values))
    print(answer)  # noqa: T201
    return 0


def _call(node: Node, kind: Any, name: str, **values: Any) -> Any:
    client = node.create_client(kind, name)
    if not client.wait_for_service(PATIENCE):
        raise SystemExit(f'There is no service {name}.')
    future = client.call_async(kind.Request(**values))
    rclpy.spin_until_future_complete(node, future, timeout_sec=PATIENCE)
    return future.result()


def _type(name: str) -> Any:
    package, folder, kind = name.split('/')
    return getattr(import_module(f'{package}.{folder}'), kind)


def _check(end: float, what: str) -> None:
    if time.monotonic() > end:
        raise SystemExit(f'{what}: nobody publishes it.')


_COMMANDS: dict[tuple[str, ...], Any] = {
    ('param', 'set'): _param_set,
    ('param', 'get'): _param_get,
    ('topic', 'echo'): _topic_echo,
    ('service', 'call'): _service_call,
}

if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
