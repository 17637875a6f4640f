from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import rclpy
from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor

from lathe_chatter.nodes.remote_parameters import RemoteParameters

PATIENCE = 120.0


def test_a_second_list_that_comes_after_the_answer_harms_nobody(context: Context) -> None:
    """A node that a busy machine holds up is asked twice, and its answers come when they come."""
    executors = [SingleThreadedExecutor(context=context) for _ in range(3)]
    asker, lists, gets = (rclpy.create_node(name, context=context) for name in ('a', 'l', 'g'))
    for executor, node in zip(executors, (asker, lists, gets), strict=True):
        executor.add_node(node)
    asking, listing, getting = executors
    listed: list[Any] = []
    answers: list[Any] = []

    def names(_request: Any, response: Any) -> Any:
        listed.append(response)
        response.result.names = ['depth']
        return response

    def values(_request: Any, response: Any) -> Any:
        response.values = [ParameterValue(type=3, double_value=0.5)]
        return response

    lists.create_service(ListParameters, '/slow/list_parameters', names)
    gets.create_service(GetParameters, '/slow/get_parameters', values)
    remote = RemoteParameters(asker, lambda name, found: answers.append((name, found)))
    remote.ask('/slow')

    def until(done: Callable[[], object], *spun: SingleThreadedExecutor) -> None:
        end = time.monotonic() + PATIENCE
        while not done():
            assert time.monotonic() < end
            remote.look()
            for executor in (asking, *spun):
                executor.spin_once(timeout_sec=0.01)

    began = time.monotonic()
    until(lambda: time.monotonic() > began + 3.0)  # asked twice and more, and nobody answers
    until(lambda: listed, listing)
    until(lambda: answers, getting)
    began = time.monotonic()
    until(lambda: time.monotonic() > began + 1.0, listing, getting)
    assert answers == [('/slow', {'depth': 0.5})]
    for executor, node in zip(executors, (asker, lists, gets), strict=True):
        executor.remove_node(node)
        node.destroy_node()
        executor.shutdown()
