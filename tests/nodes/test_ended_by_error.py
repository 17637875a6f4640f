"""A run whose writer dies of an error is not complete, and says so: real processes that fail."""

from __future__ import annotations

import sys

import pytest
from support.node_bench import Bench
from support.node_processes import NodeProcesses, Samples

from lathe_chatter.cli.main import main
from lathe_chatter.recording import verify

FAILING = """
from lathe_chatter.nodes import {module} as module

usual, calls = module.{kind}._report, []

def failing(self):
    calls.append(1)
    if len(calls) > 2 and {ready}:
        raise RuntimeError('what a callback may raise')
    usual(self)

module.{kind}._report = failing
module.main()
"""
"""A node one of whose callbacks raises, after two seconds, once there is something to record."""


@pytest.mark.parametrize(
    ('module', 'kind', 'parameter', 'ready'),
    [
        ('recorder_node', 'RecorderNode', 'output', 'self.messages_of("/lathe/samples")'),
        ('lathe_node', 'LatheNode', 'record', 'self.samples_taken'),
        ('composition', 'MonitorNode', 'run_recorder:output', 'self._continuity.samples'),
    ],
    ids=['recorder', 'record', 'cell'],
)
def test_a_run_whose_writer_dies_of_an_error_says_so(
    module: str, kind: str, parameter: str, ready: str, bench: Bench, nodes: NodeProcesses
) -> None:
    samples = Samples(bench)
    run = nodes.folder / 'run'
    if module == 'recorder_node':
        nodes.start('lathe')
        bench.spin_until(lambda: len(samples), 'samples')
    code = FAILING.format(module=module, kind=kind, ready=ready)
    command = [sys.executable, '-c', code, '--ros-args', '-p', f'{parameter}:={run}']
    process = nodes.start_program('/failing', command)
    assert process.wait(120) == 1
    assert 'what a callback may raise' in nodes.said()
    found = verify(run)
    assert not found.complete
    assert found.samples['/lathe/samples'].samples > 0
    said = 'The run ended early. It failed: what a callback may raise'
    assert said in [finding.text for finding in found.findings if finding.loss]
    assert main(['verify', str(run)]) == 1
