"""The node `chatter_supervisor` beside a real lathe and a real monitor: processes, over DDS."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import Log
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.task import Future
from std_msgs.msg import Bool, String
from std_srvs.srv import SetBool
from support.node_bench import LATCHED, Bench
from support.node_processes import NodeProcesses

from lathe_chatter.errors import ParameterError
from lathe_chatter.lathe.change_and_knock_sentences import parse_change
from lathe_chatter.nodes.supervisor_node import SupervisorNode

DEEP = 0.001
"""m: unstable at 3000 rev/min, stable at others."""
SUPERVISOR, LATHE = '/chatter_supervisor', '/lathe'


class Cell:
    """Lathe, monitor and supervisor, and what is heard of them."""

    def __init__(self, nodes: NodeProcesses, bench: Bench, *parameters: str) -> None:
        self.nodes, self.bench = nodes, bench
        nodes.start('chatter_monitor')
        nodes.start('chatter_supervisor', 'hands_off:=0.5', *parameters)
        self.flags: list[Bool] = bench.listen(Bool, '/chatter_monitor/chatter', LATCHED)
        self.said: list[String] = bench.listen(String, f'{SUPERVISOR}/action', LATCHED)
        self.reports: list[DiagnosticArray] = bench.listen_first(DiagnosticArray, '/diagnostics')
        nodes.start('lathe', 'depth_of_cut:=0.0003', 'bearing_contact:=none', 'await_readers:=1')
        bench.spin_until(lambda: self.status() == 'ready', 'a supervisor that knows the machine')

    def status(self) -> str:
        """The newest of the supervisor."""
        found = [
            s.message for m in self.reports for s in m.status if s.name.startswith(SUPERVISOR)
        ]
        return found[-1] if found else ''

    def get(self, name: str) -> Any:
        """A parameter of the lathe."""
        request = GetParameters.Request(names=[name])
        answer = self.bench.call(GetParameters, f'{LATHE}/get_parameters', request)
        return parameter_value_to_python(answer.values[0])

    def heard(self, words: str) -> list[str]:
        """The sentences that contain some words."""
        return [message.data for message in self.said if words in message.data]

    def deepen(self) -> None:
        """As a person would, and chatter comes."""
        assert self.bench.set_together(LATHE, depth_of_cut=DEEP).successful
        self.bench.spin_until(lambda: self.flags[-1].data, 'chatter')

    def await_reports(self, count: int) -> None:
        """Until so many more have come."""
        count += len(self.reports)
        self.bench.spin_until(lambda: len(self.reports) >= count, 'reports')

    def await_words(self, words: str) -> None:
        """Until the supervisor has said them."""
        self.bench.spin_until(lambda: self.heard(words), f'"{words}"')


def changes_in(log: list[Log]) -> list[Any]:
    """The changes of the cut that a lathe has logged."""
    found = (parse_change(message.msg) for message in log if message.name == 'lathe')
    return [each for each in found if each is not None]


@pytest.fixture
def cell(nodes: NodeProcesses, bench: Bench) -> Callable[..., Cell]:
    return lambda *parameters: Cell(nodes, bench, *parameters)


def test_chatter_is_cured_and_every_decision_is_said(cell: Callable[..., Cell]) -> None:
    there = cell('mode:=act')
    there.deepen()
    there.await_words('The chatter has ended')
    assert not there.flags[-1].data
    assert there.get('spindle_speed_rpm') != 3000.0
    (sentence,) = there.heard('I set')
    assert all(words in sentence for words in ('growing at', 'predicted: growth -', 'margin'))


@pytest.mark.parametrize('factor', [1.0, 0.3])
def test_no_step_of_a_move_is_beyond_the_ramp(cell: Callable[..., Cell], factor: float) -> None:
    there = cell('mode:=act', 'ramp:=2000.0')
    log = there.bench.listen(Log, '/rosout')
    there.bench.set_together(LATHE, real_time_factor=factor)
    there.deepen()
    there.await_words('The chatter has ended')
    steps = changes_in(log)
    assert len(steps) > 3
    for before, step in pairwise(steps):
        old, new = (each.get('spindle_speed_rpm', 0.0) for each in (step.old, step.new))
        # A lathe that wakes late by so much makes the tick of before with the speed of now.
        assert abs(new - old) <= 2000.0 * (step.time - before.time + 0.01)


def test_in_ask_it_waits_until_it_is_accepted(cell: Callable[..., Cell]) -> None:
    there = cell('mode:=ask')
    assert not there.bench.trigger(f'{SUPERVISOR}/accept').success
    there.deepen()
    there.await_words('~/accept does it')
    assert there.get('spindle_speed_rpm') == 3000.0
    answer = there.bench.trigger(f'{SUPERVISOR}/accept')
    assert answer.success, answer.message
    there.await_words('The chatter has ended')
    assert there.get('spindle_speed_rpm') != 3000.0


def test_in_shadow_it_does_nothing(cell: Callable[..., Cell]) -> None:
    there = cell()
    there.deepen()
    there.await_words('I would set')
    assert not there.bench.trigger(f'{SUPERVISOR}/accept').success
    assert (there.get('spindle_speed_rpm'), there.get('depth_of_cut')) == (3000.0, DEEP)


def test_while_a_hand_is_at_the_machine_nothing_is_done(cell: Callable[..., Cell]) -> None:
    there = cell('mode:=act', 'hands_off:=60.0')
    there.deepen()
    there.await_words('nothing is done, for somebody else has just changed something')
    assert (there.get('spindle_speed_rpm'), there.get('depth_of_cut')) == (3000.0, DEEP)


def test_of_two_supervisors_none_acts(cell: Callable[..., Cell]) -> None:
    there = cell('mode:=act')
    there.nodes.start('chatter_supervisor', 'mode:=act', 'hands_off:=0.5')
    there.bench.spin_until(
        lambda: there.bench.node.count_publishers(f'{SUPERVISOR}/action') == 2, 'the other one'
    )
    there.bench.spin_until(lambda: 'another supervisor' in there.status(), 'that they see it')
    there.deepen()
    there.await_words('nothing is done, for there is another supervisor')
    assert there.get('spindle_speed_rpm') == 3000.0


def test_a_killed_supervisor_leaves_the_lathe_as_it_is(cell: Callable[..., Cell]) -> None:
    there = cell('mode:=ask')
    there.deepen()
    there.await_words('~/accept does it')
    there.nodes.kill('/chatter_supervisor')
    there.flags.clear()
    assert (there.get('spindle_speed_rpm'), there.get('depth_of_cut')) == (3000.0, DEEP)
    assert there.bench.set_together(LATHE, depth_of_cut=1e-4).successful
    there.bench.spin_until(lambda: there.flags and not there.flags[-1].data, 'a lathe that cuts')


def test_a_silent_monitor_keeps_it_from_acting(cell: Callable[..., Cell]) -> None:
    there = cell('mode:=act', 'hands_off:=60.0')
    there.deepen()
    there.await_words('somebody else has just changed something')
    there.nodes.kill('/chatter_monitor')
    there.await_words('nothing is done, for nothing comes from the monitor')
    assert there.get('spindle_speed_rpm') == 3000.0


def test_a_supervisor_that_stood_still_blames_nobody(cell: Callable[..., Cell]) -> None:
    there = cell('mode:=shadow')
    there.deepen()
    there.await_words('but only watch')
    there.reports.clear()
    for seconds in range(2, 7):  # the lathe and the monitor report once a second
        there.nodes.signal(SUPERVISOR, signal.SIGSTOP)
        there.await_reports(3 * seconds)
        there.nodes.signal(SUPERVISOR, signal.SIGCONT)
        there.await_reports(5)
    blaming = 'nothing can be done: nothing comes from the monitor'
    assert blaming not in {s.message for report in there.reports for s in report.status}
    assert not there.heard('nothing comes from the monitor')
    there.nodes.kill('/chatter_monitor')
    there.await_words('nothing is done, for nothing comes from the monitor')


def test_a_cell_that_begins_anew_ends_no_chatter(cell: Callable[..., Cell]) -> None:
    """Lathe and monitor both: nobody counts a restart, and the cut is another."""
    there = cell('mode:=shadow')
    there.deepen()
    there.await_words('but only watch')
    there.nodes.kill('/chatter_monitor')
    there.nodes.kill(LATHE)
    there.await_words('nothing is done, for nothing comes from the monitor')
    there.nodes.start('chatter_monitor')
    there.nodes.start('lathe', 'depth_of_cut:=0.0003', 'bearing_contact:=none')
    there.bench.spin_until(lambda: there.status() == 'ready', 'a monitor that judges')
    there.await_reports(20)
    assert not there.heard('has ended')


def test_a_monitor_that_begins_anew_ends_no_chatter(cell: Callable[..., Cell]) -> None:
    there = cell('mode:=shadow')
    there.deepen()
    there.await_words('but only watch')
    there.nodes.kill('/chatter_monitor')
    there.await_words('nothing is done, for nothing comes from the monitor')
    there.flags.clear()
    there.nodes.start('chatter_monitor')
    # Its first flag is down; who finds it late hears only the newest.
    there.bench.spin_until(lambda: there.flags and there.flags[-1].data, 'its flag')
    assert not there.heard('has ended')


@pytest.mark.parametrize(
    ('override', 'words'),
    [
        ({'mode': 'guess'}, 'one of shadow, ask, act'),
        ({'slowest_speed': 5e3, 'fastest_speed': 4e3}, 'slowest'),
    ],
)
def test_a_wrong_parameter_is_refused_with_a_sentence(
    start: Callable[..., Any], override: dict[str, Any], words: str
) -> None:
    with pytest.raises(ParameterError, match=words):
        start(SupervisorNode, **override)


def test_limits_that_contradict_each_other_are_refused_at_run_time(
    start: Callable[..., Any], bench: Bench
) -> None:
    node = start(SupervisorNode)
    result = bench.set_together(SUPERVISOR, slowest_speed=13000.0)
    assert not result.successful
    assert 'fastest_speed' in result.reason
    assert node.values['slowest_speed'] == 1000.0


def test_limits_that_do_not_suit_the_machine_are_told_once(
    nodes: NodeProcesses, start: Callable[..., Any], bench: Bench
) -> None:
    node = start(SupervisorNode)
    log = bench.listen(Log, '/rosout')
    nodes.start('lathe', 'machine:=chucked_shaft', 'depth_of_cut:=0.00005')
    wanted = [
        'No move passes smallest_depth, 0.0001 m, though the lathe has 5e-05 m.',
        'No move passes slowest_speed, 1000 rev/min, though the lathe has 60 rev/min.',
    ]

    def warned() -> list[str]:
        ours = [m.msg for m in log if m.name == node.get_name() and m.msg.startswith('No move')]
        return sorted(ours, reverse=True)

    bench.spin_until(lambda: len(warned()) >= len(wanted), 'that it says so')
    assert bench.set_together(SUPERVISOR, hands_off=1.0).successful  # it begins anew
    assert warned() == sorted(wanted, reverse=True)


def test_what_it_says_of_itself_is_so(start: Callable[..., Any], bench: Bench) -> None:
    node = start(SupervisorNode)
    states = bench.node.create_publisher(String, '/chatter_monitor/state', LATCHED)
    reports = bench.talk(DiagnosticArray, '/diagnostics')

    def able() -> tuple[str, str]:
        (status,) = node._statuses()
        return status.message, str(status.values['newest sentence'])

    def await_reason(reason: str, state: str, lost: int) -> None:
        values = [KeyValue(key='samples lost', value=str(lost))]
        name = '/chatter_monitor: samples'

        def holds() -> bool:
            states.publish(String(data=state))
            reports.publish(DiagnosticArray(status=[DiagnosticStatus(name=name, values=values)]))
            bench.executor.spin_once(timeout_sec=0.05)
            return able()[0] == f'nothing can be done: {reason}'

        bench.spin_until(holds, reason)

    silent = 'nothing can be done: nothing comes from the monitor'
    node._began = time.monotonic()  # however long it took to load
    unknown = 'nothing can be done: it is not known yet who else is there'
    assert able() == (unknown, 'nothing was done yet')
    bench.spin_until(lambda: able() == (silent, 'nothing was done yet'), 'that all are known')
    answer = bench.trigger(f'{SUPERVISOR}/accept')
    assert (answer.success, answer.message) == (False, 'The lathe is not known yet.')
    assert bench.set_together(SUPERVISOR, hands_off=1.0).successful
    assert able() == (silent, 'From now on: hands_off = 1.0.')
    await_reason('the monitor does not know the state of the cut', 'unknown', 0)
    await_reason('the lathe cannot be reached', 'stable', 0)
    await_reason('samples were lost', 'stable', 5)
    service = bench.node.create_service(
        SetParametersAtomically,
        '/lathe/set_parameters_atomically',
        lambda _request, answer: answer,
    )
    await_reason('no machine is known, or the monitor works without it', 'stable', 5)
    bench.node.destroy_service(service)


def test_a_lathe_that_is_none_is_told(start: Callable[..., Any], bench: Bench) -> None:
    log = bench.listen_first(Log, '/rosout', LATCHED)
    lathe = bench.another('lathe')
    lathe.declare_parameter('machine', 'no such machine')
    start(SupervisorNode)
    said = '/lathe does not say what it is: '
    bench.spin_until(lambda: any(entry.msg.startswith(said) for entry in log), 'the sentence')


def test_another_lathe_is_not_taken_for_the_one_before(
    start: Callable[..., Any], bench: Bench
) -> None:
    """Neither a monitor nor the time of its cut tells that it is another."""
    log = bench.listen_first(Log, '/rosout', LATCHED)

    def of_another(speed: float) -> Node:
        lathe = bench.another('lathe')
        lathe.declare_parameter('spindle_speed_rpm', speed)
        said = f'fastest_speed, 5000 rev/min, though the lathe has {speed:g} rev/min.'
        bench.spin_until(lambda: any(said in entry.msg for entry in log), said)
        return lathe

    start(SupervisorNode, fastest_speed=5000.0)
    bench.let_go(of_another(7000.0))
    of_another(6000.0)


def test_a_lathe_that_does_not_answer_is_told(start: Callable[..., Any]) -> None:
    node = start(SupervisorNode)
    node._wait(Future())  # of a request that nobody has
    node._answer = node._answer[0], node._answer[1] - 10.0
    node._look()
    (status,) = node._statuses()
    said = 'Nothing more is done, for the lathe does not answer.'
    assert status.values['newest sentence'] == said


def test_a_lathe_that_refuses_is_told(start: Callable[..., Any]) -> None:
    node, answer = start(SupervisorNode), Future()
    node._wait(answer)
    answer.set_result(SetBool.Response(message='The guard has ended it.'))
    (status,) = node._statuses()
    said = 'Nothing more is done, for the lathe refused: The guard has ended it.'
    assert status.values['newest sentence'] == said
