"""Nodes have compiled or loaded all that they will call before they listen: a cell waits then."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

ENTERED = """
import gc
import rclpy
from numba.core.registry import CPUDispatcher

def entered():
    found = [each for each in gc.get_objects() if isinstance(each, CPUDispatcher)]
    return {(each.__name__, str(kind)) for each in found for kind in each.overloads}

rclpy.init()
"""
"""Whether from a cache or not: what was not called before is called here first."""
SUPERVISED = """
from lathe_chatter.model import BearingContact, Cut, Machine
from lathe_chatter.nodes.supervisor_node import SupervisorNode
from lathe_chatter.supervisor import Limits, Mode, Seen, Supervisor
from lathe_chatter.supervisor.likely_machines import may_be
from lathe_chatter.supervisor.move_search import moves_for

node = SupervisorNode()
before = entered()
deep = Cut(depth_of_cut=1e-3, bearing_contact=BearingContact.NONE)
kinds = set()
for cut, limits in (
    (deep, Limits()),
    (deep, Limits(2990.0, 3010.0, largest_variation=0.0)),
    (deep.with_changes(process_damping=1e5), Limits()),
    (deep.with_changes(spindle_speed_rpm=2000.0),
     Limits(1580.0, 2420.0, ramp=40e3, smallest_depth=1e-3)),
    (Cut(depth_of_cut=5e-4, feed_speed=0.0045), Limits(2990.0, 3010.0, largest_variation=0.0)),
):
    supervisor = Supervisor(limits, Mode.ACT)
    supervisor.machine = Machine()
    for k in range(150):
        supervisor.look(Seen(0.02 * k, cut, k > 0, 5.0, 130.0, 1e-6, tool_frequency=130.0))
    for move in moves_for(may_be(Machine(), 0.01), cut, limits):
        kinds |= set(move.changes_from(cut))
assert kinds == {'spindle_speed_rpm', 'depth_of_cut', 'feed_speed', 'speed_variation_amplitude',
                 'speed_variation_frequency'}, kinds
"""
CHARTED = """
from rclpy.parameter import Parameter
from lathe_chatter.model.lathe_parameter_table import LATHE
from lathe_chatter.nodes.operator_page_node import OperatorPageNode
from lathe_chatter.page.stability_chart import stability_chart

node = OperatorPageNode(parameter_overrides=[Parameter('port', value=0)])
before = entered()
assert 'speed' in stability_chart({row.name: row.default for row in LATHE}, [5000.0])
"""


@pytest.mark.parametrize(
    'program', [SUPERVISED, CHARTED], ids=['a supervisor that moves', 'a page that draws a chart']
)
def test_nothing_is_compiled_once_it_is_needed(domain: int, program: str) -> None:
    end = '\nassert before and entered() == before, entered() - before\n'
    done = subprocess.run(
        [sys.executable, '-c', ENTERED + program + end],
        env={**os.environ, 'ROS_DOMAIN_ID': str(domain)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
