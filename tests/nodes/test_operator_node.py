"""What the operator of a scenario says: of a real lathe, and of a supervisor that refuses."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger
from support.node_bench import LATCHED, Bench

from lathe_chatter.nodes.lathe_node import LatheNode
from lathe_chatter.nodes.operator_node import Operator
from lathe_chatter.scenario import Scenario, Step

DEEPER = Step({'depth_of_cut': 0.0006}, at=0.1, because='deeper')


def played(bench: Bench, *steps: Step) -> tuple[Operator, list[str]]:
    said: list[str] = []
    scenario = Scenario('trial', 'a trial', 60.0, steps=steps)
    operator = Operator(scenario, tell=said.append, context=bench.node.context)
    operator.playing = True
    bench.executor.add_node(operator)
    return operator, said


def test_what_it_asks_and_hears_is_told_with_its_time(
    start: Callable[..., Any], bench: Bench
) -> None:
    operator, said = played(bench, DEEPER)
    flags = bench.node.create_publisher(Bool, '/chatter_monitor/chatter', LATCHED)
    actions = bench.node.create_publisher(String, '/chatter_supervisor/action', LATCHED)
    lathe = start(LatheNode)
    bench.spin_until(lambda: operator.idle, 'the step')
    (step,) = said
    assert step.endswith(' s  depth_of_cut = 0.0006  (deeper)')
    assert 0.1 <= float(step.split()[0]) <= round(lathe._lathe.time, 2)  # as it is told
    assert operator.failure is None
    flags.publish(Bool(data=True))
    bench.spin_until(lambda: said[1:], 'the flag')
    assert said[1].endswith(' s  chatter flagged')
    actions.publish(String(data='I would set ...'))
    bench.spin_until(lambda: said[2:], 'the supervisor')
    assert said[2].endswith(' s  supervisor: I would set ...')


def test_who_refuses_a_step_is_named_with_the_reason(
    start: Callable[..., Any], bench: Bench
) -> None:
    operator, _ = played(bench, Step({'depth_of_cut': 5.0}, at=0.1))
    start(LatheNode)
    bench.spin_until(lambda: operator.failure, 'the refusal')
    assert str(operator.failure) == (
        'The lathe refused depth_of_cut = 5.0: '
        'depth_of_cut is 5.0 m: it must be a finite number from 0 to 0.1 m.'
    )


def test_a_supervisor_that_refuses_is_quoted(start: Callable[..., Any], bench: Bench) -> None:
    def refuse(_request: Any, response: Any) -> Any:
        response.message = 'Nothing is waiting to be accepted.'
        return response

    bench.node.create_service(Trigger, '/chatter_supervisor/accept', refuse)
    operator, said = played(bench, Step({}, at=0.1, accept=True))
    bench.spin_until(operator._accept.service_is_ready, 'the supervisor')
    start(LatheNode)
    bench.spin_until(lambda: operator.failure, 'the refusal')
    assert str(operator.failure) == 'The supervisor refused: Nothing is waiting to be accepted.'
    assert said[0].endswith(' s  the offer of the supervisor is accepted')
