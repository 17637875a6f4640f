"""What `ros2 param dump` writes and `ros2 param set` sends is taken by every node."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.context import Context
from rclpy.parameter import parameter_value_to_python
from support.node_bench import Bench

from lathe_chatter.errors import ParameterError
from lathe_chatter.nodes.lathe_node import LatheNode
from lathe_chatter.nodes.monitor_node import MonitorNode
from lathe_chatter.nodes.recorder_node import RecorderNode
from lathe_chatter.nodes.supervisor_node import SupervisorNode

NODES = {
    'lathe': LatheNode,
    'chatter_monitor': MonitorNode,
    'run_recorder': RecorderNode,
    'chatter_supervisor': SupervisorNode,
}


def dump(bench: Bench, node: str) -> dict[str, Any]:
    """The parameters of a node as `ros2 param dump` asks for them."""
    listed = bench.call(ListParameters, f'{node}/list_parameters', ListParameters.Request())
    names = list(listed.result.names)
    request = GetParameters.Request(names=names)
    values = bench.call(GetParameters, f'{node}/get_parameters', request).values
    plain = map(parameter_value_to_python, values)
    return {n: list(v) if isinstance(v, list) else v for n, v in zip(names, plain, strict=True)}


@pytest.mark.parametrize('name', NODES)
def test_a_dump_fed_back_is_the_same_node(
    name: str, start: Callable[..., Any], bench: Bench, context: Context, tmp_path: Path
) -> None:
    kind = NODES[name]
    options = {'autostart': False} if kind is RecorderNode else {}
    node = start(kind, **options)
    dumped = dump(bench, f'/{name}')
    bench.executor.remove_node(node)
    before = dict(node.values)
    node.destroy_node()
    file = tmp_path / 'dump.yaml'
    file.write_text(yaml.dump({f'/{name}': {'ros__parameters': dumped}}))
    again = kind(context=context, cli_args=['--ros-args', '--params-file', str(file)])
    try:
        assert again.values == before
    finally:
        again.destroy_node()


@pytest.mark.parametrize('name', NODES)
def test_the_file_of_parameters_that_is_shipped_changes_nothing(
    name: str, start: Callable[..., Any], bench: Bench, context: Context
) -> None:
    kind = NODES[name]
    node = start(kind, **({'autostart': False} if kind is RecorderNode else {}))
    usual = {**node.values, **({'autostart': True} if kind is RecorderNode else {})}
    bench.executor.remove_node(node)
    node.destroy_node()
    file = Path(__file__).parents[2] / 'config' / 'parameters' / f'{name}.yaml'
    again = kind(context=context, cli_args=['--ros-args', '--params-file', str(file)])
    try:
        assert again.values == usual
    finally:
        again.destroy_node()


def test_a_text_that_is_a_number_is_one_at_run_time(
    start: Callable[..., Any], bench: Bench
) -> None:
    node = start(LatheNode)
    for text, value in (('5e-04', 5e-4), ('0.25 mm', 2.5e-4), ('0', 0.0)):
        for result in (
            *bench.set('/lathe', depth_of_cut=text),
            bench.set_together('/lathe', depth_of_cut=text, runout='0'),
        ):
            assert result.successful, result.reason
        assert node.get_parameter('depth_of_cut').value == value
        assert node.values['depth_of_cut'] == value
    (result,) = bench.set('/lathe', depth_of_cut='5e-04 kg')
    assert not result.successful
    assert "'5e-04 kg'" in result.reason


@pytest.mark.parametrize(
    ('given', 'taken'),
    [
        ('depth_of_cut: 5e-04', 5e-4),
        ("depth_of_cut: '5e-04'", 5e-4),
        ('depth_of_cut: 0.5 mm', 5e-4),
        ('depth_of_cut: []', None),
        ('depth_of_cut: deep', None),
    ],
)
def test_a_text_that_is_a_number_is_one_in_a_file(
    given: str, taken: float | None, context: Context, tmp_path: Path
) -> None:
    file = tmp_path / 'parameters.yaml'
    file.write_text(f'/lathe:\n  ros__parameters:\n    {given}\n')
    arguments = ['--ros-args', '--params-file', str(file)]
    if taken is None:
        with pytest.raises(ParameterError, match=r'^depth_of_cut is'):
            LatheNode(context=context, cli_args=arguments)
        return
    node = LatheNode(context=context, cli_args=arguments)
    try:
        assert node.values['depth_of_cut'] == taken
    finally:
        node.destroy_node()
