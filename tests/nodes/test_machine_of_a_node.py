"""Nodes with a machine file, also one of several modes, for which single values do not exist."""

from __future__ import annotations

import pytest
from rcl_interfaces.srv import GetParameters, ListParameters
from support.node_bench import Bench
from support.node_processes import NodeProcesses, Samples

from lathe_chatter.model.machine_file import load_machine, shipped_machines
from lathe_chatter.recording import read_run, resimulate, verify


@pytest.mark.parametrize('machine', sorted(shipped_machines()))
def test_a_cell_has_the_machine_of_a_file(
    machine: str, bench: Bench, nodes: NodeProcesses
) -> None:
    samples = Samples(bench)
    run = nodes.folder / 'run'
    nodes.start('run_recorder', f'output:={run}')
    nodes.start('lathe', f'machine:={machine}')
    nodes.start('chatter_monitor', 'model:=lathe')
    bench.spin_until(lambda: len(samples) > 5_000, 'samples')
    listed = bench.call(ListParameters, '/lathe/list_parameters', ListParameters.Request())
    single = len(load_machine(machine).machine.tool.modes) == 1
    assert ('tool.mass' in listed.result.names) is single
    asked = GetParameters.Request(names=['depth_of_cut', 'machine'])
    answer = bench.call(GetParameters, '/lathe/get_parameters', asked)
    assert answer.values[0].double_value == load_machine(machine).cut.depth_of_cut
    bench.spin_until(lambda: 'Listening from' in nodes.said(), 'the monitor')
    nodes.interrupt('/lathe')
    nodes.interrupt('/run_recorder')
    assert not [finding.text for finding in verify(run).findings if finding.loss]
    (computed,) = resimulate(read_run(run))
    assert computed.proven, computed.obstacle
    assert 'Traceback' not in nodes.said()
