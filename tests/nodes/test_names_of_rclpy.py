"""No node of ours puts something of its own where rclpy keeps something of the same name."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
from rclpy.context import Context
from rclpy.node import Node

import lathe_chatter.nodes

BASES = {'Node', 'ParameterNode', 'LatheNode', 'RecorderNode', 'MonitorNode', 'SupervisorNode'}
MODULES = sorted(Path(lathe_chatter.nodes.__file__).parent.rglob('*.py'))


def assigned(module: Path) -> set[str]:
    """The attributes that the node classes of a module set on themselves."""
    found: set[str] = set()
    for kind in ast.walk(ast.parse(module.read_text())):
        if isinstance(kind, ast.ClassDef) and BASES & {getattr(b, 'id', '') for b in kind.bases}:
            found |= {
                node.attr
                for node in ast.walk(kind)
                if isinstance(node, ast.Attribute)
                and isinstance(node.ctx, ast.Store)
                and getattr(node.value, 'id', '') == 'self'
            }
    return found


@pytest.mark.parametrize('module', MODULES, ids=lambda module: module.stem)
def test_no_attribute_of_rclpy_is_overwritten(module: Path, context: Context) -> None:
    node = Node('plain', context=context)
    try:
        assert not assigned(module) & set(dir(node))
    finally:
        node.destroy_node()


def test_the_nodes_are_seen() -> None:
    seen = {module.stem for module in MODULES if assigned(module)}
    assert {'lathe_node', 'monitor_node', 'recorder_node'} <= seen
