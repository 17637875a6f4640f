"""The recorder over real DDS: what it hears is on disk, and what it did not hear is counted."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Float64, Float64MultiArray
from std_srvs.srv import Trigger
from support.loaded_modules import COMPUTING, loaded_by
from support.node_bench import Bench

from lathe_chatter import __version__
from lathe_chatter.errors import LatheChatterError
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.nodes.lathe_node import LatheNode
from lathe_chatter.nodes.recorder_node import RecorderNode
from lathe_chatter.recording import read_run, verify
from lathe_chatter.recording.provenance import CHECK, PUBLISHERS
from lathe_chatter.recording.run_summary import SUMMARY
from lathe_chatter.samples.codec import encode_block

Start = Callable[..., Any]
KEPT = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def test_a_lathe_is_recorded_from_its_first_sample(
    start: Start, spin_until: Any, tmp_path: Path
) -> None:
    lathe = start(LatheNode, real_time_factor=1.0)
    recorder = start(RecorderNode, output=str(tmp_path / 'run'))
    spin_until(lambda: recorder.messages_of('/lathe/samples') > 100, 'a hundred blocks')
    assert lathe.count_subscribers('/lathe/samples') == 1
    recorder.stop()
    samples = read_run(tmp_path / 'run').samples()
    assert samples.columns['time'][0] == pytest.approx(1e-4)
    assert samples.gaps == []
    assert len(samples.columns['time']) == 20 * recorder.messages_of('/lathe/samples')


def test_the_services_start_split_and_stop(
    start: Start, bench: Bench, spin_until: Any, tmp_path: Path
) -> None:
    recorder = start(RecorderNode, output=str(tmp_path / 'run'), topics=['/n'], autostart=False)
    publisher = bench.node.create_publisher(Float64, '/n', KEPT)
    assert recorder.run is None
    answer = bench.call(Trigger, '/run_recorder/stop', Trigger.Request())
    assert not answer.success
    answer = bench.call(Trigger, '/run_recorder/start', Trigger.Request())
    assert answer.success, answer.message
    for k in range(20):
        if k == 10:
            spin_until(lambda: recorder.messages_of('/n') == 10, 'ten messages')
            assert bench.call(Trigger, '/run_recorder/split', Trigger.Request()).success
        publisher.publish(Float64(data=float(k)))
    spin_until(lambda: recorder.messages_of('/n') == 20, 'twenty messages')
    answer = bench.call(Trigger, '/run_recorder/stop', Trigger.Request())
    assert 'holds 20 messages, and 0 were lost' in answer.message
    run = read_run(tmp_path / 'run')
    assert len(run.files) == 2
    assert [m.message.data for m in run.messages('/n')] == [float(k) for k in range(20)]
    answer = bench.call(Trigger, '/run_recorder/start', Trigger.Request())
    assert answer.success, answer.message
    assert recorder.run == tmp_path / 'run-2'


RECORDED = """
import sys
import rclpy
from lathe_chatter.nodes.recorder_node import RecorderNode

rclpy.init(args=['--ros-args', '-p', f'output:={sys.argv[1]}'])
node = RecorderNode()
node.begin()
while not node.messages_of('/rosout'):
    rclpy.spin_once(node)
node.stop()
"""


def test_a_recorder_loads_nothing_that_computes(domain: int, tmp_path: Path) -> None:
    """Else it would begin half a second later."""
    folder = str(tmp_path / 'run')
    loaded = loaded_by('-c', RECORDED, folder, ROS_DOMAIN_ID=str(domain))
    assert 'lathe_chatter.recording.run_writer' in loaded
    assert not loaded & COMPUTING


def test_a_loss_on_the_way_is_counted(
    start: Start, bench: Bench, spin_until: Any, tmp_path: Path
) -> None:
    recorder = start(RecorderNode, output=str(tmp_path / 'run'), topics=['/n'])
    sent = bench.overflow('/n', lambda: recorder.messages_of('/n') == 1)
    spin_until(lambda: recorder.lost_of('/n'), 'the loss')
    lost = sent - recorder.messages_of('/n')
    assert recorder.lost_of('/n') == lost
    assert f'{lost} were lost' in recorder.stop().message
    (told,) = [each.text for each in verify(tmp_path / 'run').findings if each.loss]
    assert told.startswith(f'/n: {lost} messages are missing between ')


def test_what_a_publisher_replaced_before_it_was_found_is_not_lost_but_noted(
    start: Start, bench: Bench, spin_until: Any, tmp_path: Path
) -> None:
    """How many it keeps, it does not say: recorder and `verify` agree."""
    recorder = start(RecorderNode, output=str(tmp_path / 'run'), topics=['/n'])
    publisher = bench.node.create_publisher(
        Float64, '/n', QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    )
    for k in range(50):
        publisher.publish(Float64(data=float(k)))
    spin_until(lambda: recorder.messages_of('/n') == 1, 'the message that was kept')
    assert '0 were lost' in recorder.stop().message
    found = verify(tmp_path / 'run')
    assert found.complete
    noted = '/n: the record begins with message 50 of its publisher.'
    assert noted in [finding.text for finding in found.findings]


def test_a_lathe_that_began_again_is_asked_once_for_its_parameters(
    start: Start, bench: Bench, spin_until: Any, tmp_path: Path
) -> None:
    """Also while the sentence of it waits: each answer is one more lathe in the record."""
    recorder = start(RecorderNode, output=str(tmp_path / 'run'))
    start(LatheNode)
    answers = recorder._noted
    spin_until(lambda: answers.get('/lathe'), 'its parameters')
    assert bench.trigger('/lathe/reset').success
    bench.pause('/lathe', pause=False)
    spin_until(lambda: len(answers['/lathe']) == 2, 'its parameters again')
    until = time.monotonic() + 5.0
    spin_until(lambda: time.monotonic() > until, 'another answer')
    assert len(answers['/lathe']) == 2


def test_an_existing_folder_is_refused(start: Start, tmp_path: Path) -> None:
    with pytest.raises(LatheChatterError, match='exists already'):
        start(RecorderNode, output=str(tmp_path))


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_with_exit_0_and_a_finished_run(
    number: signal.Signals, recorder_process: Any, bench: Bench, spin_until: Any, tmp_path: Path
) -> None:
    publisher = bench.node.create_publisher(Float64, '/n', KEPT)
    process = recorder_process()
    spin_until(lambda: publisher.get_subscription_count() == 1, 'the recorder')
    for k in range(100):
        publisher.publish(Float64(data=float(k)))
    publisher.wait_for_all_acked()
    process.send_signal(number)
    _, err = process.communicate(timeout=30)
    assert process.returncode == 0, err
    run = read_run(tmp_path / 'run')
    assert [m.message.data for m in run.messages('/n')] == [float(k) for k in range(100)]


def test_an_existing_folder_at_the_start_of_the_process_is_one_sentence(tmp_path: Path) -> None:
    done = subprocess.run(
        [
            sys.executable, '-m', 'lathe_chatter.nodes.entry_points', 'run_recorder',
            '--ros-args', '-p', f'output:={tmp_path}',
        ],
        capture_output=True, text=True, check=False, timeout=60,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.strip() == f'{tmp_path} exists already, and no recorded run is overwritten.'


def test_a_gap_in_the_samples_is_told_by_their_own_times(
    start: Start, bench: Bench, spin_until: Any, tmp_path: Path
) -> None:
    recorder = start(RecorderNode, output=str(tmp_path / 'run'), topics=['lathe/samples'])
    told = bench.listen(DiagnosticArray, '/diagnostics')
    publisher = bench.node.create_publisher(Float64MultiArray, '/lathe/samples', KEPT)
    lathe = VirtualLathe()
    lathe.advance(40)
    for k in range(20):
        samples = lathe.advance(20)
        if k not in (7, 8):  # no publisher's number tells of these
            publisher.publish(encode_block(samples))
    spin_until(lambda: recorder.messages_of('/lathe/samples') == 18, 'the blocks')
    spin_until(
        lambda: any(
            '40 samples of /lathe/samples are missing' in status.message
            for array in told
            for status in array.status
        ),
        'the diagnostic',
    )
    recorder.stop()
    (notes,) = [n for n in read_run(tmp_path / 'run').notes() if n.name == SUMMARY]
    counted = json.loads(notes.values['samples'])['/lathe/samples']
    assert (counted['head'], counted['lost'], counted['gaps']) == (40, 40, 1)


def test_what_the_recorder_says_last_is_in_the_record(
    start: Start, bench: Bench, spin_until: Any, tmp_path: Path
) -> None:
    """Of gaps that follow each other it tells a while later, or at its end."""
    topics = ['lathe/samples', '/rosout']
    recorder = start(RecorderNode, output=str(tmp_path / 'run'), topics=topics)
    spin_until(lambda: '/rosout' in recorder._topics, 'its own log')
    publisher = bench.node.create_publisher(Float64MultiArray, '/lathe/samples', KEPT)
    lathe = VirtualLathe()
    publisher.publish(encode_block(lathe.advance(20)))
    spin_until(lambda: recorder._next_news, 'the first of its news')
    lathe.advance(40)
    publisher.publish(encode_block(lathe.advance(20)))
    spin_until(lambda: recorder.messages_of('/lathe/samples') == 2, 'the blocks')
    recorder.stop()
    said = [m.message.msg for m in read_run(tmp_path / 'run').messages('/rosout')]
    assert '/lathe/samples: 40 samples between 0.002000 s and 0.006100 s did not come.' in said


def test_publishers_that_share_a_topic_lose_nothing(
    start: Start, bench: Bench, spin_until: Any, tmp_path: Path
) -> None:
    first = bench.node.create_publisher(Float64, '/n', KEPT)
    for k in range(20):
        first.publish(Float64(data=float(k)))
    recorder = start(RecorderNode, output=str(tmp_path / 'run'), topics=['/n', '/alone'])
    bench.talk(Float64, '/alone').publish(Float64(data=0.0))
    spin_until(lambda: recorder.messages_of('/n') == 20, 'the messages of the first')
    second = bench.node.create_publisher(Float64, '/n', KEPT)
    for k in range(40):
        (first, second)[k % 2].publish(Float64(data=float(k)))
    spin_until(lambda: recorder.messages_of('/n') == 60, 'the messages of both')
    recorder.stop()
    assert recorder.lost_of('/n') == 0
    assert verify(tmp_path / 'run').complete
    (noted,) = (n.values for n in read_run(tmp_path / 'run').notes() if n.name == PUBLISHERS)
    assert {name: count for name, count in noted.items() if name != CHECK} == {'/n': '2'}


def test_the_run_knows_who_made_it_and_the_parameters_of_the_lathe(
    start: Start, spin_until: Any, tmp_path: Path
) -> None:
    start(LatheNode, depth_of_cut=0.0007, seed=5)
    (tmp_path / 'deep.yaml').write_text('title: deep\n')
    recorder = start(
        RecorderNode,
        output=str(tmp_path / 'run'),
        topics=['lathe/samples'],
        attachments=[str(tmp_path / 'deep.yaml'), str(tmp_path / 'missing')],
    )
    spin_until(lambda: '/lathe' in recorder._noted, 'the parameters')
    recorder.stop()
    run = read_run(tmp_path / 'run')
    (attached,) = run.attachments()
    assert (attached.name, attached.data) == ('deep.yaml', b'title: deep\n')
    notes = {note.name: note.values for note in run.notes()}
    summary = notes['lathe_chatter/summary']
    samples = json.loads(summary['samples'])['/lathe/samples']
    assert samples['samples'] == 20 * recorder.messages_of('/lathe/samples')
    (verdict,) = json.loads(summary['linear_model'])['/lathe/samples']
    assert verdict['depth_of_cut'] == 0.0007
    assert json.loads(notes['lathe_chatter/reception']['/lathe/samples'])['lost'] == 0
    assert notes['lathe_chatter/made_by']['lathe_chatter'] == __version__
    parameters = json.loads(notes['lathe_chatter/parameters/lathe']['parameters'])
    assert (parameters['depth_of_cut'], parameters['seed']) == (0.0007, 5)
    assert parameters['tool.natural_frequency'] == 775.0


@pytest.fixture
def recorder_process(tmp_path: Path) -> Iterator[Callable[..., subprocess.Popen[str]]]:
    started: list[subprocess.Popen[str]] = []

    def make(*parameters: str) -> subprocess.Popen[str]:
        given = [f'output:={tmp_path / "run"}', 'topics:=[/n]', *parameters]
        words = [word for parameter in given for word in ('-p', parameter)]
        process = subprocess.Popen(
            [
                sys.executable,
                '-m',
                'lathe_chatter.nodes.entry_points',
                'run_recorder',
                '--ros-args',
                *words,
            ],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        started.append(process)
        return process

    yield make
    for process in started:
        process.kill()
        process.communicate()


def test_a_full_disk_ends_it_with_a_sentence_and_exit_1(
    recorder_process: Any, domain: int, tmp_path: Path
) -> None:
    assert domain >= 0
    process = recorder_process(f'min_free_space:={2**53}')
    _, err = process.communicate(timeout=60)
    assert process.returncode == 1
    assert err.splitlines()[-1].endswith('the recording ends, complete up to here.')
    assert 'Traceback' not in err
    assert read_run(tmp_path / 'run').topics == {}


def test_a_disk_that_fills_up_ends_it_with_its_last_good_state(
    recorder_process: Any, small_disk: Path, bench: Bench, spin_until: Any
) -> None:
    publisher = bench.node.create_publisher(Float64MultiArray, '/n', KEPT)
    process = recorder_process(f'output:={small_disk / "run"}', 'min_free_space:=0')
    told = bench.listen(DiagnosticArray, '/diagnostics')
    noise = np.random.default_rng(1).standard_normal((400, 1000))
    sent = iter(range(len(noise)))

    def ended() -> bool:
        for k in islice(sent, 10 if publisher.get_subscription_count() else 0):
            publisher.publish(Float64MultiArray(data=noise[k].tolist()))
        return process.poll() is not None

    spin_until(ended, 'the end of the recorder')
    assert process.returncode == 1
    said = process.stderr.read().splitlines()[-1]
    assert os.strerror(errno.ENOSPC) in said
    spin_until(
        lambda: any(said.rstrip() in status.message for array in told for status in array.status),
        'the diagnostic',
    )
    found = [recorded.message.data for recorded in read_run(small_disk / 'run').messages('/n')]
    assert 0 < len(found) < 130  # of 8 kB
    assert np.array(found).tobytes() == noise[: len(found)].tobytes()


def test_an_end_that_is_not_on_disk_is_exit_1(
    recorder_process: Any, small_disk: Path, bench: Bench, spin_until: Any
) -> None:
    publisher = bench.node.create_publisher(Float64, '/n', KEPT)
    process = recorder_process(f'output:={small_disk / "run"}', 'min_free_space:=0')
    file = small_disk / 'run' / 'run_0.mcap'
    spin_until(lambda: publisher.get_subscription_count() == 1, 'the recorder')
    publisher.publish(Float64(data=1.0))
    spin_until(lambda: file.exists() and list(read_run(file).messages('/n')), 'a message on disk')
    with (small_disk / 'filler').open('wb', buffering=0) as filler, suppress(OSError):
        while filler.write(bytes(4096)):
            pass
    for k in range(2000):
        publisher.publish(Float64(data=float(k)))
    publisher.wait_for_all_acked()
    process.send_signal(signal.SIGTERM)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 1
    assert 'Traceback' not in err
    assert os.strerror(errno.ENOSPC) in err.splitlines()[-1]
    assert next(read_run(file).messages('/n')).message.data == 1.0


def test_a_killed_recorder_leaves_all_but_the_last_moment(
    recorder_process: Any, bench: Bench, spin_until: Any, tmp_path: Path
) -> None:
    publisher = bench.node.create_publisher(Float64, '/n', KEPT)
    process = recorder_process()
    spin_until(lambda: publisher.get_subscription_count() == 1, 'the recorder')
    run = tmp_path / 'run'

    def on_disk() -> list[float]:
        file = run / 'run_0.mcap'
        found = read_run(file).messages('/n') if file.exists() else ()
        return [recorded.message.data for recorded in found]

    for k in range(10):
        publisher.publish(Float64(data=float(k)))
    spin_until(lambda: len(on_disk()) == 10, 'ten messages on disk')
    for k in range(10, 20):
        publisher.publish(Float64(data=float(k)))
    process.send_signal(signal.SIGKILL)
    process.wait()
    found = on_disk()
    assert found == [float(k) for k in range(len(found))]
    assert 10 <= len(found) <= 20
    losses = [finding.text for finding in verify(run).findings if finding.loss]
    assert losses[-1].startswith('The recorder did not finish')
