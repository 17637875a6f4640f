"""What the page asks of nodes, and what it says where they do not do it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_srvs.srv import Trigger
from support.node_bench import Bench
from support.node_processes import NodeProcesses

from lathe_chatter.errors import LatheChatterError
from lathe_chatter.nodes.lathe_node import LatheNode
from lathe_chatter.nodes.operator_page_clients import CellClients


def refusal(bench: Bench, work: Any) -> str:
    """Why something is not done."""

    async def answer() -> str:
        doing = asyncio.ensure_future(work)
        while not doing.done():
            bench.executor.spin_once(timeout_sec=0.0)
            await asyncio.sleep(0.002)
        try:
            await doing
        except LatheChatterError as error:
            return str(error)
        return ''

    return asyncio.run(answer())


@pytest.fixture
def clients(bench: Bench) -> CellClients:
    return CellClients(bench.node, '/lathe', lambda _name, _value: None)


def test_who_is_not_there_is_named(clients: CellClients, bench: Bench) -> None:
    for work in (clients.call('step'), clients.set('lathe', {})):
        assert refusal(bench, work) == '/lathe is not there.'
    assert refusal(bench, clients.call('accept')) == '/chatter_supervisor is not there.'
    with pytest.raises(LatheChatterError, match='is not there'):
        clients.knock(1e-3, there=False)


def test_parameters_are_set_where_they_are_known_and_of_those_that_have_some(
    clients: CellClients, bench: Bench, start: Callable[..., Any]
) -> None:
    start(LatheNode)
    service = clients._clients['lathe', 'set_parameters_atomically'].service_is_ready
    bench.spin_until(service, 'the lathe')
    work = clients.set('lathe', {'depth_of_cut': 1e-4})
    assert refusal(bench, work) == 'The parameters of /lathe are not known yet.'
    work = clients.set('monitor', {'model': 'none'})
    assert refusal(bench, work) == "Nothing of 'monitor' can be set from here."


def test_who_does_not_answer_is_named(clients: CellClients, bench: Bench) -> None:
    deaf = Node('deaf', context=bench.node.context)
    idle = SingleThreadedExecutor(context=bench.node.context)  # that nobody spins
    idle.add_node(deaf)
    deaf.create_service(Trigger, '/lathe/step', lambda _, answer: answer)
    bench.spin_until(clients._clients['lathe', 'step'].service_is_ready, 'the service')
    assert refusal(bench, clients.call('step')) == '/lathe did not answer within 3 s.'
    assert clients.awaited == 0
    deaf.destroy_node()
    idle.shutdown()


def test_another_lathe_of_the_name_of_one_that_was_killed_is_asked_anew(
    clients: CellClients, bench: Bench, nodes: NodeProcesses
) -> None:
    """Its services were never away: DDS keeps those of a killed one for a while."""

    def await_depth(depth: float) -> None:
        def is_known() -> bool:
            assert refusal(bench, clients.look()) == ''
            return bool(clients.values.get('lathe', {}).get('depth_of_cut') == depth)

        bench.spin_until(is_known, f'a depth of {depth} m')

    for depth in (1e-4, 2e-4):
        nodes.start('lathe', f'depth_of_cut:={depth}', 'use_sim_time:=true')
        await_depth(depth)
        nodes.kill('/lathe')
