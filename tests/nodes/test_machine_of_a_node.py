"""Nodes with a machine file, also one of several modes, for which single values do not exist."""

from __future__ import annotations

import pytest
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.parameter import parameter_value_to_python
from std_msgs.msg import Bool, Float64, String
from support.node_bench import LATCHED, Bench
from support.node_processes import NodeProcesses, Reports, Samples

from lathe_chatter.model.lathe_parameter_table import LATHE
from lathe_chatter.model.machine_file import load_machine, shipped_machines
from lathe_chatter.recording import read_run, resimulate, verify
from lathe_chatter.recording.provenance import PARAMETERS


@pytest.mark.parametrize('machine', sorted(shipped_machines()))
def test_a_cell_has_the_machine_of_a_file(
    machine: str, bench: Bench, nodes: NodeProcesses
) -> None:
    samples = Samples(bench)
    run = nodes.folder / 'run'
    nodes.start('run_recorder', f'output:={run}')
    nodes.start('lathe', f'machine:={machine}')
    nodes.start('chatter_monitor', 'model:=lathe')
    bench.spin_until(lambda: len(samples) > 1_000, 'samples')
    listed = bench.call(ListParameters, '/lathe/list_parameters', ListParameters.Request())
    single = len(load_machine(machine).machine.tool.modes) == 1
    assert ('tool.mass' in listed.result.names) is single
    asked = GetParameters.Request(names=['depth_of_cut', 'machine'])
    answer = bench.call(GetParameters, '/lathe/get_parameters', asked)
    assert answer.values[0].double_value == load_machine(machine).cut.depth_of_cut
    bench.spin_until(lambda: 'Listening from' in nodes.said(), 'the monitor')
    # It asks the lathe beside what it records; a run opens while it is being recorded.
    noted = lambda: {note.name for note in read_run(run).notes()}  # noqa: E731
    bench.spin_until(lambda: f'{PARAMETERS}/lathe' in noted(), 'the parameters in the record')
    nodes.interrupt('/lathe')
    nodes.interrupt('/run_recorder')
    assert not [finding.text for finding in verify(run).findings if finding.loss]
    (computed,) = resimulate(read_run(run))
    assert computed.proven, computed.obstacle
    assert 'Traceback' not in nodes.said()


SPINDLE = """
tool: {modes: [{frequency: 450 Hz, damping_ratio: 2.5 %, mass: 1.2 kg}]}
workpiece: {modes: [{frequency: 180 Hz, damping_ratio: 4 %, mass: 8 kg}]}
material: {cutting_coefficient: 1200 MPa}
spindle: {slowest_speed: 300 rpm, fastest_speed: 4000 rpm}
cut: {spindle_speed: 1500 rpm, depth_of_cut: 0.8 mm, feed: 0.15 mm/rev}
"""
"""A detector without the range of the spindle recommends 8752 rev/min."""


def test_nobody_recommends_or_goes_to_a_speed_that_the_spindle_has_not(
    bench: Bench, nodes: NodeProcesses
) -> None:
    file = nodes.folder / 'spindle.yaml'
    file.write_text(SPINDLE)
    reports = Reports(bench)
    flags = bench.listen_first(Bool, '/chatter_monitor/chatter', LATCHED)
    speeds = bench.listen_first(Float64, '/chatter_monitor/recommended_speed_rpm')
    said = bench.listen_first(String, '/chatter_supervisor/action', LATCHED)
    nodes.start('chatter_monitor')
    nodes.start('chatter_supervisor', 'fastest_speed:=12000.0')
    nodes.start('lathe', f'machine:={file}', 'depth_of_cut:=0.1 mm', 'await_readers:=1')
    told = 'with speeds from 300 to 4000 rev/min'
    bench.spin_until(lambda: any(told in s for s in reports.sentences('chatter_monitor')), told)
    ready = lambda: [s.message for s in reports.statuses('/chatter_supervisor: action')][-1:]  # noqa: E731
    bench.spin_until(lambda: ready() == ['ready'], 'the supervisor')
    assert bench.set_together('/lathe', depth_of_cut=0.0008).successful
    bench.spin_until(lambda: flags[-1].data and speeds, 'chatter and advice')
    would = lambda: [m.data for m in said if 'I would set' in m.data]  # noqa: E731
    bench.spin_until(would, 'what the supervisor would do')
    assert all(300.0 <= speed.data <= 4000.0 for speed in speeds)
    for sentence in would():
        if 'spindle_speed_rpm' in sentence:
            assert float(sentence.split(' to ')[1].split()[0].rstrip(',')) <= 4000.0
    doubt = 'The spindle turns outside of what the machine file says it can, 300 to 4000 rev/min.'
    for speed in (4460.0, 4470.0, 3000.0, 4460.0):
        assert bench.set_together('/lathe', spindle_speed_rpm=speed).successful
    bench.spin_until(lambda: reports.sentences('lathe').count(doubt) >= 2, doubt)
    assert reports.sentences('lathe').count(doubt) == 2


def test_no_speed_is_recommended_before_the_lathe_has_told_its_machine(
    bench: Bench, nodes: NodeProcesses
) -> None:
    """A cut that chatters from the start is flagged before a lathe can answer."""
    file = nodes.folder / 'spindle.yaml'
    file.write_text(SPINDLE)
    reports = Reports(bench)
    flags = bench.listen_first(Bool, '/chatter_monitor/chatter', LATCHED)
    speeds = bench.listen_first(Float64, '/chatter_monitor/recommended_speed_rpm')
    nodes.start('chatter_monitor')
    nodes.start('lathe', f'machine:={file}', 'force_noise:=0.5', 'await_readers:=1')
    bench.spin_until(lambda: flags and flags[-1].data and speeds, 'chatter and advice')
    assert all(300.0 <= speed.data <= 4000.0 for speed in speeds)
    said = reports.sentences('chatter_monitor')
    told = next(number for number, each in enumerate(said) if 'has told what machine' in each)
    assert not [each for each in said[:told] if 'rule of thumb' in each]
    assert [each for each in said[told:] if 'rev/min' in each]


def test_a_feed_speed_that_does_not_rule_is_refused_and_a_dump_is_taken(
    bench: Bench, nodes: NodeProcesses
) -> None:
    file = nodes.folder / 'spindle.yaml'
    file.write_text(SPINDLE)
    nodes.start('lathe', f'machine:={file}')
    for result in (
        *bench.set('/lathe', feed_speed=0.001),
        bench.set_together('/lathe', feed_speed=0.001),
        bench.set_together('/lathe', feed_speed='1 mm/s', depth_of_cut=1e-4),
    ):
        assert not result.successful
        assert result.reason.startswith(
            'feed_speed is 0.001 m/s, and feed_per_revolution, 0.00015'
        )
    # As `ros2 param load` sends a dump: in one request, by name.
    listed = bench.call(ListParameters, '/lathe/list_parameters', ListParameters.Request())
    names = [name for name in sorted(listed.result.names) if '.' not in name]
    answer = bench.call(GetParameters, '/lathe/get_parameters', GetParameters.Request(names=names))
    run_time = {row.name for row in LATHE if row.run_time}
    dump = dict(zip(names, map(parameter_value_to_python, answer.values), strict=True))
    dump = {n: v for n, v in dump.items() if n in run_time} | {'feed_speed': 0.002}
    assert all(result.successful for result in bench.set('/lathe', **dump))
    assert bench.set_together('/lathe', feed_speed=0.001, feed_per_revolution=0.0).successful
    assert bench.set_together('/lathe', feed_speed=0.002).successful
