"""Node `operator_page`: a page in a browser that shows the lathes there are and drives them.

It is a client of public topics, parameters and services. One thread does it all: the loop of
asyncio serves the page, and looks every 50 ms for what has come over DDS. A lathe is listened to
while somebody looks at it.
"""

from __future__ import annotations

import asyncio
import sys
import time
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Log, ParameterEvent
from rclpy.executors import Executor
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message

from lathe_chatter.errors import LatheChatterError
from lathe_chatter.lathe.change_and_knock_sentences import on_the_shop_floor, parse_change
from lathe_chatter.nodes.diagnostics import DiagnosticsListener
from lathe_chatter.nodes.node_main import run_node
from lathe_chatter.nodes.operator_page_cell import OperatedCell
from lathe_chatter.nodes.parameter_node import ParameterNode
from lathe_chatter.nodes.parameter_tables import PAGE
from lathe_chatter.nodes.polled_subscription import PolledSubscription
from lathe_chatter.page.server import FRAME_PERIOD, PageServer, Viewer
from lathe_chatter.page.versioned_values import Board
from lathe_chatter.precompile import CHART_LOOPS, precompile
from lathe_chatter.samples.codec import SAMPLES_TYPE
from lathe_chatter.scenario import find_scenario, load_scenario
from lathe_chatter.scenario.scenario import shipped_scenarios

_SPIN_PERIOD = 0.005
"""s from one look for answers to the next, while some are awaited."""
_LOOK_PERIOD = 1.0
_KEPT_UNSEEN = 60.0
"""s that a lathe is listened to when nobody looks at it any more."""
_MOST_SENTENCES = 400
_LATCHED = QoSProfile(depth=200, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class OperatorPageNode(ParameterNode):
    """Follows the lathes that somebody looks at, and serves the page.

    Args:
        options: As for `rclpy.node.Node`.

    Raises:
        ParameterError: If a parameter given at the start is not allowed.
        StartError: If the page cannot be served as asked for.
    """

    def __init__(self, **options: Any) -> None:
        """Listen for viewers; `serve` serves them."""
        super().__init__('operator_page', PAGE, **options)
        # Before the first viewer comes: while it is compiled the page stands still.
        precompile(CHART_LOOPS, say=self.bounded_log.info)
        values: Any = self.values
        self.server = PageServer(self, values['host'], values['port'], values['token'])
        self.heard = DiagnosticsListener()
        self._board = Board()
        self._board.put('recorded', value=False)
        self._board.put('begun', time.strftime('%H:%M:%S'))
        self._board.put('scenarios', {name: _about(name) for name in sorted(shipped_scenarios())})
        self._cells: dict[str, OperatedCell] = {}
        self._left: dict[str, float] = {}
        self._sentences: deque[dict[str, Any]] = deque(maxlen=_MOST_SENTENCES)
        self._look_at = 0.0
        self._topics: list[tuple[PolledSubscription, Any, Callable[[Any], None]]] = [
            (PolledSubscription(self, kind, topic, qos), kind, take)
            for kind, topic, qos, take in (
                (Log, '/rosout', _LATCHED, self._on_log),
                (DiagnosticArray, '/diagnostics', QoSProfile(depth=100), self.heard.take),
                (ParameterEvent, '/parameter_events', QoSProfile(depth=100), self._on_event),
            )
        ]
        self.bounded_log.info(f'The page is at {self.server.url}')

    def declare_parameter(self, name: str, value: Any = None, *rest: Any, **more: Any) -> Any:
        """Declare a parameter; the token is told to nobody, nor recorded with the others."""
        value = 'not shown' if name == 'token' and value else value
        return super().declare_parameter(name, value, *rest, **more)

    # -- the loop --------------------------------------------------------------------------

    async def serve(self, executor: Executor, ended: Callable[[], bool]) -> None:
        """Serve the page until `ended` says so."""
        serving = asyncio.create_task(self.server.run())
        while self.context.ok() and not ended() and not serving.done():
            self._take()
            until = time.monotonic() + FRAME_PERIOD
            while (left := until - time.monotonic()) > 0.0:
                executor.spin_once(timeout_sec=0.0)
                awaited = any(cell.clients.awaited for cell in self._cells.values())
                await asyncio.sleep(min(left, _SPIN_PERIOD if awaited else FRAME_PERIOD / 2.0))
        self.server.end()
        await serving

    def _take(self) -> None:
        """Take what has come, and once a second look around."""
        for subscription, kind, take in self._topics:
            for data, _info in subscription.take():
                take(deserialize_message(data, kind))
        now = time.monotonic()
        if now >= self._look_at:
            self._look_at = now + _LOOK_PERIOD
            self._look(now)
        for cell in self._cells.values():
            cell.take()

    def _look(self, now: float) -> None:
        """See which lathes there are, and which nobody looks at."""
        found = {
            name.removesuffix('/samples')
            for name, kinds in self.get_topic_names_and_types()
            if name.endswith('/samples') and SAMPLES_TYPE in kinds
        }
        self._board.put('lathes', sorted({name for name in found if name} | {*self._cells}))
        # Who operates in another page this one cannot know, but that it may be so.
        names = [name for name, _ in self.get_node_names_and_namespaces()]
        pages = sum(name.startswith('operator_page') for name in names)
        self._board.put('other_pages', pages - 1)
        watched = {viewer.choice for viewer in self.server.viewers}
        for name in [*self._cells]:
            if name in watched or self._cells[name].playing is not None:
                self._left[name] = now
            elif now - self._left[name] > _KEPT_UNSEEN:
                self._cells.pop(name).end()

    def _on_log(self, message: Any) -> None:
        """Keep a sentence that the nodes of a lathe logged."""
        change, text = parse_change(message.msg), message.msg
        if change is not None:
            changes = (
                f'{on_the_shop_floor(name, old)} → {on_the_shop_floor(name, change.new[name])}'
                for name, old in change.old.items()
            )
            text = f'At {change.time:.3f} s: {", ".join(changes)}.'
        node = f'/{message.name.replace(".", "/")}'
        entry = {'node': node, 'text': text, 'level': message.level, 'at': message.stamp.sec}
        self._sentences.append(entry)
        for cell in self._cells.values():
            cell.add_sentence(entry)

    def _on_event(self, message: Any) -> None:
        for cell in self._cells.values():
            cell.clients.on_event(message)

    # -- what viewers are shown, and ask for -----------------------------------------------

    def frame(self, viewer: Viewer) -> tuple[dict[str, Any], dict[str, Any]]:
        """What is new for a viewer."""
        header: dict[str, Any] = {}
        arrays: dict[str, Any] = {}
        if news := self._board.news(viewer.seen.setdefault('page', {})):
            header['page'] = news
        cell = self._cells.get(viewer.choice)
        if cell is not None:
            cell.fill(viewer, header, arrays)
        return header, arrays

    async def look(self, viewer: Viewer, wish: Mapping[str, Any]) -> bool:
        """Choose a lathe to look at."""
        if wish['do'] != 'choose':
            return False
        name = wish['lathe']
        if name not in (self._board.get('lathes') or ()):
            raise LatheChatterError(f'There is no lathe {name!r:.80}.')
        if name not in self._cells:
            self._cells[name] = OperatedCell(self, name, self.heard)
            for entry in self._sentences:
                self._cells[name].add_sentence(entry)
        viewer.choice = name
        viewer.seen.pop('cell', None)
        viewer.cursors.clear()
        return True

    async def act(self, viewer: Viewer, wish: Mapping[str, Any]) -> str:
        """Drive the lathe that a viewer looks at."""
        cell = self._cells.get(viewer.choice)
        if cell is None:
            raise LatheChatterError('Choose a lathe first.')
        return await cell.act(wish)


def _about(name: str) -> str:
    """What a scenario is, in sentences."""
    scenario = load_scenario(find_scenario(name))
    return (
        f'{scenario.title}. It takes {scenario.duration:g} s: the lathe begins anew, with its cut.'
    )


def _spin(executor: Executor, node: OperatorPageNode, ended: Callable[[], bool]) -> None:
    executor.add_node(node)
    sys.stderr.write(f'The page is at {node.server.url}\n')
    try:
        with suppress(KeyboardInterrupt):
            asyncio.run(node.serve(executor, ended))
    finally:
        executor.remove_node(node)
        executor.shutdown()


def main() -> None:
    """Run the node until it is told to end."""
    run_node(
        lambda own: OperatorPageNode(cli_args=own['operator_page']),
        {'operator_page': PAGE},
        spin=_spin,
    )
