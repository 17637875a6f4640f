"""The node `lathe` over real DDS, sample by sample the core that it drives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import Log
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.context import Context
from rclpy.parameter import Parameter
from rclpy.qos import ReliabilityPolicy, qos_profile_parameters
from rclpy.time import Time as Time_
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray
from support.node_bench import DEEP, LATCHED, Bench, messages_of, samples_of

from lathe_chatter.array_types import Array
from lathe_chatter.errors import ParameterError
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.lathe.change_and_knock_sentences import Change, parse_change
from lathe_chatter.model import BearingContact, Cut
from lathe_chatter.nodes.joint_state_message import joint_states
from lathe_chatter.nodes.lathe_diagnostics import FLOOD
from lathe_chatter.nodes.lathe_node import LatheNode
from lathe_chatter.nodes.simulation_control import RunState
from lathe_chatter.samples import SAMPLE_COLUMNS

TICK = 20
SCALARS = {
    '/lathe/tool/displacement': 'tool_displacement',
    '/lathe/tool/velocity': 'tool_velocity',
    '/lathe/workpiece/displacement': 'workpiece_displacement',
    '/lathe/workpiece/velocity': 'workpiece_velocity',
}


@pytest.fixture
def lathe(start: Callable[..., Any], bench: Bench) -> LatheNode:
    """A lathe at rest at time zero, so that a test decides about every tick."""
    node = start(LatheNode)
    at_rest(bench)
    return node


def at_rest(bench: Bench) -> None:
    assert bench.pause('/lathe').success
    assert bench.trigger('/lathe/reset').success


def blocks(messages: Sequence[Float64MultiArray], after: float = 0.0) -> Array:
    """All samples in messages, from the last start of simulated time on."""
    samples = np.concatenate([samples_of(m) for m in messages])
    restarts = np.flatnonzero(np.diff(samples[:, 0]) < 0)
    samples = samples[restarts[-1] + 1 :] if restarts.size else samples
    return samples[samples[:, 0] > after]


def taken(bench: Bench, messages: list[Any], steps: int) -> Array:
    """The samples of so many steps, once they have come."""
    expected = len(messages) + steps
    bench.steps('/lathe', steps)
    bench.spin_until(lambda: len(messages) >= expected, 'samples')
    return np.concatenate([samples_of(m) for m in messages[-steps:]])


def listen(bench: Bench) -> list[Any]:
    """The samples from now on, after one step that shows that they come."""
    messages = bench.listen(Float64MultiArray, '/lathe/samples')
    bench.spin_until(lambda: bench.node.count_subscribers('/lathe/samples'), 'the subscription')
    while not messages:
        bench.steps('/lathe', 1)
        bench.executor.spin_once(timeout_sec=0.05)
    bench.trigger('/lathe/reset')
    messages.clear()
    return messages


@pytest.mark.usefixtures('lathe')
def test_its_samples_are_the_cores_bit_for_bit(bench: Bench) -> None:
    samples = taken(bench, listen(bench), 50)
    assert samples.tobytes() == VirtualLathe().advance(50 * TICK).tobytes()


@pytest.mark.usefixtures('lathe')
def test_the_scalars_and_joints_are_the_state_at_the_end_of_the_tick(bench: Bench) -> None:
    scalars = {topic: bench.listen(Float64, topic) for topic in SCALARS}
    joints = bench.listen(JointState, '/lathe/joint_states')
    while not (joints and all(scalars.values())):
        bench.steps('/lathe', 1)
    last = dict(zip(SAMPLE_COLUMNS, taken(bench, listen(bench), 7)[-1].tolist(), strict=True))
    bench.spin_until(lambda: joints[-1].position[0] == last['tool_displacement'], 'the joints')
    for topic, column in SCALARS.items():
        bench.spin_until(
            lambda topic=topic, column=column: scalars[topic][-1].data == last[column], topic
        )
    assert joints[-1].position.tolist() == [
        last['tool_displacement'],
        last['workpiece_displacement'],
    ]
    assert joints[-1].effort.tolist() == [-last['cutting_force'], last['cutting_force']]


@pytest.mark.usefixtures('lathe')
def test_joint_states_are_published_only_while_somebody_listens(bench: Bench) -> None:
    bench.steps('/lathe', 5)
    numbers: list[int] = []

    def note(_message: JointState, info: dict[str, int]) -> None:
        numbers.append(info['publication_sequence_number'])

    bench.node.create_subscription(JointState, '/lathe/joint_states', note, DEEP)
    while not numbers:
        bench.steps('/lathe', 1)
    assert numbers[0] == 1


def test_a_late_reader_gets_the_first_sample(lathe: LatheNode, bench: Bench) -> None:
    bench.steps('/lathe', 5)
    kept = bench.listen(Float64MultiArray, '/lathe/samples', LATCHED)
    bench.spin_until(lambda: len(kept) >= 5 and len(blocks(kept)) >= 5 * TICK, 'all samples')
    assert blocks(kept)[0, 0] == 1.0 / 1e4
    assert lathe.count_publishers('/lathe/samples') == 1


def test_it_can_wait_for_its_readers(start: Callable[..., Any], bench: Bench) -> None:
    node = start(LatheNode, await_readers=2)
    volatile = DEEP  # to which nothing is sent that was kept
    first = bench.listen(Float64MultiArray, '/lathe/samples', volatile)
    status_of = bench.listen(DiagnosticArray, '/diagnostics')
    bench.spin_until(lambda: status(status_of, 'pace'), 'a report')
    assert not first
    assert node.samples_taken == 0
    second = bench.listen(Float64MultiArray, '/lathe/samples', volatile)
    bench.spin_until(lambda: first and second, 'samples')
    assert first[0] == second[0]
    assert first[0].data[0] == 1.0 / 1e4


@pytest.mark.parametrize('word', ['resume', 'stay paused'])
def test_a_pause_by_hand_ends_the_wait(start: Callable[..., Any], bench: Bench, word: str) -> None:
    node = start(LatheNode, await_readers=1)
    bench.pause('/lathe', pause=word != 'resume')
    if word == 'resume':
        bench.spin_until(lambda: node.samples_taken, 'a tick')
        return
    messages = bench.listen(Float64MultiArray, '/lathe/samples')
    bench.steps('/lathe', 1)
    bench.spin_until(lambda: messages, 'the step')
    assert node.run_state is RunState.PAUSED


@pytest.mark.parametrize('factor', [0.0, 0.5, 1.0, 3.0])
def test_running_it_leaves_no_gap(start: Callable[..., Any], bench: Bench, factor: float) -> None:
    start(LatheNode, real_time_factor=factor)
    messages = bench.listen(Float64MultiArray, '/lathe/samples', LATCHED)
    bench.spin_until(lambda: len(messages) >= 20, 'samples')
    bench.pause('/lathe')
    bench.steps('/lathe', 1)
    end = bench.trigger('/lathe/step').message
    bench.spin_until(lambda: end == f'Now at {messages[-1].data[-8]:.6f} s.', 'the last sample')
    times = blocks(messages)[:, 0]
    assert times.tolist() == [(k + 1) / 1e4 for k in range(times.size)]


@pytest.mark.usefixtures('lathe')
def test_a_parameter_takes_effect_between_two_samples(bench: Bench) -> None:
    messages = listen(bench)
    core = VirtualLathe()
    assert taken(bench, messages, 5).tobytes() == core.advance(5 * TICK).tobytes()
    log = bench.listen(Log, '/rosout', LATCHED)
    (result,) = bench.set('/lathe', depth_of_cut=0.00062)
    assert result.successful
    core.retune(Cut(depth_of_cut=0.00062))
    assert taken(bench, messages, 5).tobytes() == core.advance(5 * TICK).tobytes()
    bench.spin_until(lambda: [c for entry in log if (c := parse_change(entry.msg))], 'the record')
    (change,) = [c for entry in log if (c := parse_change(entry.msg))]
    assert change == Change(0.01, {'depth_of_cut': 0.0005}, {'depth_of_cut': 0.00062})


@pytest.mark.usefixtures('lathe')
def test_an_atomic_set_takes_effect_at_one_instant(bench: Bench) -> None:
    messages = listen(bench)
    core = VirtualLathe()
    core.advance(3 * TICK)
    taken(bench, messages, 3)
    result = bench.set_together(
        '/lathe', spindle_speed_rpm=6000, depth_of_cut=0.001, bearing_contact='seated'
    )
    assert result.successful, result.reason
    core.retune(Cut(6000.0, 0.001, bearing_contact=BearingContact.SEATED))
    assert taken(bench, messages, 5).tobytes() == core.advance(5 * TICK).tobytes()


@pytest.mark.usefixtures('lathe')
@pytest.mark.parametrize(
    ('values', 'reason'),
    [
        ({'depth_of_cut': 0.2}, 'depth_of_cut is 0.2 m: it must be a finite number from 0 to'),
        ({'depth_of_cut': float('nan')}, 'depth_of_cut is nan m: it must be'),
        ({'depth_of_cut': 'deep'}, "depth_of_cut is 'deep': it must be"),
        ({'bearing_contact': 'loose'}, "bearing_contact is 'loose': it must be one of none, gap"),
        ({'sample_rate': 2e4}, 'sample_rate can be given at the start only.'),
        ({'use_sim_time': True}, 'use_sim_time can be given at the start only.'),
        ({'depth': 0.001}, "There is no parameter 'depth'"),
    ],
    ids=lambda case: next(iter(case)) if isinstance(case, dict) else '',
)
def test_a_refused_set_has_a_reason_and_changes_nothing(
    bench: Bench, values: dict[str, Any], reason: str
) -> None:
    messages = listen(bench)
    (alone,) = bench.set('/lathe', **values)
    together = bench.set_together('/lathe', spindle_speed_rpm=6000.0, **values)
    for result in (alone, together):
        assert not result.successful
        assert result.reason.startswith(reason)
    assert taken(bench, messages, 3).tobytes() == VirtualLathe().advance(3 * TICK).tobytes()


def test_a_refused_set_is_in_the_log(start: Callable[..., Any], bench: Bench) -> None:
    log = bench.listen_first(Log, '/rosout', LATCHED)
    start(LatheNode)
    bench.set('/lathe', depth_of_cut=5.0)
    bench.set_together('/lathe', spindle_speed_rpm=6000.0, seed=2)
    bench.set('/lathe', depth_of_cut=0.001)
    bench.spin_until(lambda: any(parse_change(entry.msg) for entry in log), 'the last')
    assert [entry.msg for entry in log if entry.msg.startswith('Refused')] == [
        'Refused: depth_of_cut is 5.0 m: it must be a finite number from 0 to 0.1 m.',
        'Refused: seed can be given at the start only.',
    ]


@pytest.mark.usefixtures('lathe')
def test_a_value_of_an_unknown_type_is_refused_and_survived(bench: Bench) -> None:
    for name in ('depth_of_cut', 'no such name', ''):
        (hostile,) = messages_of({name: 0.001})
        hostile.value.type = 77
        request = SetParameters.Request(parameters=[hostile])
        (result,) = bench.call(SetParameters, '/lathe/set_parameters', request).results
        assert not result.successful
        assert result.reason
        request = SetParametersAtomically.Request(parameters=[hostile])
        service = '/lathe/set_parameters_atomically'
        assert not bench.call(SetParametersAtomically, service, request).result.successful
    bench.steps('/lathe', 1)


def test_a_flood_of_sets_leaves_it_cutting(start: Callable[..., Any], bench: Bench) -> None:
    start(LatheNode)
    messages = bench.listen(Float64MultiArray, '/lathe/samples', LATCHED)
    client = bench.node.create_client(
        SetParameters, '/lathe/set_parameters', qos_profile=qos_profile_parameters
    )
    bench.spin_until(client.service_is_ready, 'the service')
    depths = [0.0004 + 1e-7 * k for k in range(200)] + [float('nan'), 0.0005]
    floods = [
        client.call_async(SetParameters.Request(parameters=messages_of({'depth_of_cut': depth})))
        for depth in depths
    ]
    bench.spin_until(lambda: all(flood.done() for flood in floods), 'all answers')
    answers = [flood.result().results[0].successful for flood in floods]
    assert answers == [True] * 200 + [False, True]
    now = len(messages)
    bench.spin_until(lambda: len(messages) > now + 10, 'samples after the flood')
    times = blocks(messages)[:, 0]
    assert times.tolist() == [(k + 1) / 1e4 for k in range(times.size)]


@pytest.mark.usefixtures('lathe')
def test_a_reset_gives_the_same_run_again(bench: Bench) -> None:
    bench.set_together('/lathe', force_noise=1e-3, sensor_noise=1e-7, depth_of_cut=0.001)
    messages = listen(bench)
    first = taken(bench, messages, 20)
    assert bench.trigger('/lathe/reset').message == 'At time zero again, paused.'
    assert bench.trigger('/lathe/reset').success
    assert taken(bench, messages, 20).tobytes() == first.tobytes()


@pytest.mark.usefixtures('lathe')
def test_a_knock_is_the_cores(bench: Bench) -> None:
    messages = listen(bench)
    knock = bench.talk(Float64, '/lathe/knock')
    taken(bench, messages, 2)
    logged = bench.listen(Log, '/rosout', LATCHED)
    for impulse in (0.004, 0.006, float('nan')):
        knock.publish(Float64(data=impulse))
    # At rest they are kept for the next tick; the last is refused as it comes.
    bench.spin_until(lambda: any('impulse is nan' in log.msg for log in logged), 'a refusal')
    core = VirtualLathe()
    core.advance(2 * TICK)
    core.knock(0.01)
    assert taken(bench, messages, 5).tobytes() == core.advance(5 * TICK).tobytes()
    bench.spin_until(lambda: any('knock of 0.01 N s' in log.msg for log in logged), 'the knock')


def test_a_step_is_refused_while_it_runs(start: Callable[..., Any], bench: Bench) -> None:
    start(LatheNode)
    answer = bench.trigger('/lathe/step')
    assert not answer.success
    assert answer.message == 'A step is possible only while paused.'
    assert bench.pause('/lathe').message == 'Now paused.'
    assert bench.pause('/lathe').message == 'Already paused.'
    assert bench.trigger('/lathe/step').success
    assert bench.pause('/lathe', pause=False).message == 'Now running.'


def status(messages: Sequence[DiagnosticArray], part: str) -> DiagnosticStatus | None:
    """The latest status of a part."""
    found = [s for m in messages for s in m.status if s.name.endswith(f': {part}')]
    return found[-1] if found else None


def test_the_guard_ends_the_run_and_a_reset_begins_another(
    start: Callable[..., Any], bench: Bench
) -> None:
    diagnostics = bench.listen_first(DiagnosticArray, '/diagnostics')
    start(LatheNode, depth_of_cut=0.01, tool_leaves_cut=False, real_time_factor=0.0)
    messages = bench.listen(Float64MultiArray, '/lathe/samples', LATCHED)

    def tripped() -> bool:
        cut = status(diagnostics, 'cut')
        return cut is not None and cut.level == DiagnosticStatus.ERROR

    bench.spin_until(tripped, 'an error')
    assert 'displacement passed' in status(diagnostics, 'cut').message
    core = VirtualLathe(cut=Cut(depth_of_cut=0.01), tool_leaves_cut=False)
    expected = core.advance(10**6)
    assert core.guard
    bench.spin_until(
        lambda: messages and len(blocks(messages)) >= len(expected), 'the last sample'
    )
    assert blocks(messages).tobytes() == expected.tobytes()
    assert np.isfinite(blocks(messages)).all()
    assert bench.pause('/lathe').message.endswith('Only a reset helps.')
    assert bench.set_together('/lathe', depth_of_cut=0.0001).successful
    assert bench.trigger('/lathe/reset').success
    bench.spin_until(lambda: not tripped(), 'an end of the error')


def test_the_pace_can_change_from_free_to_timed_and_back(
    start: Callable[..., Any], bench: Bench
) -> None:
    start(LatheNode, real_time_factor=0.0)
    messages = bench.listen(Float64MultiArray, '/lathe/samples')
    log = bench.listen(Log, '/rosout', LATCHED)
    paces = ('1 times as fast as the clock', 'as fast as it can', '1.5 times as fast as the clock')
    for factor, pace in zip((1, 0, 1.5), paces, strict=True):
        assert bench.set('/lathe', real_time_factor=factor)[0].successful
        now = len(messages)
        bench.spin_until(lambda now=now: len(messages) > now + 5, 'more samples')
        end = f's: from here on simulated time is to go {pace}.'
        bench.spin_until(lambda end=end: any(entry.msg.endswith(end) for entry in log), pace)
    assert bench.set('/lathe', real_time_factor=0.0)[0].successful


def test_the_clock_follows_the_state(start: Callable[..., Any], bench: Bench) -> None:
    start(LatheNode, publish_clock=True)
    at_rest(bench)
    order: list[int] = []
    node = bench.node
    node.create_subscription(
        Float64MultiArray, '/lathe/samples', lambda m: order.append(len(m.data)), LATCHED
    )
    clocks = bench.listen(Clock, '/clock')
    messages = listen(bench)
    taken(bench, messages, 4)
    bench.spin_until(lambda: clocks and clocks[-1].clock == Time(nanosec=8_000_000), 'the clock')


def test_a_second_owner_of_the_clock_is_told(start: Callable[..., Any], bench: Bench) -> None:
    diagnostics = bench.listen_first(DiagnosticArray, '/diagnostics')
    start(LatheNode, publish_clock=True)
    bench.talk_alone(Clock, '/clock')

    def complaint() -> str:
        pace = status(diagnostics, 'pace')
        return pace.message if pace is not None and pace.level == DiagnosticStatus.WARN else ''

    bench.spin_until(lambda: complaint().startswith('2 nodes publish /clock'), 'a warning')


def test_a_name_that_is_like_no_parameter_is_only_warned_of(
    start: Callable[..., Any], bench: Bench
) -> None:
    log = bench.listen_first(Log, '/rosout', LATCHED)
    start(LatheNode, zzz=0.001)
    sentence = "There is no parameter 'zzz'."
    bench.spin_until(lambda: sentence in [entry.msg for entry in log], 'the sentence')


def test_its_qos_can_be_overridden(start: Callable[..., Any], bench: Bench) -> None:
    start(LatheNode, **{'qos_overrides./lathe/samples.publisher.reliability': 'best_effort'})
    bench.listen_first(Float64MultiArray, '/lathe/samples')

    def offered() -> list[ReliabilityPolicy]:
        found = bench.node.get_publishers_info_by_topic('/lathe/samples')
        return [info.qos_profile.reliability for info in found]

    bench.spin_until(offered, 'the publisher')
    assert offered() == [ReliabilityPolicy.BEST_EFFORT]


def test_two_cells_are_told_apart(start: Callable[..., Any], bench: Bench) -> None:
    diagnostics = bench.listen_first(DiagnosticArray, '/diagnostics')
    start(LatheNode, namespace='/cell1')
    start(LatheNode, namespace='/cell2', depth_of_cut=0.001)
    first = bench.listen(Float64MultiArray, '/cell1/lathe/samples', LATCHED)
    second = bench.listen(Float64MultiArray, '/cell2/lathe/samples', LATCHED)
    bench.spin_until(lambda: len(first) > 10 and len(second) > 10, 'samples of both')
    assert not np.array_equal(blocks(first)[:200], blocks(second)[:200])
    bench.spin_until(
        lambda: (
            {s.name for m in diagnostics for s in m.status}
            == {f'/cell{k}/lathe: {part}' for k in (1, 2) for part in ('pace', 'cut', 'samples')}
        ),
        'diagnostics of both',
    )


def test_joints_are_stamped_with_the_time_that_their_readers_have(
    start: Callable[..., Any], bench: Bench
) -> None:
    start(LatheNode, namespace='/clocked', publish_clock=True)
    start(LatheNode, namespace='/alone')
    clocked = bench.listen(JointState, '/clocked/lathe/joint_states')
    alone = bench.listen(JointState, '/alone/lathe/joint_states')
    bench.spin_until(lambda: clocked and alone, 'joints')
    now = bench.node.get_clock().now().nanoseconds
    assert clocked[-1].header.stamp.sec < 1000
    delay = now - Time_.from_msg(alone[-1].header.stamp).nanoseconds
    assert abs(delay) < 3600e9  # not the 56 years since 1970
    assert alone[-1].header.frame_id == 'lathe_bed'


def test_the_urdf_has_the_joints_and_the_frame_of_the_joint_states() -> None:
    robot = ET.parse(Path(__file__).parents[2] / 'config/urdf/lathe.urdf').getroot()
    message = joint_states(np.arange(8.0), 0)
    joints = {joint.attrib['name']: joint for joint in robot.iter('joint')}
    assert sorted(joints) == sorted(message.name)
    links = {link.attrib['name'] for link in robot.iter('link')}
    for joint in joints.values():
        assert joint.attrib['type'] == 'prismatic'
        assert joint.find('parent').attrib['link'] == message.header.frame_id
        assert joint.find('child').attrib['link'] in links
        assert joint.find('axis').attrib['xyz'] == '1 0 0'


def test_a_second_lathe_on_the_topic_is_named(start: Callable[..., Any], bench: Bench) -> None:
    diagnostics = bench.listen_first(DiagnosticArray, '/diagnostics')
    log: list[Any] = bench.listen_first(Log, '/rosout', LATCHED)
    start(LatheNode)
    bench.talk_alone(Float64MultiArray, '/lathe/samples')
    words = 'not the only lathe on the topic'
    bench.spin_until(
        lambda: (s := status(diagnostics, 'samples')) and s.message == words, 'the diagnostic'
    )

    def said() -> list[str]:
        return [entry.msg for entry in log if 'not the only one' in entry.msg]

    bench.spin_until(said, 'the sentence')
    assert said() == [(
        'I am not the only one that publishes /lathe/samples: '
        '/bench and /lathe do, and readers cannot tell them apart.'
    )]  # fmt: skip


def test_a_flood_of_requests_is_told(start: Callable[..., Any], bench: Bench) -> None:
    diagnostics = bench.listen_first(DiagnosticArray, '/diagnostics')
    start(LatheNode)
    set_parameters = bench.node.create_client(SetParameters, '/lathe/set_parameters')
    bench.spin_until(set_parameters.service_is_ready, 'the service')
    request = SetParameters.Request(parameters=messages_of({'depth_of_cut': 1e-4}) * 100)

    def flooded() -> bool:
        future = set_parameters.call_async(request)
        bench.spin_until(future.done, 'an answer')
        found = status(diagnostics, 'pace')
        return found is not None and found.message.startswith('flooded')

    bench.spin_until(flooded, 'the warning')
    found = status(diagnostics, 'pace')
    assert found.level == DiagnosticStatus.WARN
    (share,) = (v.value for v in found.values if v.key == 'time taken by requests, fraction')
    assert float(share) > FLOOD


def test_a_flood_of_knocks_is_bounded_and_told(start: Callable[..., Any], bench: Bench) -> None:
    log = bench.listen_first(Log, '/rosout', LATCHED)
    node = start(LatheNode)
    for _ in range(1002):  # all between two ticks, which only the executor makes
        node._on_knock(Float64(data=1e-6))

    def said(words: str) -> list[str]:
        return [entry.msg for entry in log if words in entry.msg]

    bench.spin_until(lambda: said('More than 1000 knocks between two ticks'), 'the warning')
    bench.spin_until(lambda: said('knock of 0.001 N s'), 'all that were kept as one knock')


def test_it_cannot_drive_the_clock_that_it_follows(context: Context) -> None:
    overrides = [Parameter(name, value=True) for name in ('use_sim_time', 'publish_clock')]
    with pytest.raises(ParameterError, match='for /clock has one owner'):
        LatheNode(context=context, parameter_overrides=overrides)


def test_a_parameter_cannot_be_deleted(start: Any, bench: Bench) -> None:
    """As `ros2 param delete` asks, with a value that is none."""
    start(LatheNode)
    for name in ('depth_of_cut', 'seed'):
        (answer,) = bench.set('/lathe', **{name: None})
        assert not answer.successful
        assert answer.reason == f'{name} cannot be without a value.'
