"""The table of the monitor's sentences: each is brought about, and nothing else is said."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from rcl_interfaces.msg import Log
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import Bool, Float64MultiArray, String
from support.node_bench import LATCHED, Bench

from lathe_chatter.array_types import Array
from lathe_chatter.detection import ChatterDetector, Estimate
from lathe_chatter.detection.estimate import STATES, Mode
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import BearingContact, Cut
from lathe_chatter.model.lathe_parameter_table import machine_in_cut
from lathe_chatter.nodes.lathe_node import LatheNode
from lathe_chatter.nodes.monitor_node import MonitorNode
from lathe_chatter.nodes.monitor_sentences import SENTENCES, clearance, details, onset
from lathe_chatter.report.monitor_record import DECIDED
from lathe_chatter.samples import SAMPLE_COLUMNS
from lathe_chatter.samples.codec import encode_block

BLOCK = 200
COUNT = r'( \(\d+ of this kind in \d+ s\.\))?'
TOOL = SAMPLE_COLUMNS.index('tool_displacement')
SEVERITIES = {'info': b'\x14', 'warning': b'\x1e', 'error': b'('}
OPEN = {'bearing_contact': BearingContact.NONE}


class Shop:
    """The monitor, what it logs, and publishers of samples beside it."""

    def __init__(self, bench: Bench, start: Callable[..., Any]) -> None:
        self.bench, self.start = bench, start
        self.log: list[Log] = bench.listen_first(Log, '/rosout', LATCHED)

    def monitor(self, **parameters: Any) -> MonitorNode:
        node: MonitorNode = self.start(MonitorNode, **{'model': 'parameters', **parameters})
        self.flags = self.bench.listen(Bool, '/chatter_monitor/chatter', LATCHED)
        self.bench.spin_until(lambda: self.flags, 'the flag as the monitor began')
        return node

    def said(self) -> list[Log]:
        """What the monitor does; that the first start compiles may come before."""
        own = [entry for entry in self.log if entry.name == 'chatter_monitor']
        return [entry for entry in own if not entry.msg.startswith('Compiling the inner loops')]

    def says(self, kind: str) -> None:
        """Wait until a sentence of this kind was logged."""
        pattern = re.compile(SENTENCES[kind].pattern + COUNT)
        self.bench.spin_until(
            lambda: any(pattern.fullmatch(entry.msg) for entry in self.said()), kind
        )

    def send(self, publisher: Any, samples: Array) -> None:
        for k in range(0, len(samples), BLOCK):
            publisher.publish(encode_block(samples[k : k + BLOCK]))
            self.bench.executor.spin_once(timeout_sec=0.01)


def chatters(seconds: float = 2.0) -> Array:
    lathe = VirtualLathe(cut=Cut(depth_of_cut=1e-3, **OPEN))
    return lathe.advance(round(seconds * 1e4))


def flagged(shop: Shop) -> Any:
    shop.monitor()
    publisher = shop.bench.talk(Float64MultiArray, '/lathe/samples')
    shop.send(publisher, chatters())
    shop.bench.spin_until(lambda: shop.flags[-1].data, 'the flag')
    return publisher


def shifted(samples: Array, seconds: float) -> Array:
    moved = samples.copy()
    moved[:, 0] += seconds
    return moved


def listening(shop: Shop) -> None:
    shop.monitor()
    shop.send(shop.bench.talk(Float64MultiArray, '/lathe/samples'), chatters(1.0))


def standstill(shop: Shop) -> None:
    listening(shop)
    shop.says('listening')
    time.sleep(1.0)  # its executor is this thread


def resumed(shop: Shop) -> None:
    publisher = flagged(shop)
    shop.says('silence')
    shop.send(publisher, shifted(chatters(0.1), 2.0))


def lost(shop: Shop) -> None:
    shop.monitor()
    samples = chatters(0.5)
    samples = np.delete(samples, np.s_[1000:1500], axis=0)
    shop.send(shop.bench.talk(Float64MultiArray, '/lathe/samples'), samples)


def restart_while_flagged(shop: Shop) -> None:
    shop.send(flagged(shop), VirtualLathe(cut=Cut(**OPEN)).advance(2000))
    shop.bench.spin_until(lambda: not shop.flags[-1].data, 'the end of the flag')
    assert not any('died out' in entry.msg for entry in shop.said())


def jump(shop: Shop) -> None:
    node = shop.monitor()
    samples = chatters(0.4)
    samples[2000:, 0] += 1.7e9
    shop.send(shop.bench.talk(Float64MultiArray, '/lathe/samples'), samples)
    shop.says('jump')
    assert node._continuity.lost == 0


def dead_sensor(shop: Shop) -> None:
    publisher = flagged(shop)
    samples = shifted(chatters(2.0), 2.0)
    samples[:5000, TOOL] = np.nan
    shop.send(publisher, samples)
    shop.says('sensors')
    shop.says('sensors well')
    assert not any('died out' in entry.msg for entry in shop.said())
    assert [flag.data for flag in shop.flags] == [False, True]


def no_cure(shop: Shop) -> None:
    shop.monitor()
    lathe = VirtualLathe(cut=Cut(depth_of_cut=1e-3, **OPEN))
    publisher = shop.bench.talk(Float64MultiArray, '/lathe/samples')
    shop.send(publisher, lathe.advance(15_000))
    lathe.retune(lathe.cut.with_changes(spindle_speed_rpm=4300.0))  # its root: +14.3 1/s
    shop.send(publisher, lathe.advance(15_000))


def cured(shop: Shop) -> None:
    shop.monitor()
    lathe = VirtualLathe(cut=Cut(depth_of_cut=1e-3, **OPEN))
    publisher = shop.bench.talk(Float64MultiArray, '/lathe/samples')
    shop.send(publisher, lathe.advance(20_000))
    lathe.retune(Cut(depth_of_cut=2e-4, **OPEN))
    shop.send(publisher, lathe.advance(40_000))


def two_publishers(shop: Shop) -> None:
    node = shop.monitor()
    others = [shop.bench.another(f'lathe_{k}') for k in 'ab']
    talkers = [n.create_publisher(Float64MultiArray, '/lathe/samples', 100) for n in others]
    for talker in talkers:
        shop.bench.spin_until(talker.get_subscription_count, 'the monitor')
    expected = ['/lathe_a', '/lathe_b']
    shop.bench.spin_until(lambda: node._subscription.publishers() == expected, 'their names')
    samples = [chatters(1.0), shifted(chatters(1.0), 500.0)]
    for k in range(0, 10_000, BLOCK):
        for talker, each in zip(talkers, samples, strict=True):
            talker.publish(encode_block(each[k : k + BLOCK]))
        shop.bench.executor.spin_once(timeout_sec=0.01)
    shop.says('two publishers')
    (entry,) = [entry for entry in shop.said() if ' publish ' in entry.msg]
    assert entry.msg.startswith('/lathe_a and /lathe_b publish /lathe/samples,')
    assert node._continuity.lost == 0
    assert len(shop.said()) < 10
    shop.bench.let_go(others[1])
    shop.bench.spin_until(lambda: len(node._subscription.publishers()) == 1, 'one publisher')
    shop.send(talkers[0], shifted(samples[0], 1.0))
    shop.bench.spin_until(lambda: not node._senders, 'the end of the mixture')
    shop.bench.let_go(others[0])


def best_effort(shop: Shop) -> None:
    node = shop.monitor()
    qos = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
    talker = shop.bench.node.create_publisher(Float64MultiArray, '/lathe/samples', qos)
    shop.bench.spin_until(talker.get_subscription_count, 'a subscription that fits')
    shop.send(talker, chatters(0.2))
    shop.bench.spin_until(lambda: node._continuity.samples > 0, 'samples')
    shop.says('best effort')
    assert any(entry.msg.startswith('A publisher of /lathe/samples') for entry in shop.said())


def asks_the_lathe(shop: Shop) -> None:
    shop.start(LatheNode, **{'workpiece.mass': 0.04})
    shop.monitor(model='lathe')


def floods(shop: Shop) -> None:
    shop.monitor()
    samples = chatters(1.2)
    publisher = shop.bench.talk(Float64MultiArray, '/lathe/samples')
    for k in range(0, len(samples), 2 * BLOCK):
        publisher.publish(encode_block(samples[k : k + BLOCK]))
    shop.bench.spin_until(lambda: any(' of this kind in' in e.msg for e in shop.said()), 'a count')
    assert len(shop.said()) <= 10


def told_wrong(shop: Shop) -> None:
    shop.monitor(**{'tool.natural_frequency': 700.0})
    noises = {'force_noise': 4.5e-4, 'sensor_noise': 1e-7}
    lathe = VirtualLathe(cut=Cut(depth_of_cut=3e-4, **OPEN, **noises))
    publisher = shop.bench.talk(Float64MultiArray, '/lathe/samples')
    for _ in range(20):
        shop.send(publisher, lathe.advance(10_000))


def told_right_later(shop: Shop) -> None:
    node = shop.monitor()
    node._publish(
        Estimate(
            1.0,
            mode=Mode.MISFIT,
            machine_fit='the tool, told at 1 Hz, is heard at 2 Hz: judged without a machine',
        )
    )
    node._publish(Estimate(2.0, mode=Mode.FULL))


STORIES: dict[str, Callable[[Shop], None]] = {
    'listening': listening,
    'lost': lost,
    'restart': restart_while_flagged,
    'withdrawn': restart_while_flagged,
    'jump': jump,
    'silence': listening,
    'standstill': standstill,
    'samples again': resumed,
    'two publishers': two_publishers,
    'best effort': best_effort,
    'machine': asks_the_lathe,
    'sensors': dead_sensor,
    'sensors well': dead_sensor,
    'onset': flagged,
    'advice': no_cure,
    'clearance': cured,
    'machine fit': told_wrong,
    'machine fits': told_right_later,
}


@pytest.mark.parametrize('story', dict.fromkeys(STORIES.values()) | {floods: None})
def test_each_sentence_is_said_when_it_is_true_and_no_other(
    story: Callable[[Shop], Any], bench: Bench, start: Callable[..., Any]
) -> None:
    shop = Shop(bench, start)
    story(shop)
    for kind in [kind for kind, each in STORIES.items() if each is story]:
        shop.says(kind)
    for entry in shop.said():
        kinds = [k for k, s in SENTENCES.items() if re.fullmatch(s.pattern + COUNT, entry.msg)]
        assert len(kinds) == 1, entry.msg
        assert bytes([entry.level]) == SEVERITIES[SENTENCES[kinds[0]].severity]


def test_every_sentence_has_a_story_and_says_when_it_is_true() -> None:
    assert STORIES.keys() == SENTENCES.keys()
    assert all(sentence.true_when for sentence in SENTENCES.values())


@pytest.mark.parametrize(
    ('growth', 'words'),
    [(4.0, 'growing at 4.0 1/s'), (1.0, 'growth rate 1.0 +- 1.5 1/s'),
     (-4.0, 'growth rate -4.0 +- 1.5 1/s')],
)  # fmt: skip
def test_only_what_surely_grows_is_said_to_grow(growth: float, words: str) -> None:
    estimate = Estimate(
        1.0, 'chatter', chatter=True, growth_rate=growth, growth_rate_error=1.5, amplitude=1e-6
    )
    assert onset(estimate) == f'At 1.000000 s: chatter {words}, amplitude 1 um.'


def test_a_report_reads_when_the_flag_was_decided() -> None:
    """The core knows these sentences without the nodes."""
    for said, up in ((onset(Estimate(1.25, 'chatter', chatter=True)), 'chatter'),
                     *((clearance(Estimate(1.25, state)), None) for state in STATES)):  # fmt: skip
        told = DECIDED.match(said)
        assert told is not None
        assert (told['time'], told['up']) == ('1.250000', up)


def test_that_chatter_is_over_reads_well_whatever_the_state() -> None:
    said = {state: clearance(Estimate(1.0, state)) for state in STATES}
    over = 'At 1.000000 s: the chatter has died out'
    assert said == {
        'stable': f'{over}; the cut is stable.',
        'watch': f'{over}; what is left is still watched.',
        'forced': f'{over}; what is left is the vibration of the spindle itself.',
        'idle': f'{over}; nothing is cut.',
        'unknown': f'{over}.',
        'chatter': f'{over}.',
    }
    assert all(re.fullmatch(SENTENCES['clearance'].pattern, each) for each in said.values())


def test_nothing_is_said_of_a_bearing_that_the_machine_has_not() -> None:
    file = (
        '{tool: {modes: [{frequency: 300 Hz, damping_ratio: 3 %, mass: 2 kg}]}, '
        'workpiece: {modes: [{frequency: 120 Hz, damping_ratio: 3 %, mass: 20 kg}]}, '
        'material: {cutting_coefficient: 1500 MPa}}'
    )
    cut = Cut(1200.0, 0.5e-3, force_noise=0.01, **OPEN)
    keys = {'bearing engaged', 'stiffness under the workpiece, N/m'}
    for contact in ('none', 'seated'):
        told = machine_in_cut({'machine': file, 'bearing_contact': contact})
        lathe = VirtualLathe(told, cut)
        detector = ChatterDetector(told)
        for _ in range(20):
            estimate = detector.update(lathe.advance(1000), SAMPLE_COLUMNS)
        assert estimate.mode is Mode.FULL
        assert math.isfinite(estimate.cutting_stiffness)
        assert keys & details(estimate).keys() == (set() if contact == 'none' else keys)


def test_a_space_after_the_comma_of_a_label_is_no_part_of_a_name(
    bench: Bench, start: Callable[..., Any]
) -> None:
    node = start(MonitorNode, model='parameters')
    publisher = bench.talk(Float64MultiArray, '/lathe/samples')
    names = [f' {name}' for name in SAMPLE_COLUMNS]
    publisher.publish(encode_block(chatters(0.1), names))
    bench.spin_until(lambda: node._continuity.samples == 1000, 'the samples')


def test_reports_that_follow_soon_know_of_no_silence(
    bench: Bench, start: Callable[..., Any]
) -> None:
    """As after a standstill of the monitor: a timer that is late fires again soon."""
    shop = Shop(bench, start)
    node = shop.monitor()
    shop.send(bench.talk(Float64MultiArray, '/lathe/samples'), chatters(0.5))
    bench.spin_until(lambda: node._continuity.samples == 5000, 'all samples')
    for _ in range(3):
        node._report()
    assert not node._silence
    (samples, _) = node._statuses()
    assert samples.message == 'all samples came'


def test_the_first_block_after_a_silence_ends_it_also_where_samples_are_missing(
    bench: Bench, start: Callable[..., Any]
) -> None:
    shop = Shop(bench, start)
    publisher = flagged(shop)
    shop.says('silence')
    shop.send(publisher, shifted(chatters(0.1)[:BLOCK], 2.5))
    shop.says('lost')
    shop.says('samples again')


def test_of_samples_that_cannot_be_read_nothing_is_known(
    bench: Bench, start: Callable[..., Any]
) -> None:
    shop = Shop(bench, start)
    publisher = flagged(shop)
    states = bench.listen(String, '/chatter_monitor/state', LATCHED)
    bench.spin_until(lambda: states and states[-1].data == 'chatter', 'what is known')
    without_time = encode_block(chatters(0.1)[:BLOCK, 1:], SAMPLE_COLUMNS[1:])

    def is_unknown() -> bool:
        publisher.publish(without_time)
        return bool(states[-1].data == 'unknown')

    bench.spin_until(is_unknown, 'that nothing is known')
    assert shop.flags[-1].data
