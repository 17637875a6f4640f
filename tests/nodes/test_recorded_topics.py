"""Which topics a recorder takes, and what it makes of them: over real DDS."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import rclpy
from mcap.reader import make_reader
from rcl_interfaces.msg import Log
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Bool, Float64, String
from std_srvs.srv import SetBool, Trigger
from support.node_bench import Bench

from lathe_chatter.errors import LatheChatterError
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.nodes.diagnostics import OK
from lathe_chatter.nodes.lathe_node import LatheNode
from lathe_chatter.nodes.recorder_node import RecorderNode
from lathe_chatter.recording import read_run, verify
from lathe_chatter.recording.snapshot import SNAPSHOT

Start = Callable[..., Any]
KEPT = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
LAST = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def test_a_type_that_the_reading_library_does_not_know_is_recorded(
    start: Start, bench: Bench, spin_until: Any, tmp_path: Path
) -> None:
    """The events of a service: messages of a type that has no file of its own."""
    recorder = start(RecorderNode, output=str(tmp_path / 'run'), topics=['/events', '/n'])
    events = bench.talk(Trigger.Event, '/events')
    numbers = bench.talk(Float64, '/n')
    events.publish(Trigger.Event())
    numbers.publish(Float64(data=1.0))
    spin_until(lambda: recorder.messages_of('/events') * recorder.messages_of('/n'), 'both')
    recorder.stop()
    run = read_run(tmp_path / 'run')
    assert run.topics == {'/events': 'std_srvs/srv/Trigger_Event', '/n': 'std_msgs/msg/Float64'}
    assert [raw.type for raw in run.raw_messages('/events')] == ['std_srvs/srv/Trigger_Event']
    assert verify(tmp_path / 'run').complete


@pytest.fixture
def apart(domain: int) -> Iterator[Callable[[str], Node]]:
    """Nodes with a participant of their own: Fast DDS has one type for a topic in each."""
    made: list[tuple[Context, Node]] = []

    def make(name: str) -> Node:
        context = Context()
        rclpy.init(context=context, domain_id=domain)
        made.append((context, Node(name, context=context)))
        return made[-1][1]

    yield make
    for context, node in made:
        node.destroy_node()
        context.try_shutdown()


def test_a_type_that_changes_goes_on_as_another_channel(
    start: Start, apart: Callable[[str], Node], bench: Bench, spin_until: Any, tmp_path: Path
) -> None:
    log = bench.listen_first(Log, '/rosout')
    recorder = start(RecorderNode, output=str(tmp_path / 'run'), topics=['/x'])
    first = apart('first')
    numbers = first.create_publisher(Float64, '/x', KEPT)
    numbers.publish(Float64(data=1.5))
    spin_until(lambda: recorder.messages_of('/x') == 1, 'the number')
    first.destroy_publisher(numbers)
    words = apart('second').create_publisher(String, '/x', KEPT)
    words.publish(String(data='two'))
    spin_until(lambda: recorder._topics['/x'].topic.type.endswith('String'), 'the other type')
    spin_until(lambda: recorder.messages_of('/x') == 1, 'the word')
    said = '/x is now of type std_msgs/msg/String, and recorded as such.'
    spin_until(lambda: any(entry.msg == said for entry in log), 'the sentence')
    recorder.stop()
    found = [m.message.data for m in read_run(tmp_path / 'run').messages('/x')]
    assert found == [1.5, 'two']
    assert verify(tmp_path / 'run').complete


def test_a_topic_whose_package_is_not_installed_costs_only_itself(
    bench: Bench, spin_until: Any, tmp_path: Path
) -> None:
    """The recorder is a process in which the package of one of the types cannot be imported."""
    unknown = bench.talk_alone(Trigger.Event, '/unknown')
    numbers = bench.node.create_publisher(Float64, '/n', KEPT)
    child = (
        'import sys\n'
        'import lathe_chatter.nodes.recorder_node as node\n'
        "sys.modules['diagnostic_msgs.nothing'] = None\n"
        'import lathe_chatter.nodes.topic_types as types\n'
        'was = types.import_module\n'
        'def missing(name):\n'
        "    if name == 'std_srvs.srv':\n"
        "        raise ModuleNotFoundError(f'No module named {name!r}', name=name)\n"
        '    return was(name)\n'
        'types.import_module = missing\n'
        'node.main()\n'
    )
    values = [f'output:={tmp_path / "run"}', 'topics:=[/unknown, /n]']
    words = [word for value in values for word in ('-p', value)]
    process = subprocess.Popen(
        [sys.executable, '-c', child, '--ros-args', *words],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    spin_until(numbers.get_subscription_count, 'the recorder')
    for k in range(10):
        numbers.publish(Float64(data=float(k)))
        unknown.publish(Trigger.Event())
    numbers.wait_for_all_acked()
    process.terminate()
    out, _ = process.communicate(timeout=30)
    assert process.returncode == 0, out
    assert out.count('/unknown is not recorded: the package of its type') == 1
    found = [m.message.data for m in read_run(tmp_path / 'run').messages('/n')]
    assert found == [float(k) for k in range(10)]


def test_what_was_before_a_recorder_began_is_not_lost(
    start: Start, spin_until: Any, tmp_path: Path
) -> None:
    lathe = start(LatheNode, real_time_factor=20.0)
    spin_until(lambda: lathe.samples_taken > 200_000, 'a lathe that has long been cutting')
    recorder = start(RecorderNode, output=str(tmp_path / 'run'), topics=['/lathe/samples'])
    spin_until(lambda: recorder.messages_of('/lathe/samples') > 100, 'samples')
    assert recorder.lost_of('/lathe/samples') == 0
    assert recorder._status().level == OK
    assert '0 were lost' in recorder.stop().message


def test_what_a_publisher_said_before_it_was_heard_is_no_loss_of_the_one_before(
    start: Start, apart: Callable[[str], Node], spin_until: Any, tmp_path: Path
) -> None:
    """As of /parameter_events, of a node that was killed and started again."""
    recorder = start(RecorderNode, output=str(tmp_path / 'run'), topics=['/n'])
    first = apart('first')
    before = first.create_publisher(Float64, '/n', 100)
    spin_until(before.get_subscription_count, 'the recorder')
    for k in range(10):
        before.publish(Float64(data=float(k)))
    spin_until(lambda: recorder.messages_of('/n') == 10, 'the first')
    first.destroy_publisher(before)
    after = apart('second').create_publisher(Float64, '/n', 100)
    for k in range(30):  # nobody has met it yet
        after.publish(Float64(data=float(k)))
    spin_until(after.get_subscription_count, 'the recorder')
    for k in range(30, 50):
        after.publish(Float64(data=float(k)))
    spin_until(lambda: recorder.messages_of('/n') >= 30, 'the second')
    came = recorder.messages_of('/n')
    recorder.stop()
    assert recorder.lost_of('/n') == 0
    found = verify(tmp_path / 'run')
    assert found.messages['/n'] == came
    assert [finding.text for finding in found.findings if finding.loss] == []


def test_two_recorders_that_begin_in_one_second_have_a_folder_each(
    start: Start, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    recorders = [start(RecorderNode, f'/cell{k}', topics=['/n']) for k in range(3)]
    folders = {recorder.run for recorder in recorders}
    assert len(folders) == 3
    assert all(folder.parent == Path('runs') for folder in folders)
    assert all(recorder.stop().done for recorder in recorders)


def test_all_topics_expressions_and_exclusion(
    start: Start, bench: Bench, spin_until: Any, tmp_path: Path
) -> None:
    every = start(
        RecorderNode, '/a', output=str(tmp_path / 'a'), topics=['/left_out'], all_topics=True,
        exclude='left_out|rosout|/diagnostics|parameter_events',
    )  # fmt: skip
    some = start(
        RecorderNode, '/b', output=str(tmp_path / 'b'), topics=['/named'], topics_like='^/f[ab]'
    )
    names = ('/fa', '/fb', '/fc', '/named', '/left_out', '/_hidden')
    publishers = {name: bench.node.create_publisher(Float64, name, KEPT) for name in names}
    for publisher in publishers.values():
        publisher.publish(Float64(data=1.0))
    spin_until(lambda: all(every.messages_of(name) for name in ('/fa', '/fc', '/named')), 'all')
    spin_until(lambda: all(some.messages_of(name) for name in ('/fa', '/fb', '/named')), 'some')
    assert set(every._topics) == {'/fa', '/fb', '/fc', '/named'}
    assert set(some._topics) == {'/fa', '/fb', '/named'}
    with pytest.raises(LatheChatterError, match='topics_like must be a regular expression'):
        start(RecorderNode, '/c', output=str(tmp_path / 'c'), topics_like='[')


@pytest.mark.parametrize('compression', ['none', 'lz4', 'zstd'])
def test_files_of_a_size_repeat_what_late_readers_get(
    compression: str, start: Start, bench: Bench, spin_until: Any, tmp_path: Path
) -> None:
    recorder = start(
        RecorderNode, output=str(tmp_path / 'run'), topics=['/words', '/setting'],
        split_size=20_000, repeat_latched=True, compression=compression,
    )  # fmt: skip
    setting = bench.node.create_publisher(String, '/setting', LAST)
    setting.publish(String(data='of old'))
    setting.publish(String(data='in force'))
    words = bench.talk(String, '/words')
    spin_until(lambda: recorder.messages_of('/setting') == 1, 'the setting')
    sent = 0
    while len(list((tmp_path / 'run').glob('*.mcap'))) < 4:
        sent += 1
        words.publish(String(data=os.urandom(2000).hex()))
        spin_until(lambda n=sent: recorder.messages_of('/words') == n, 'a word')
    recorder.stop()
    for file in read_run(tmp_path / 'run').files:
        with file.open('rb') as stream:
            found = [c.topic for _, c, _ in make_reader(stream).iter_messages()]
        assert found.count('/setting') == 1
    found = verify(tmp_path / 'run')
    assert found.complete, found.findings
    assert found.messages['/words'] == sent


def test_a_pause_leaves_out_what_comes_and_is_no_loss(
    start: Start, bench: Bench, spin_until: Any, tmp_path: Path
) -> None:
    recorder = start(RecorderNode, output=str(tmp_path / 'run'))
    lathe = start(LatheNode)
    spin_until(lambda: recorder.messages_of('/lathe/samples') > 100, 'samples')
    assert bench.call(SetBool, '/run_recorder/pause', SetBool.Request(data=True)).success
    there = recorder.messages_of('/lathe/samples')
    until = lathe.samples_taken + 5000
    spin_until(lambda: lathe.samples_taken > until, 'what is left out')
    lathe.set_parameters([Parameter('depth_of_cut', value=0.0006)])
    assert recorder.messages_of('/lathe/samples') == there
    assert bench.call(SetBool, '/run_recorder/pause', SetBool.Request(data=False)).success
    spin_until(lambda: recorder.messages_of('/lathe/samples') > there + 100, 'what comes after')
    assert recorder.lost_of('/lathe/samples') == 0
    assert '0 were lost' in recorder.stop().message
    found = verify(tmp_path / 'run')
    assert found.complete, found.findings
    assert any('left out in 1 pauses of the recorder' in each.text for each in found.findings)
    assert len(read_run(tmp_path / 'run').samples().gaps) == 1


def test_a_snapshot_has_the_last_seconds_when_it_is_asked_for_and_when_chatter_is_flagged(
    start: Start, bench: Bench, spin_until: Any, tmp_path: Path
) -> None:
    recorder = start(
        RecorderNode, output=str(tmp_path / 'run'), snapshot=0.5,
        topics=['/lathe/samples', '/chatter_monitor/chatter', '/rosout', '/setting'],
    )  # fmt: skip
    setting = bench.node.create_publisher(String, '/setting', LAST)
    setting.publish(String(data='in force'))
    flag = bench.node.create_publisher(Bool, '/chatter_monitor/chatter', LAST)
    lathe = start(LatheNode)
    spin_until(lambda: lathe.samples_taken > 20_000, 'two seconds')
    spin_until(lambda: recorder.messages_of('/setting') == 1, 'the setting')
    assert not (tmp_path / 'run').exists()
    answer = bench.call(Trigger, '/run_recorder/snapshot', Trigger.Request())
    assert answer.success, answer.message
    first = read_run(tmp_path / 'run')
    times = first.samples().columns['time']
    assert 0.3 < times[-1] - times[0] < 1.0
    assert [m.message.data for m in first.messages('/setting')] == ['in force']
    flag.publish(Bool(data=True))
    spin_until((tmp_path / 'run-2' / 'metadata.yaml').exists, 'the second')
    second = read_run(tmp_path / 'run-2')
    reasons = [
        note.values['reason']
        for run in (first, second)
        for note in run.notes()
        if note.name == SNAPSHOT
    ]
    assert reasons == ['It was asked for.', 'Chatter was flagged.']
    assert verify(tmp_path / 'run').complete
    assert VirtualLathe().sample_rate == pytest.approx(1.0 / (times[1] - times[0]))
    assert recorder.stop().done
