"""What the recorder says of losses, silences and mixtures while it records: over real DDS."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import Log
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Float64MultiArray
from support.node_bench import LATCHED, Bench

from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.nodes.diagnostics import ERROR, OK, WARN
from lathe_chatter.nodes.recorder_node import RecorderNode
from lathe_chatter.recording import read_run, verify
from lathe_chatter.recording.run_summary import SUMMARY
from lathe_chatter.samples.codec import encode_block

KEPT = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
NOTE, WARNING, FAULT = 20, 30, 40
SAMPLES = '/lathe/samples'


class Shop:
    """A recorder, and what it says."""

    def __init__(self, bench: Bench, start: Callable[..., Any], folder: Path) -> None:
        self.bench, self.folder = bench, folder
        self.log: list[Log] = bench.listen_first(Log, '/rosout', LATCHED)
        self.told: list[DiagnosticArray] = bench.listen_first(DiagnosticArray, '/diagnostics')
        self._start = start

    def recorder(self, *topics: str) -> RecorderNode:
        node: RecorderNode = self._start(
            RecorderNode, output=str(self.folder), topics=list(topics)
        )
        return node

    def said(self, level: int) -> list[str]:
        """What the recorder has logged at a level."""
        entries = [entry for entry in self.log if entry.name == 'run_recorder']
        return [entry.msg for entry in entries if entry.level == level]

    @property
    def status(self) -> DiagnosticStatus:
        """The latest of the recorder; none of a level where there is none yet."""
        found = [each for told in self.told for each in told.status if 'recording' in each.name]
        return found[-1] if found else DiagnosticStatus(level=DiagnosticStatus.STALE)


@pytest.fixture
def shop(bench: Bench, start: Callable[..., Any], tmp_path: Path) -> Shop:
    return Shop(bench, start, tmp_path / 'run')


def test_two_lathes_on_one_topic_are_named_and_nothing_of_them_counts_as_lost(
    shop: Shop, spin_until: Any
) -> None:
    recorder = shop.recorder('lathe/samples')
    others = [shop.bench.another(f'lathe_{k}') for k in 'ab']
    talkers = [node.create_publisher(Float64MultiArray, SAMPLES, KEPT) for node in others]
    for talker in talkers:
        spin_until(talker.get_subscription_count, 'the recorder')
    lathes = [VirtualLathe(), VirtualLathe()]
    lathes[1].advance(10_000)
    for _ in range(300):
        for talker, lathe in zip(talkers, lathes, strict=True):
            talker.publish(encode_block(lathe.advance(20)))
        shop.bench.executor.spin_once(timeout_sec=0.01)
    spin_until(lambda: recorder.messages_of(SAMPLES) == 600, 'all of both')
    expected = (
        '/lathe_a and /lathe_b publish /lathe/samples, not one lathe: their samples are mixed, '
        'and whether any are missing is not known'
    )
    spin_until(lambda: expected in shop.status.message, 'the diagnostic')
    assert shop.status.level == ERROR
    assert 'missing;' not in shop.status.message
    recorder.stop()
    spin_until(lambda: shop.said(FAULT), 'the sentence')
    assert shop.said(FAULT) == [f'{expected}.']
    assert shop.said(WARNING) == []
    assert len(shop.said(NOTE)) < 5
    (note,) = [n for n in read_run(shop.folder).notes() if n.name == SUMMARY]
    counted = json.loads(note.values['samples'])[SAMPLES]
    assert (counted['lost'], counted['gaps'], counted['restarts']) == (0, 0, 0)
    assert counted['complaint'] == expected
    (finding,) = [each for each in verify(shop.folder).findings if each.loss]
    assert f'{SAMPLES}: samples of several publishers are mixed' in finding.text


def test_a_topic_that_was_asked_for_and_that_nobody_publishes_is_told(
    shop: Shop, spin_until: Any
) -> None:
    shop.recorder('lathe/samples', 'lathe/sampels', 'chatter_supervisor/action')
    spin_until(lambda: shop.said(WARNING), 'the warning')
    said = 'Nobody publishes /lathe/sampels so far: nothing of it is recorded.'
    assert shop.said(WARNING) == [said]
    spin_until(lambda: shop.status.level == WARN, 'the diagnostic')
    assert shop.status.message == 'recording; nobody publishes /lathe/sampels'
    publisher = shop.bench.talk(Float64MultiArray, '/lathe/sampels')
    spin_until(lambda: shop.status.level == OK, 'that somebody publishes it')
    assert shop.said(WARNING) == [said]
    shop.bench.node.destroy_publisher(publisher)


def test_a_silence_shows_while_it_lasts_and_a_loss_is_a_warning(
    shop: Shop, spin_until: Any
) -> None:
    recorder = shop.recorder('lathe/samples')
    publisher = shop.bench.talk(Float64MultiArray, SAMPLES)
    lathe = VirtualLathe()
    spin_until(lambda: shop.status.level == OK, 'a status')
    publisher.publish(encode_block(lathe.advance(20)))
    silent = f'recording; no samples of {SAMPLES} come'
    spin_until(lambda: shop.status.message == silent, 'the silence')
    assert shop.status.level == WARN
    recorder.pause(pause=True)
    spin_until(lambda: shop.status.level == OK, 'no silence in a pause')
    recorder.pause(pause=False)
    spin_until(lambda: shop.status.message == silent, 'the silence again')
    publisher.publish(encode_block(lathe.advance(20)))
    spin_until(lambda: shop.status.level == OK, 'the end of the silence')
    lathe.advance(40)
    publisher.publish(encode_block(lathe.advance(20)))
    spin_until(lambda: recorder.messages_of(SAMPLES) == 3, 'the blocks')
    recorder.stop()
    spin_until(lambda: shop.said(WARNING), 'the warning')
    said = f'{SAMPLES}: 40 samples between 0.004000 s and 0.008100 s did not come.'
    assert shop.said(WARNING) == [said]


def test_a_lathe_that_begins_again_without_end_is_a_few_lines(shop: Shop) -> None:
    shop.recorder(SAMPLES)
    publisher = shop.bench.talk(Float64MultiArray, SAMPLES)
    blocks = [encode_block(VirtualLathe().advance(20)) for _ in range(40)]
    for block in blocks:
        publisher.publish(block)
    # Told when the places are, and the rest of them when their time is over.
    shop.bench.spin_until(
        lambda: any(' of this kind in' in said for said in shop.said(NOTE)), 'it'
    )
    assert len([said for said in shop.said(NOTE) if 'after the lathe started' in said]) <= 7
