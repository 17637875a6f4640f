"""Readers that do not read: none of them holds up the lathe, or takes samples from another."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Float64MultiArray, String
from support.node_bench import LATCHED, Bench
from support.node_processes import NodeProcesses, Reports, Samples, contiguous

from lathe_chatter.nodes.lathe_topics import MAX_HISTORY

TICK = 0.002
KEPT = 2000
"""Blocks that the lathe keeps: for 4 s in real time, in which a busy machine serves everybody."""
REFUSED = 5000
"""Blocks after which a reader that must keep all takes no more: Fast DDS's default."""
PACE, HEARD = '/lathe: pace', '/chatter_monitor: samples'
DEPTH = 'qos_overrides./lathe/samples.publisher.depth'


@pytest.fixture
def stuck(context: Context) -> Iterator[Callable[[QoSProfile], None]]:
    """Subscribers to the samples that are never spun."""
    nodes: list[Node] = []

    def subscribe(qos: QoSProfile) -> None:
        node = Node(f'stuck_{len(nodes)}', context=context)
        node.create_subscription(Float64MultiArray, '/lathe/samples', nodes.append, qos)
        nodes.append(node)

    yield subscribe
    for node in nodes:
        node.destroy_node()


def test_readers_that_do_not_read_slow_nothing_and_cost_nobody_a_sample(
    bench: Bench, nodes: NodeProcesses, stuck: Callable[[QoSProfile], None]
) -> None:
    reports, samples = Reports(bench), Samples(bench)
    reliable = ReliabilityPolicy.RELIABLE
    stuck(QoSProfile(depth=10, reliability=reliable))
    stuck(QoSProfile(depth=1, reliability=reliable, history=HistoryPolicy.KEEP_ALL))
    latched = DurabilityPolicy.TRANSIENT_LOCAL
    stuck(QoSProfile(depth=KEPT, reliability=reliable, durability=latched))
    # Nobody is served before all are there.
    nodes.start('lathe', 'real_time_factor:=1.5', f'{DEPTH}:={2 * KEPT}', 'await_readers:=4')
    follow(bench, reports, samples, REFUSED + KEPT // 4)
    (times,) = samples.runs()
    assert times[0] == 1e-4


def test_a_process_that_is_stopped_slows_nothing_and_says_what_it_missed(
    bench: Bench, nodes: NodeProcesses
) -> None:
    reports, samples = Reports(bench), Samples(bench)
    states: list[Any] = bench.listen_first(String, '/chatter_monitor/state', LATCHED)
    monitor = nodes.start('chatter_monitor')
    nodes.start('lathe', 'await_readers:=2')
    bench.spin_until(lambda: states and states[-1].data != 'unknown', 'a known state')
    monitor.send_signal(signal.SIGSTOP)
    follow(bench, reports, samples, KEPT + KEPT // 4)
    known = len(states)
    monitor.send_signal(signal.SIGCONT)
    bench.spin_until(
        lambda: any('did not come' in s for s in reports.sentences('chatter_monitor')),
        'what the monitor missed',
    )
    bench.spin_until(lambda: reports.value(HEARD, 'samples lost') not in {'', '0'}, 'the count')
    lost = int(reports.value(HEARD, 'samples lost'))
    assert 0 < lost < 1e4 * samples.ends[-1]
    bench.spin_until(lambda: states[-1].data != 'unknown', 'a known state again')
    assert len(states) >= known


def test_a_lathe_that_is_faster_than_its_readers_slows_down_and_loses_nothing(
    bench: Bench, nodes: NodeProcesses, tmp_path: Path
) -> None:
    reports = Reports(bench)
    nodes.start('chatter_monitor')
    nodes.start('run_recorder', f'output:={tmp_path / "run"}')
    nodes.start('lathe', 'real_time_factor:=100.0', 'await_readers:=2')
    many = 3 * MAX_HISTORY  # of which a busy machine takes 1000 a second
    bench.spin_until(lambda: int(reports.value(PACE, 'ticks') or 0) > many, 'many ticks')
    since = reports.count()
    bench.spin_until(lambda: reports.value(HEARD, 'samples lost', since), 'the count')
    assert reports.value(HEARD, 'samples lost', since) == '0'
    assert float(reports.value(PACE, 'lag given up, s')) > 0.0


def follow(bench: Bench, reports: Reports, samples: Samples, blocks: int) -> None:
    """Hear so many more blocks: nothing is lost, and the lathe waits for nobody."""
    before = pace(bench, reports)
    target = len(samples) + blocks
    bench.spin_until(lambda: len(samples) >= target, 'more samples than anybody keeps')
    after = pace(bench, reports)
    cut = (after['ticks'] - before['ticks']) * TICK
    # What the machine has no time for is given up too. But a writer that waits for a reader does
    # so for 0.1 s: 49 of 50 ticks would be given up at least.
    assert after['lag given up, s'] - before['lag given up, s'] < 9.0 * cut
    (times,) = samples.runs()
    assert contiguous(times)


def pace(bench: Bench, reports: Reports) -> dict[str, float]:
    """The next report of the pace."""
    since = reports.count()
    bench.spin_until(lambda: reports.value(PACE, 'ticks', since), 'a report')
    status = reports.statuses(PACE, since)[-1]
    keys = ('ticks', 'lag given up, s')
    return {v.key: float(v.value) for v in status.values if v.key in keys}
