"""What the page shows of one lathe and does with it, without a browser: real nodes, over DDS."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import ParameterEvent
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger
from support.node_bench import LATCHED, Bench

from lathe_chatter.errors import LatheChatterError
from lathe_chatter.nodes.diagnostics import DiagnosticsListener
from lathe_chatter.nodes.lathe_node import LatheNode
from lathe_chatter.nodes.operator_page_cell import OperatedCell

Start = Callable[..., Any]
LEFT = 'Its cut and its noise were left so.'
ANEW = f'trial is stopped, for the lathe has begun anew. {LEFT}'
TRIAL = """
name: trial
duration: 1.0
steps: [{at: 0.2, set: {depth_of_cut: 0.0006}, because: deeper}]
"""
WAITING = """
name: waiting
duration: 0.5
supervisor: {mode: ask}
steps:
  - {when: flagged, after: 0.1, set: {depth_of_cut: 0.0004}}
  - {when: cleared, set: {depth_of_cut: 0.0003}}
  - {when: asked, accept: true, because: it helps}
"""


class Desk:
    """A cell of a page, and somebody at it."""

    def __init__(self, bench: Bench, folder: Path) -> None:
        self.bench, self.folder, self.heard = bench, folder, DiagnosticsListener()
        bench.listen_first(DiagnosticArray, '/diagnostics')
        node = bench.node
        node.create_subscription(DiagnosticArray, '/diagnostics', self.heard.take, 100)
        self.cell = OperatedCell(node, '/lathe', self.heard)
        node.create_subscription(
            ParameterEvent, '/parameter_events', self.cell.clients.on_event, 100
        )
        self.loop = asyncio.new_event_loop()
        self.told: list[str] = []

    def until(self, holds: Callable[[], object], what: str) -> None:
        def look() -> object:
            self.loop.run_until_complete(self._turn())
            return holds()

        self.bench.spin_until(look, what)

    async def _turn(self) -> None:
        for go_on in (True, False):
            if go_on:
                self.cell.take()
            text = (self.cell.board.get('scenario') or {}).get('text')
            if text and text not in self.told[-1:]:
                self.told.append(text)
            await asyncio.sleep(0.002 * go_on)

    def knows_the_lathe(self) -> None:
        self.until(lambda: self.cell.clients.values.get('lathe'), 'its parameters')
        self.until(lambda: self.heard.values('/lathe', 'cut'), 'its diagnostics')

    def act(self, **wish: Any) -> str:
        """What is said to a wish, or why it is refused."""

        async def answer() -> str:
            try:
                return await self.cell.act(wish)
            except LatheChatterError as error:
                return f'Refused: {error}'

        doing = self.loop.create_task(answer())
        self.until(doing.done, 'an answer')
        return doing.result()

    def play(self, scenario: str) -> str:
        file = self.folder / 'scenario.yaml'
        file.write_text(scenario)
        return self.act(do='play', scenario=str(file))

    def says(self, text: str) -> None:
        self.until(lambda: text in self.told, text)


@pytest.fixture
def desk(bench: Bench, tmp_path: Path) -> Iterator[Desk]:
    desk = Desk(bench, tmp_path)
    yield desk
    desk.cell.end()
    desk.loop.run_until_complete(desk.loop.shutdown_default_executor())
    desk.loop.close()


@pytest.fixture
def lathe(start: Start, desk: Desk) -> Any:
    node = start(LatheNode)
    desk.knows_the_lathe()
    return node


def test_a_scenario_says_what_it_did_and_what_it_waits_for(lathe: Any, desk: Desk) -> None:
    assert desk.play(TRIAL) == 'trial has begun.'
    desk.says('trial: has begun; next, at 0.2 s: deeper.')
    desk.says('trial: deeper; it ends at 1 s.')
    assert lathe.values['depth_of_cut'] == 0.0006
    desk.says(f'trial is over. {LEFT}')
    assert desk.cell.playing is None


def test_a_scenario_waits_for_monitor_and_supervisor(lathe: Any, desk: Desk, bench: Bench) -> None:
    none = 'needs a chatter_supervisor, and none is here: lathe-chatter run --page --supervise ask'
    assert f'The scenario waiting {none}' in desk.play(WAITING)
    spoken = bench.talk(DiagnosticArray, '/diagnostics')
    spoken.publish(DiagnosticArray(status=[DiagnosticStatus(name='/chatter_supervisor: action')]))
    desk.until(lambda: '/chatter_supervisor' in desk.heard.statuses, 'a supervisor')
    asked = []

    def accept(_request: Any, response: Any) -> Any:
        asked.append(response)
        response.success = True
        return response

    bench.node.create_service(Trigger, '/chatter_supervisor/accept', accept)
    flags = bench.node.create_publisher(Bool, '/chatter_monitor/chatter', LATCHED)
    actions = bench.node.create_publisher(String, '/chatter_supervisor/action', LATCHED)
    assert desk.play(WAITING) == 'waiting has begun.'
    desk.says('waiting: has begun; next, when chatter is flagged, 0.1 s later: a change.')
    flags.publish(Bool(data=True))
    desk.says('waiting: a step was made; next, when the flag is cleared: a change.')
    assert lathe.values['depth_of_cut'] == 0.0004
    flags.publish(Bool(data=False))
    desk.says('waiting: a step was made; next, when the supervisor asks: it helps.')
    actions.publish(String(data='I would set ...: ~/accept does it.'))
    desk.says('waiting: it helps; it ends at 0.5 s.')
    assert asked
    desk.says(f'waiting is over. {LEFT}')


@pytest.mark.usefixtures('lathe')
def test_a_step_that_is_refused_was_not_made(desk: Desk, bench: Bench) -> None:
    none = 'Nothing is waiting to be accepted.'

    def refuse(_request: Any, response: Any) -> Any:
        response.message = none
        return response

    bench.node.create_service(Trigger, '/chatter_supervisor/accept', refuse)
    desk.heard.spoke('/chatter_supervisor')
    actions = bench.node.create_publisher(String, '/chatter_supervisor/action', LATCHED)
    asked = 'name: asked\nduration: 0.5\nsupervisor: {}\nsteps: [{when: asked, accept: true}]\n'
    assert desk.play(asked) == 'asked has begun.'
    actions.publish(String(data='I would set ...: ~/accept does it.'))
    desk.until(lambda: desk.cell.playing is None, 'its end')
    assert desk.told[1:] == [f'asked is stopped: {none} {LEFT}']


@pytest.mark.usefixtures('lathe')
@pytest.mark.parametrize('by', ['a call of somebody', 'the page'])
def test_a_lathe_that_begins_anew_ends_a_scenario(desk: Desk, bench: Bench, by: str) -> None:
    long = TRIAL.replace('duration: 1.0', 'duration: 90.0').replace('0.2', '80.0')
    assert desk.play(long) == 'trial has begun.'
    desk.until(lambda: desk.cell._signals.time > 0.3, 'some of it')
    if by == 'the page':
        assert desk.act(do='reset') == 'At time zero again, running.'
    else:
        assert bench.trigger('/lathe/reset').success
    desk.says(ANEW)
    assert desk.cell.playing is None


@pytest.mark.usefixtures('lathe')
def test_a_scenario_after_another_begins_at_its_own_time(desk: Desk) -> None:
    long = TRIAL.replace('duration: 1.0', 'duration: 90.0')
    assert desk.play(long) == 'trial has begun.'
    desk.says('trial: deeper; it ends at 90 s.')
    assert desk.play(TRIAL.replace('trial', 'other')) == 'other has begun.'
    desk.says('other: has begun; next, at 0.2 s: deeper.')
    assert f'trial is stopped, for another is to begin. {LEFT}' in desk.told
    assert desk.act(do='back') == 'Refused: other is being played: stop it first.'
    desk.act(do='stop_playing')
    desk.says(f'other is stopped. {LEFT}')


def test_the_cut_of_before_is_set_once_and_only_where_there_is_one(lathe: Any, desk: Desk) -> None:
    none = 'Refused: There is no cut of before a scenario to go back to.'
    assert desk.act(do='back') == none
    desk.act(do='set', node='lathe', values={'depth_of_cut': 0.0002})
    desk.until(lambda: desk.cell.clients.values['lathe']['depth_of_cut'] == 0.0002, 'it')
    desk.play(TRIAL)
    desk.says(f'trial is over. {LEFT}')
    assert desk.act(do='back') == 'The cut was set as before the scenario.'
    desk.says('The cut was set as before the scenario.')
    assert lathe.values['depth_of_cut'] == 0.0002
    assert desk.act(do='back') == none


def test_a_lathe_of_few_ticks_is_not_said_to_send_nothing(start: Start, desk: Desk) -> None:
    start(LatheNode, tick_rate=1.0, real_time_factor=0.5)
    desk.knows_the_lathe()
    desk.until(lambda: desk.cell.board.get('alive')['samples'], 'samples')
    seen: set[bool] = set()

    def later() -> bool:
        seen.add(desk.cell.board.get('alive')['samples'])
        return bool(desk.cell._signals.time > 2.5)

    desk.until(later, 'some ticks')
    assert seen == {True}


@pytest.mark.usefixtures('lathe')
def test_a_scenario_for_another_machine_is_refused(desk: Desk) -> None:
    heavier = f'{TRIAL}parameters: {{tool.mass: 0.2}}\n'
    assert desk.play(heavier) == (
        'Refused: The scenario trial is for a lathe that was started with tool.mass 0.2; '
        'this one has 0.05.'
    )
    assert desk.cell.board.get('scenario') is None


def test_a_knock_is_said_to_be_sent_and_refused_where_nothing_can_be_hit(
    start: Start, desk: Desk
) -> None:
    knock = {'do': 'knock', 'impulse': 0.002}
    assert desk.act(**knock) == 'Refused: /lathe is not there.'
    start(LatheNode)
    desk.knows_the_lathe()
    assert desk.act(**knock) == 'A knock of 2 mN s was sent.'
    desk.act(do='knock', impulse=1e5)
    ended = 'Refused: The cut has ended: nothing was hit.'
    desk.until(lambda: desk.heard.values('/lathe', 'cut')['guard'] != 'not tripped', 'its end')
    assert desk.act(**knock) == ended
    # Whatever else is wrong with its pace, which then is what that says.
    desk.heard.statuses['/lathe']['pace']['message'] = 'flooded: requests take much of the time'
    assert desk.act(**knock) == ended
    assert desk.act(do='reset') == 'At time zero again, running.'
    desk.until(lambda: desk.heard.values('/lathe', 'cut')['guard'] == 'not tripped', 'a new cut')
    assert desk.act(**knock) == 'A knock of 2 mN s was sent.'
