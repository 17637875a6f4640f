"""Lathe, monitor and recorder in one process do what they do in three."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from rcl_interfaces.srv import GetParameters
from std_msgs.msg import Bool
from support.node_bench import LATCHED, Bench
from support.node_processes import NodeProcesses, Reports, Samples, contiguous

from lathe_chatter.recording import read_run, resimulate, verify

CHATTER = ('lathe:depth_of_cut:=0.001', 'lathe:bearing_contact:=none')


def test_a_cell_cuts_flags_and_records_all_of_it(bench: Bench, nodes: NodeProcesses) -> None:
    reports, samples = Reports(bench), Samples(bench)
    flags: list[Any] = bench.listen_first(Bool, '/chatter_monitor/chatter', LATCHED)
    run = nodes.folder / 'run'
    nodes.start('cell', *CHATTER, f'run_recorder:output:={run}')
    bench.spin_until(lambda: flags and flags[-1].data, 'the flag')
    for node, name in (
        ('lathe', 'depth_of_cut'),
        ('chatter_monitor', 'model'),
        ('run_recorder', 'topics'),
    ):
        request = GetParameters.Request(names=[name])
        assert bench.call(GetParameters, f'/{node}/get_parameters', request).values
    bench.pause('/lathe')
    bench.pause('/lathe', pause=False)
    count = len(samples)
    bench.spin_until(lambda: len(samples) > count + 500, 'more samples')
    recorded = lambda: reports.statuses('/run_recorder: recording')  # noqa: E731
    bench.spin_until(recorded, 'the diagnostics of the recorder')
    nodes.interrupt('/cell')
    (heard,) = samples.runs()
    assert contiguous(heard)
    times = read_run(run).samples(columns=['time']).columns['time']
    assert contiguous(times)
    assert times[0] == 1e-4
    assert times[-1] >= heard[-1]
    assert not [finding.text for finding in verify(run).findings if finding.loss]
    (computed,) = resimulate(read_run(run))
    assert computed.proven, computed.obstacle
    assert computed.compared == np.size(times)


@pytest.mark.parametrize('factor', [100.0, 0.0])
def test_a_cell_that_cannot_keep_up_slows_down_and_loses_nothing(
    factor: float, bench: Bench, nodes: NodeProcesses
) -> None:
    reports = Reports(bench)
    run = nodes.folder / 'run'
    values = f'lathe:real_time_factor:={factor}', f'run_recorder:output:={run}'
    nodes.start('cell', *CHATTER, *values)
    kept = lambda: reports.value('/run_recorder: recording', 'messages')  # noqa: E731
    bench.spin_until(lambda: float(kept() or 0) > 5_000, 'thousands of blocks')
    nodes.interrupt('/cell')
    found = verify(run)
    assert not [finding.text for finding in found.findings if finding.loss]
    assert found.samples['/lathe/samples'].first == 1e-4
    assert found.samples['/lathe/samples'].samples > 20 * 2_000  # most of these are blocks


def test_a_wrong_parameter_of_one_of_them_keeps_the_cell_from_starting(
    nodes: NodeProcesses,
) -> None:
    process = nodes.start('cell', 'chatter_monitor:tool.mass:=-1')
    assert process.wait(120) == 2
    assert 'tool.mass is -1 kg' in nodes.said()
    assert 'Traceback' not in nodes.said()
