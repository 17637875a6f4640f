"""The loop that wakes the lathe: ticks by the clock, and requests served between them."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import pytest
from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import ListParameters, SetParameters
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import Float64
from std_srvs.srv import SetBool
from support.node_bench import messages_of

from lathe_chatter.nodes.lathe_node import LatheNode
from lathe_chatter.nodes.monitor_node import MonitorNode
from lathe_chatter.nodes.node_main import make_executor
from lathe_chatter.nodes.real_time_loop import SECOND, Schedule, Served, spin_in_ticks
from lathe_chatter.nodes.simulation_control import RunState

PATIENCE = 60.0


@pytest.fixture
def lathe(context: Context) -> Iterator[LatheNode]:
    # Its own priority: the test is no process of its own.
    overrides = [Parameter('realtime_priority', value=0)]
    node = LatheNode(context=context, by_timer=False, parameter_overrides=overrides)
    yield node
    node.destroy_node()


def spin_until(node: LatheNode, predicate: Any) -> None:
    end = time.monotonic() + PATIENCE
    spin_in_ticks(make_executor(node), node, lambda: predicate() or time.monotonic() > end)
    assert predicate()


def test_it_ticks_by_the_clock(lathe: LatheNode) -> None:
    began = time.monotonic()
    spin_until(lathe, lambda: lathe.samples_taken >= 3000)
    # Never ahead of the clock, but for the half period that counts as in time.
    assert lathe.samples_taken / 1e4 <= time.monotonic() - began + 0.001


def test_it_ends_with_its_context(lathe: LatheNode, context: Context) -> None:
    looks = 0

    def shut_down() -> bool:
        nonlocal looks
        looks += 1
        if looks == 10:
            context.shutdown()
        return looks > 1000

    spin_in_ticks(make_executor(lathe), lathe, shut_down)
    assert 10 <= looks < 1000


@pytest.mark.parametrize('factor', [0.0, 0.5, 1.0, 10.0])
def test_requests_are_served_between_ticks_and_in_a_pause(lathe: LatheNode, factor: float) -> None:
    # The node is its own client: one thread serves both.
    set_parameters = lathe.create_client(SetParameters, '~/set_parameters')
    pause = lathe.create_client(SetBool, '~/pause')
    spin_until(lathe, lambda: set_parameters.service_is_ready() and pause.service_is_ready())
    request = SetParameters.Request(parameters=messages_of({'real_time_factor': factor}))
    answer = set_parameters.call_async(request)
    spin_until(lathe, answer.done)
    now = lathe.samples_taken
    spin_until(lathe, lambda: lathe.samples_taken > now + 100)
    paused = pause.call_async(SetBool.Request(data=True))
    spin_until(lathe, paused.done)
    now = lathe.samples_taken
    resumed = pause.call_async(SetBool.Request(data=False))
    spin_until(lathe, resumed.done)
    spin_until(lathe, lambda: lathe.samples_taken > now)


def test_where_ticks_leave_no_time_requests_have_as_much_as_the_ticks(lathe: LatheNode) -> None:
    knock = lathe.create_publisher(Float64, '~/knock', 100)
    spin_until(lathe, lambda: knock.get_subscription_count() == 1)
    executor = make_executor(lathe)
    executor.add_node(lathe)
    served = Served(executor, lathe, serve_period=0)
    try:
        for expected in (100, 200):
            for _ in range(100):
                knock.publish(Float64(data=1e-6))
            time.sleep(0.5)  # DDS has them by then; more time does no harm
            before, goes = lathe.requests.served, 0
            while lathe.requests.served < before + 100:
                # Ticks that took a second each, and are due again at once.
                served.spent = int(1e9)
                served.serve(time.monotonic_ns())
                goes += 1
                assert goes < 10, f'{lathe.requests.served - before} of 100 served'
            assert lathe.requests.served >= expected
    finally:
        executor.remove_node(lathe)
        executor.shutdown()


def until_connected(served: Served, *connected: Any) -> None:
    end = time.monotonic() + PATIENCE
    while not all(each() for each in connected):
        assert time.monotonic() < end
        served.serve(time.monotonic_ns())


def serves_until(served: Served, done: Any) -> int:
    """How often a loop has served when something is done; it fails beyond 200 times."""
    serves = 0
    while not done():
        assert serves < 200
        served.serve(time.monotonic_ns())
        serves += 1
        time.sleep(0.01)
    return serves


def test_what_a_flood_has_left_holds_up_nobody(lathe: LatheNode, context: Context) -> None:
    """The executor takes each request, and has it served behind all that came meanwhile."""
    client = Node('client', context=context)
    floods = client.create_client(SetParameters, '/lathe/set_parameters')
    asked = client.create_client(SetBool, '/lathe/pause')
    executor = make_executor(lathe)
    executor.add_node(lathe)
    served = Served(executor, lathe)
    until_connected(served, asked.service_is_ready, floods.service_is_ready)
    request = SetParameters.Request(parameters=messages_of({'depth_of_cut': 0.0004}))
    for _ in range(300):
        for _ in range(10):
            floods.call_async(request)
        time.sleep(0.002)
        served.serve(time.monotonic_ns())
    asked.call_async(SetBool.Request(data=True))

    def has_paused() -> bool:
        served.spent = int(SECOND)  # what ticks took meanwhile
        return lathe.run_state is not RunState.RUNNING

    serves_until(served, has_paused)
    executor.remove_node(lathe)
    client.destroy_node()


def test_what_others_tell_holds_up_nobody_either(context: Context) -> None:
    """A monitor hears every change of every parameter, and counts none of them as a request."""
    monitor = MonitorNode(context=context, by_timer=False)
    client = Node('client', context=context)
    tells = client.create_publisher(ParameterEvent, '/parameter_events', 5000)
    asked = client.create_client(ListParameters, '/chatter_monitor/list_parameters')
    executor = make_executor(monitor)
    executor.add_node(monitor)
    served = Served(executor, monitor)
    until_connected(served, asked.service_is_ready, tells.get_subscription_count)
    for _ in range(300):
        for _ in range(10):
            tells.publish(ParameterEvent(node='/another'))
        served.serve(time.monotonic_ns())
        time.sleep(0.01)
    before = monitor.requests.served
    asked.call_async(ListParameters.Request())
    assert serves_until(served, lambda: monitor.requests.served > before) < 100
    executor.remove_node(monitor)
    monitor.destroy_node()
    client.destroy_node()


def test_what_is_late_is_done_once() -> None:
    done: list[int] = []
    schedule = Schedule((3600.0, lambda: done.append(1)))
    schedule._due = [time.monotonic_ns() - 10 * 3600 * SECOND]
    schedule.run()
    schedule.run()
    assert done == [1]
