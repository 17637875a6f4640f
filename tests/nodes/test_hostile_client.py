"""A client that floods a lathe with requests, or asks what nobody can do: the cut goes on."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    GetParameterTypes,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from rclpy.qos import HistoryPolicy, QoSProfile
from std_msgs.msg import Float64
from std_srvs.srv import SetBool, Trigger
from support.node_bench import Bench, messages_of
from support.node_processes import NodeProcesses, Reports, Samples, contiguous

from lathe_chatter.lathe.change_and_knock_sentences import parse_change
from lathe_chatter.nodes.monitor_sentences import TOOL_FREQUENCY

FLOOD = 10_000
UNKNOWN_TYPE = 200
SERVICE = '/lathe/set_parameters'


def test_ten_thousand_sets_at_once_leave_it_cutting(bench: Bench, nodes: NodeProcesses) -> None:
    reports, samples = Reports(bench), Samples(bench)
    nodes.start('lathe')
    # Nothing of the flood is to be lost on the way out; what the lathe keeps of it is its choice.
    qos = QoSProfile(depth=1, history=HistoryPolicy.KEEP_ALL)
    client = bench.node.create_client(SetParameters, SERVICE, qos_profile=qos)
    bench.spin_until(client.service_is_ready, 'the service')
    bench.spin_until(lambda: len(samples) > 10, 'samples')
    depths = np.linspace(0.0001, 0.0009, FLOOD).tolist()
    futures = [client.call_async(set_of(depth)) for depth in depths]
    bench.spin_until(lambda: depth_of(bench) == depths[-1], 'the last value')

    after = len(samples)
    bench.spin_until(lambda: len(samples) > after + 100, 'samples after the flood')
    (times,) = samples.runs()
    assert contiguous(times)
    answers = [f.result().results[0] for f in futures if f.done()]
    assert answers
    assert all(answer.successful for answer in answers)
    # The log grows with the ticks and not with the requests.
    told = [c for c in map(parse_change, reports.sentences('lathe')) if c is not None]
    assert len({change.time for change in told}) == len(told)
    since = reports.count()
    bench.spin_until(lambda: reports.value('/lathe: pace', 'ticks', since), 'a report')
    given_up = float(reports.value('/lathe: pace', 'lag given up, s'))
    assert given_up < 9.0 * samples.ends[-1]


def test_requests_that_nobody_can_fulfil_are_refused_with_a_reason(
    bench: Bench, nodes: NodeProcesses
) -> None:
    samples = Samples(bench)
    lathe = nodes.start('lathe')
    known = messages_of({'depth_of_cut': 0.001})
    (typed,) = messages_of({'depth_of_cut': 0.001})
    typed.value.type = UNKNOWN_TYPE
    hostile: list[Any] = [typed, *messages_of({'no such name': 1, '': 2.0, 'depth_of_cut': [1.0]})]
    hostile += messages_of({'x' * 100_000: True, 'seed': 2**62, 'real_time_factor': -1})
    for parameter in hostile:
        request = SetParameters.Request(parameters=[parameter])
        (result,) = bench.call(SetParameters, SERVICE, request).results
        together = SetParametersAtomically.Request(parameters=[*known, parameter])
        atomic = bench.call(SetParametersAtomically, f'{SERVICE}_atomically', together).result
        for answer in (result, atomic):
            assert not answer.successful
            assert answer.reason
    assert depth_of(bench) == 0.0005
    after = len(samples)
    bench.spin_until(lambda: len(samples) > after + 10, 'samples after all that')
    (times,) = samples.runs()
    assert contiguous(times)
    assert lathe.poll() is None


def test_a_request_of_absurd_size_is_refused_at_once(bench: Bench, nodes: NodeProcesses) -> None:
    """The lathe would stand for seconds, and everybody else wait."""
    samples = Samples(bench)
    nodes.start('lathe')
    many = messages_of({'depth_of_cut': 0.001}) * 20_000
    results = bench.call(SetParameters, SERVICE, SetParameters.Request(parameters=many)).results
    reason = 'At most 200 parameters fit in one request, and these are 20000.'
    assert len(results) == len(many)
    assert {(each.successful, each.reason) for each in results} == {(False, reason)}
    request = SetParametersAtomically.Request(parameters=many)
    result = bench.call(SetParametersAtomically, f'{SERVICE}_atomically', request).result
    assert (result.successful, result.reason) == (False, reason)
    names = ['depth_of_cut'] * 100_000
    for kind, service, field in (
        (GetParameters, 'get_parameters', 'values'),
        (GetParameterTypes, 'get_parameter_types', 'types'),
        (DescribeParameters, 'describe_parameters', 'descriptors'),
    ):
        answer = bench.call(kind, f'/lathe/{service}', kind.Request(names=names))
        assert not getattr(answer, field)
    listed = ListParameters.Request(prefixes=names)
    assert not bench.call(ListParameters, '/lathe/list_parameters', listed).result.names
    assert depth_of(bench) == 0.0005
    (times,) = samples.runs()
    assert contiguous(times)


def test_floods_of_all_kinds_leave_a_log_that_can_be_read(
    bench: Bench, nodes: NodeProcesses
) -> None:
    reports = Reports(bench)
    nodes.start('lathe')
    knocks = bench.talk(Float64, '/lathe/knock')
    bench.call(SetBool, '/lathe/pause', SetBool.Request(data=True))
    for k in range(300):
        knocks.publish(Float64(data=1e-6))
        bench.set('/lathe', real_time_factor=1.0 + k % 2, depth_of_cut=1e-4 * (1 + k % 2))
        bench.trigger('/lathe/reset')
    bench.call(SetBool, '/lathe/pause', SetBool.Request(data=False))
    bench.call(Trigger, '/lathe/reset', Trigger.Request())
    bench.set('/lathe', depth_of_cut=3e-4)
    bench.spin_until(
        lambda: any(' of this kind in' in said for said in reports.sentences('lathe')), 'a count'
    )
    said = reports.sentences('lathe')
    assert len([each for each in said if 'from here on simulated time' in each]) <= 7
    assert len([each for each in said if each.startswith('At time zero again')]) <= 7
    assert len([each for each in said if 'knock of' in each]) <= 1


def test_what_others_say_in_the_name_of_a_node_ends_nobody(
    bench: Bench, nodes: NodeProcesses
) -> None:
    samples = Samples(bench)
    listeners = [
        nodes.start('chatter_monitor'),
        nodes.start('chatter_supervisor', 'mode:=act'),
        nodes.start('run_recorder', f'output:={nodes.folder / "run"}'),
    ]
    reports = Reports(bench)
    nodes.start('lathe')
    known = '/chatter_supervisor: action'
    bench.spin_until(
        lambda: any(status.message == 'ready' for status in reports.statuses(known)), 'readiness'
    )
    events = bench.talk(ParameterEvent, '/parameter_events')
    told = bench.talk(DiagnosticArray, '/diagnostics')
    keys = ['samples lost', 'restarts of the lathe', 'C w, N/m', TOOL_FREQUENCY, 'works with']
    parts = ['chatter_monitor: samples', 'chatter_monitor: cut', 'lathe: pace']
    names = ['depth_of_cut', 'spindle_acceleration', 'tick_rate', 'real_time_factor', 'machine']
    for wrong in ('x', math.nan, None, [1.0], 0.0, -1e300):
        event = ParameterEvent(node='/lathe')
        event.changed_parameters = messages_of(dict.fromkeys(names, wrong))
        events.publish(event)
        values = [KeyValue(key=key, value=str(wrong)) for key in [*keys, 'real-time factor']]
        statuses = [DiagnosticStatus(name=f'/{part}', values=values) for part in parts]
        told.publish(DiagnosticArray(status=statuses))
        since = reports.count()
        for name in ('/chatter_monitor: samples', known, '/run_recorder: recording'):
            bench.spin_until(
                lambda name=name, since=since: any(
                    status.hardware_id  # which what others say here lacks
                    for status in reports.statuses(name, since)
                ),
                f'{name} after {wrong}',
            )
    assert [process.poll() for process in listeners] == [None] * len(listeners)
    assert len(samples) > 10


def set_of(depth: float) -> SetParameters.Request:
    return SetParameters.Request(parameters=messages_of({'depth_of_cut': depth}))


def depth_of(bench: Bench) -> float:
    request = GetParameters.Request(names=['depth_of_cut'])
    (value,) = bench.call(GetParameters, '/lathe/get_parameters', request).values
    return float(value.double_value)
