"""Parameters of a command line reach the node that is meant, in whatever namespace, or nobody."""

from __future__ import annotations

from typing import Any

import pytest
from rcl_interfaces.srv import GetParameters
from rclpy.parameter import parameter_value_to_python
from support.node_bench import Bench
from support.node_processes import NODES, NodeProcesses, Reports

from lathe_chatter.model.machine_file import load_machine


def value_of(bench: Bench, node: str, name: str) -> Any:
    request = GetParameters.Request(names=[name])
    (value,) = bench.call(GetParameters, f'{node}/get_parameters', request).values
    return parameter_value_to_python(value)


def test_parameters_reach_the_members_of_a_cell_in_a_namespace_and_under_another_name(
    bench: Bench, nodes: NodeProcesses
) -> None:
    reports = Reports(bench)
    run = nodes.folder / 'run'
    words = ['-r', '__ns:=/cell1', '-r', 'lathe:__node:=turning']
    for rule in (
        'lathe:depth_of_cut:=0.0003',
        'turning:seed:=7',
        '/cell1/turning:runout:=1e-6',
        'chatter_monitor:machine:=boring_bar',
        f'output:={run}',  # of the recorder alone
        'spindle_speed_rpm:=2900',  # of lathe and monitor
    ):
        words += ['-p', rule]
    nodes.start_program('/cell', [*NODES, 'cell', '--ros-args', *words])
    for node, name, value in (
        ('turning', 'depth_of_cut', 0.0003),
        ('turning', 'seed', 7),
        ('turning', 'runout', 1e-6),
        ('turning', 'spindle_speed_rpm', 2900.0),
        ('chatter_monitor', 'spindle_speed_rpm', 2900.0),
        ('run_recorder', 'output', str(run)),
    ):
        assert value_of(bench, f'/cell1/{node}', name) == value, name
    machine = load_machine(value_of(bench, '/cell1/chatter_monitor', 'machine')).machine
    assert machine == load_machine('boring_bar').machine
    bench.spin_until(lambda: reports.statuses('/cell1/run_recorder: recording'), 'a report')
    assert run.is_dir()
    nodes.interrupt('/cell')
    assert 'There is no parameter' not in nodes.said()


def test_a_parameter_reaches_a_node_of_its_own_in_a_namespace(
    bench: Bench, nodes: NodeProcesses
) -> None:
    nodes.start('lathe', 'lathe:depth_of_cut:=0.0003', namespace='/cell1')
    assert value_of(bench, '/cell1/lathe', 'depth_of_cut') == 0.0003


@pytest.mark.parametrize('node', ['cell', 'lathe'])
def test_a_parameter_that_reaches_nobody_keeps_from_starting(
    node: str, nodes: NodeProcesses
) -> None:
    process = nodes.start(node, 'laethe:depth_of_cut:=0.0003', namespace='/cell1')
    assert process.wait(120) == 2
    assert '-p laethe:depth_of_cut:=0.0003 reaches nobody: /cell1/lathe' in nodes.said()


def test_a_file_that_reaches_nobody_is_told_and_one_that_reaches_is_not(
    bench: Bench, nodes: NodeProcesses
) -> None:
    depth = '{ros__parameters: {depth_of_cut: 0.0003}}'
    files = {
        'root': f'lathe: {depth}',
        'wild': f'/**/lathe: {depth}',
        'nested': f'nested: {{lathe: {depth}}}',
        'all': '/**: {ros__parameters: {depth_of_cut: 0.0003}}',
    }
    for name, text in files.items():
        file = nodes.folder / f'{name}.yaml'
        file.write_text(text)
        words = ['--params-file', str(file), '-r', f'__ns:=/{name}']
        nodes.start_program(f'/{name}', [*NODES, 'lathe', '--ros-args', *words])
    for name in files:
        depth_of_cut = value_of(bench, f'/{name}/lathe', 'depth_of_cut')
        assert depth_of_cut == (0.0005 if name == 'root' else 0.0003), name
    assert nodes.said().count('for nobody here') == 1
    file = nodes.folder / 'root.yaml'
    told = f'The file {file} has parameters for /lathe and for nobody here: /root/lathe is.'
    assert told in nodes.said()
