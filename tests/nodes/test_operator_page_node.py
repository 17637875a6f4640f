"""The node of the page without a browser: where it is, whom it shows, and what it says of logs."""

from __future__ import annotations

import asyncio
import http.client
import re
import time
from collections.abc import Callable, Mapping
from typing import Any

import pytest
from rcl_interfaces.msg import Log
from rclpy.serialization import deserialize_message
from support.node_bench import LATCHED, Bench
from support.node_processes import NodeProcesses

from lathe_chatter.errors import LatheChatterError
from lathe_chatter.nodes.lathe_node import LatheNode
from lathe_chatter.nodes.operator_page_node import OperatorPageNode
from lathe_chatter.page.server import Viewer

Start = Callable[..., Any]


def refusal(work: Any) -> str:
    with pytest.raises(LatheChatterError) as refused:
        asyncio.run(work)
    return str(refused.value)


def test_the_page_is_where_it_says(nodes: NodeProcesses) -> None:
    nodes.start('operator_page', 'port:=0')
    until = time.monotonic() + 120.0
    while not (said := re.findall(r'The page is at (http://\S+/)', nodes.said())):
        assert time.monotonic() < until, nodes.said()
        time.sleep(0.1)
    assert len({*said}) == 1
    asked = http.client.HTTPConnection(said[0].split('/')[2])
    asked.request('GET', '/')
    assert b'<title>Lathe</title>' in asked.getresponse().read()


def test_the_token_is_told_to_nobody(start: Start, bench: Bench) -> None:
    log = bench.listen_first(Log, '/rosout', LATCHED)
    node = start(OperatorPageNode, port=0, token='a token of a test')  # noqa: S106 -- none
    assert node.get_parameter('token').value == 'not shown'
    assert start(OperatorPageNode, port=0).get_parameter('token').value == ''
    bench.spin_until(lambda: any(node.server.url in m.msg for m in log), 'where it is')
    assert not any('a token of' in m.msg for m in log)


def test_it_shows_the_lathes_there_are_and_their_changes_in_words(
    start: Start, bench: Bench
) -> None:
    page, viewer = start(OperatorPageNode, port=0), Viewer('a test', trusted=True)
    wish: Mapping[str, Any] = {'do': 'choose', 'lathe': '/lathe'}
    page._take()
    assert refusal(page.look(viewer, wish)) == "There is no lathe '/lathe'."
    assert refusal(page.act(viewer, {'do': 'back'})) == 'Choose a lathe first.'
    lathe = start(LatheNode)

    def there() -> bool:
        page._look(time.monotonic())
        return '/lathe' in page._board.get('lathes')

    bench.spin_until(there, 'the lathe')
    assert asyncio.run(page.look(viewer, wish))
    cell = page._cells['/lathe']
    assert bench.set_together('/lathe', depth_of_cut=0.0006).successful
    seen: list[str] = []

    def told() -> bool:
        for subscription, kind, take in page._topics[:1]:
            for data, _ in subscription.take():
                take(deserialize_message(data, kind))
        seen[:] = [entry['text'] for entry in cell.board.get('log') or ()]
        return any('depth' in text for text in seen)

    bench.spin_until(told, 'the change')
    (change,) = [text for text in seen if 'depth' in text]
    assert re.fullmatch(r'At \d+\.\d{3} s: depth 0\.5 mm → depth 0\.6 mm\.', change)
    assert float(change.split()[1]) <= lathe._lathe.time
    cell.end()


def test_a_scenario_is_described_as_it_is(start: Start) -> None:
    page = start(OperatorPageNode, port=0)
    told = page._board.get('scenarios')['no_clearance']
    assert re.search(r'\. It takes \d+ s: the lathe begins anew, with its cut\.$', told)
