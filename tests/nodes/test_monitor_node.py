"""The node `chatter_monitor`, fed over DDS with samples of the real machine, at full speed."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import Log
from rclpy.qos import QoSProfile
from std_msgs.msg import Bool, Float64, Float64MultiArray, String
from support.node_bench import DEEP, LATCHED, Bench

from lathe_chatter.array_types import Array
from lathe_chatter.errors import ParameterError
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import BearingContact, Cut
from lathe_chatter.model.machine_file import load_machine, shipped_machines
from lathe_chatter.nodes.lathe_node import LatheNode
from lathe_chatter.nodes.monitor_node import MonitorNode
from lathe_chatter.nodes.recorder_parameters import RECORDED_TOPICS
from lathe_chatter.samples import SAMPLE_COLUMNS
from lathe_chatter.samples.codec import encode_block
from lathe_chatter.stability import rightmost_root

BLOCK = 200
BARE = '{workpiece: {modes: [{frequency: 120 Hz, damping_ratio: 3 %, mass: 20 kg}]}}'
"""A machine file without a bearing."""
SHOP = """\
tool: {modes: [{frequency: 140 Hz, damping_ratio: 4 %, mass: 1.2 kg}]}
workpiece: {modes: [{frequency: 95 Hz, damping_ratio: 3 %, mass: 8 kg}]}
material: {cutting_coefficient: 1200 MPa}
spindle: {slowest_speed: 200 rpm, fastest_speed: 3500 rpm}
"""
STABLE = Cut(bearing_contact=BearingContact.NONE)
UNSTABLE = Cut(depth_of_cut=0.001, bearing_contact=BearingContact.NONE)
FIGURES = ('growth_rate', 'frequency', 'amplitude', 'recommended_speed_rpm')


class Machine:
    """A lathe of the core whose samples a publisher brings to the monitor."""

    def __init__(self, bench: Bench, cut: Cut) -> None:
        self.lathe = VirtualLathe(cut=cut)
        self._bench = bench
        self._publisher = bench.talk(Float64MultiArray, '/lathe/samples')

    def send(self, samples: Array) -> None:
        for k in range(0, len(samples), BLOCK):
            self._publisher.publish(encode_block(samples[k : k + BLOCK]))
            self._bench.executor.spin_once(timeout_sec=0.01)

    def cut_at_once(self, seconds: float) -> None:
        self._publisher.publish(encode_block(self.lathe.advance(round(seconds * 1e4))))

    def cut(self, seconds: float) -> None:
        self.send(self.lathe.advance(round(seconds * 1e4)))


@pytest.fixture
def machine(start: Callable[..., Any], bench: Bench) -> Callable[[Cut], Machine]:
    start(MonitorNode, model='parameters')
    return lambda cut: Machine(bench, cut)


def test_a_lathe_whose_blocks_come_seldom_is_not_said_to_send_nothing(
    machine: Callable[[Cut], Machine], bench: Bench
) -> None:
    """At half of real time and a tick a second."""
    log = bench.listen(Log, '/rosout', LATCHED)
    states = bench.listen(String, '/chatter_monitor/state', LATCHED)
    lathe = machine(STABLE)

    def missed() -> int:
        return sum('no samples come any more' in each.msg for each in log)

    def wait(seconds: float) -> None:
        until = time.monotonic() + seconds
        bench.spin_until(lambda: time.monotonic() > until, 'time to pass')

    for _ in range(3):  # before the third nobody knows how often they come
        lathe.cut_at_once(1.0)
        wait(2.0)
    before, known = missed(), len(states)
    for _ in range(3):
        lathe.cut_at_once(1.0)
        wait(2.0)
    assert missed() == before
    assert 'unknown' not in [each.data for each in states[known:]]
    bench.spin_until(lambda: missed() == before + 1, 'a silence that is one')


def test_chatter_is_flagged_with_its_figures_and_cured(
    machine: Callable[[Cut], Machine], bench: Bench
) -> None:
    flags = bench.listen(Bool, '/chatter_monitor/chatter', LATCHED)
    states = bench.listen(String, '/chatter_monitor/state', LATCHED)
    figures = {name: bench.listen(Float64, f'/chatter_monitor/{name}') for name in FIGURES}
    log = bench.listen(Log, '/rosout', LATCHED)
    lathe = machine(STABLE)
    lathe.cut(2.0)
    bench.spin_until(lambda: flags, 'the flag as the monitor began')
    assert [flag.data for flag in flags] == [False]
    lathe.lathe.retune(UNSTABLE)
    lathe.cut(2.0)
    bench.spin_until(lambda: [flag.data for flag in flags] == [False, True], 'the flag')
    bench.spin_until(lambda: any('chatter at' in entry.msg for entry in log), 'the sentence')
    assert states[-1].data == 'chatter'
    # The rightmost root of this cut is 13.652715 +- 847.585268 i.
    assert figures['frequency'][-1].data == pytest.approx(847.585268 / (2.0 * np.pi), rel=0.03)
    assert figures['amplitude'][-1].data > 0.0
    assert all(np.isfinite(m.data) for messages in figures.values() for m in messages)
    lathe.lathe.retune(Cut(depth_of_cut=0.0002, bearing_contact=BearingContact.NONE))
    lathe.cut(4.0)
    bench.spin_until(lambda: [flag.data for flag in flags] == [False, True, False], 'the cure')
    bench.spin_until(lambda: any('died out' in entry.msg for entry in log), 'the other sentence')


def test_after_a_speed_that_is_no_cure_another_is_recommended(
    machine: Callable[[Cut], Machine], bench: Bench
) -> None:
    log = bench.listen(Log, '/rosout', LATCHED)

    def told() -> list[float]:
        return [float(entry.msg.split(' s:')[0][3:]) for entry in log if ' try ' in entry.msg]

    lathe = machine(STABLE)
    lathe.cut(1.0)
    lathe.lathe.retune(UNSTABLE)
    lathe.cut(1.5)
    bench.spin_until(told, 'a recommendation')
    # At 4300 rev/min the first speed would still be the best one.
    lathe.lathe.retune(UNSTABLE.with_changes(spindle_speed_rpm=5000.0))  # its root: +13.0 1/s
    lathe.cut(1.5)
    bench.spin_until(lambda: told()[-1] > 2.5, 'another one')


def test_a_cut_made_deeper_amid_chatter_has_advice_for_its_depth(
    start: Callable[..., Any], bench: Bench
) -> None:
    depth, deeper = 0.0008, 0.002  # where no speed of the first lobe is stable

    def suits(message: Float64, depth: float) -> bool:
        return rightmost_root(VirtualLathe().machine, message.data, depth, seated=False).real < 0.0

    start(LatheNode, depth_of_cut=depth, bearing_contact='none', force_noise=4.5e-4)
    start(MonitorNode, model='lathe', fastest_speed=12_000.0)
    speeds = bench.listen(Float64, '/chatter_monitor/recommended_speed_rpm')
    bench.spin_until(lambda: len(speeds) > 20, 'advice')
    assert suits(speeds[-1], depth)
    assert not suits(speeds[-1], deeper)
    assert bench.set('/lathe', depth_of_cut=deeper)[0].successful
    bench.spin_until(lambda: suits(speeds[-1], deeper), 'other advice')
    speeds.clear()
    bench.spin_until(lambda: len(speeds) > 20, 'more of it')
    assert all(suits(speed, deeper) for speed in speeds)


def test_of_chatter_that_was_there_before_advice_is_for_the_depth_of_the_lathe(
    start: Callable[..., Any], bench: Bench, tmp_path: Path
) -> None:
    file = tmp_path / 'shop.yaml'
    file.write_text(SHOP)
    shop = load_machine(file).machine
    cut = {'spindle_speed_rpm': 1200.0, 'depth_of_cut': 1.2e-4, 'feed_per_revolution': 1e-4}
    start(LatheNode, machine=str(file), force_noise=0.05, tick_rate=100.0, **cut)
    blocks = bench.listen(Float64MultiArray, '/lathe/samples')
    bench.spin_until(lambda: len(blocks) > 500, 'grown chatter')
    start(MonitorNode, machine=str(file))
    speeds = bench.listen(Float64, '/chatter_monitor/recommended_speed_rpm')

    def suits() -> bool:
        """For the force that is heard it would be some 2100 rev/min, where this is -1.8 1/s."""
        rpm = speeds[-1].data if speeds else 2100.0
        return rightmost_root(shop, rpm, 1.2e-4, seated=False).real < -5.0

    bench.spin_until(suits, 'advice for the depth')


def test_no_rule_of_thumb_is_said_of_a_lathe_that_tells_its_machine(
    start: Callable[..., Any], bench: Bench
) -> None:
    """Also not in the moment in which it has told it, amid chatter."""
    log = bench.listen_first(Log, '/rosout', LATCHED)
    start(MonitorNode, model='lathe')
    start(LatheNode, depth_of_cut=0.0014, bearing_contact='none', force_noise=1e-3)
    bench.spin_until(lambda: any(' try ' in entry.msg for entry in log), 'advice')
    assert not any('rule of thumb' in entry.msg for entry in log)
    told = [' machine it is' in entry.msg for entry in log].index(True)
    assert any(' chatter ' in entry.msg for entry in log[:told])


def test_a_late_joiner_gets_the_flag_and_the_state(
    machine: Callable[[Cut], Machine], bench: Bench
) -> None:
    lathe = machine(UNSTABLE)
    lathe.cut(2.0)
    flags = bench.listen(Bool, '/chatter_monitor/chatter', LATCHED)
    states = bench.listen(String, '/chatter_monitor/state', LATCHED)
    bench.spin_until(lambda: flags and states, 'what is latched')
    assert [flag.data for flag in flags] == [True]
    assert states[0].data == 'chatter'


def test_lost_samples_are_counted_and_told(
    machine: Callable[[Cut], Machine], bench: Bench
) -> None:
    log = bench.listen(Log, '/rosout', LATCHED)
    diagnostics = bench.listen(DiagnosticArray, '/diagnostics')
    lathe = machine(STABLE)
    lathe.cut(0.1)
    lathe.lathe.advance(500)
    lathe.cut(0.1)
    sentence = 'At 0.100000 s: the samples up to 0.150100 s did not come.'
    bench.spin_until(lambda: sentence in [entry.msg for entry in log], 'the sentence')

    def counted() -> str:
        return value(diagnostics, 'samples', 'samples lost')

    bench.spin_until(lambda: counted() == '500', 'the count')


def test_a_lathe_that_starts_again_is_followed(
    machine: Callable[[Cut], Machine], bench: Bench
) -> None:
    log = bench.listen(Log, '/rosout', LATCHED)
    flags = bench.listen(Bool, '/chatter_monitor/chatter', LATCHED)
    machine(UNSTABLE).cut(2.0)
    bench.spin_until(lambda: flags[-1].data, 'the flag')
    machine(STABLE).cut(1.0)
    bench.spin_until(lambda: any('started again' in entry.msg for entry in log), 'the sentence')
    bench.spin_until(lambda: not flags[-1].data, 'the end of the flag')


def test_another_lathe_is_no_gap_although_its_time_is_later(
    machine: Callable[[Cut], Machine], bench: Bench
) -> None:
    log = bench.listen(Log, '/rosout', LATCHED)
    diagnostics = bench.listen(DiagnosticArray, '/diagnostics')
    machine(STABLE).cut(0.1)
    other = machine(STABLE)
    other.lathe.advance(5000)  # before it is found
    other.cut(0.1)
    sentence = 'At 0.100000 s: the lathe started again, and I with it from 0.500100 s on.'
    bench.spin_until(lambda: sentence in [entry.msg for entry in log], 'the sentence')
    bench.spin_until(
        lambda: value(diagnostics, 'samples', 'restarts of the lathe') == '1', 'the count'
    )
    assert value(diagnostics, 'samples', 'samples lost') == '0'


def test_columns_are_found_by_name(start: Callable[..., Any], bench: Bench) -> None:
    start(MonitorNode, model='parameters')
    flags = bench.listen(Bool, '/chatter_monitor/chatter', LATCHED)
    publisher = bench.talk(Float64MultiArray, '/lathe/samples')
    samples = VirtualLathe(cut=UNSTABLE).advance(20_000)
    order = [5, 4, 3, 2, 0, 1]
    names = (
        'workpiece_velocity',
        'workpiece_displacement',
        'tool_velocity',
        'tool_displacement',
        'time',
        'spindle_angle',
    )
    for k in range(0, len(samples), BLOCK):
        publisher.publish(encode_block(samples[k : k + BLOCK, order], names))
        bench.executor.spin_once(timeout_sec=0.01)
    bench.spin_until(lambda: flags and flags[-1].data, 'the flag')


def test_a_dead_sensor_is_done_without(start: Callable[..., Any], bench: Bench) -> None:
    start(MonitorNode, model='parameters')
    flags = bench.listen(Bool, '/chatter_monitor/chatter', LATCHED)
    publisher = bench.talk(Float64MultiArray, '/lathe/samples')
    samples = VirtualLathe(cut=UNSTABLE).advance(20_000)
    samples[:, SAMPLE_COLUMNS.index('workpiece_displacement')] = np.nan
    for k in range(0, len(samples), BLOCK):
        publisher.publish(encode_block(samples[k : k + BLOCK]))
        bench.executor.spin_once(timeout_sec=0.01)
    bench.spin_until(lambda: flags and flags[-1].data, 'the flag')


@pytest.mark.parametrize(
    ('message', 'complaint'),
    [
        (Float64MultiArray(), 'A block of samples has 2 dimensions, not 0.'),
        (
            encode_block(np.zeros((3, 2)), ('tool_displacement', 'tool_velocity')),
            'The samples have no column time, only tool_displacement, tool_velocity.',
        ),
        (
            encode_block(np.full((3, 8), np.nan)),
            'The times of the samples are not finite, or do not increase.',
        ),
    ],
    ids=['layout', 'columns', 'nan'],
)
def test_what_are_no_samples_is_told_and_survived(
    machine: Callable[[Cut], Machine], bench: Bench, message: Float64MultiArray, complaint: str
) -> None:
    diagnostics = bench.listen(DiagnosticArray, '/diagnostics')
    publisher = bench.talk(Float64MultiArray, '/lathe/samples')
    publisher.publish(message)
    bench.spin_until(lambda: complaint in messages_of_level(diagnostics), complaint)
    machine(STABLE).cut(0.1)
    bench.spin_until(
        lambda: value(diagnostics, 'samples', 'samples') == '1000', 'the samples after it'
    )


def test_silence_makes_the_state_unknown_and_keeps_the_flag(
    machine: Callable[[Cut], Machine], bench: Bench
) -> None:
    flags = bench.listen(Bool, '/chatter_monitor/chatter', LATCHED)
    states = bench.listen(String, '/chatter_monitor/state', LATCHED)
    diagnostics = bench.listen(DiagnosticArray, '/diagnostics')
    there = machine(UNSTABLE)
    there.cut(2.0)
    bench.spin_until(lambda: states[-1].data == 'chatter', 'chatter')
    bench.spin_until(lambda: cut_status(diagnostics).level == DiagnosticStatus.ERROR, 'the error')
    bench.spin_until(lambda: states[-1].data == 'unknown', 'silence noticed')
    assert flags[-1].data
    bench.spin_until(lambda: cut_status(diagnostics).message == 'unknown', 'its report')
    silent = cut_status(diagnostics)
    assert silent.level == DiagnosticStatus.WARN
    # No figure of before, as a recommended speed.
    assert {entry.key: entry.value for entry in silent.values} == {
        'state': 'unknown',
        'flag': 'True',
        'flag since, s': value(diagnostics, 'cut', 'flag since, s'),
    }
    there.cut(0.5)
    bench.spin_until(lambda: cut_status(diagnostics).level == DiagnosticStatus.ERROR, 'chatter')


def cut_status(messages: list[DiagnosticArray]) -> DiagnosticStatus:
    """The newest of the cut; an empty one before."""
    found = [s for m in messages for s in m.status if s.name == '/chatter_monitor: cut']
    return found[-1] if found else DiagnosticStatus()


def value(messages: list[DiagnosticArray], part: str, key: str) -> str:
    """The newest value in the diagnostics."""
    found = [
        entry.value
        for message in messages
        for status in message.status
        for entry in status.values
        if status.name == f'/chatter_monitor: {part}' and entry.key == key
    ]
    return str(found[-1]) if found else ''


def messages_of_level(
    messages: list[DiagnosticArray], level: bytes = DiagnosticStatus.ERROR
) -> list[str]:
    return [s.message for m in messages for s in m.status if s.level == level]


def test_the_machine_is_asked_from_the_lathe(start: Callable[..., Any], bench: Bench) -> None:
    """With model:=lathe the monitor knows the machine once the lathe has told it."""
    other = 0.5 * VirtualLathe().machine.workpiece.mass
    start(LatheNode, **{'workpiece.mass': other})
    monitor = start(MonitorNode, model='lathe')
    bench.spin_until(lambda: monitor.machine is not None, 'the answer of the lathe')
    assert monitor.machine.workpiece.mass == other


@pytest.mark.parametrize('file', sorted(shipped_machines()))
def test_the_machine_of_a_file_is_asked_from_the_lathe(
    file: str, start: Callable[..., Any], bench: Bench
) -> None:
    """Also where it has several modes, so that the lathe lacks the parameters of single ones."""
    start(LatheNode, machine=file)
    monitor = start(MonitorNode, model='lathe')
    bench.spin_until(lambda: monitor.machine is not None, 'the answer of the lathe')
    told, meant = monitor.machine, load_machine(file).machine
    assert (told.tool, told.workpiece) == (meant.tool, meant.workpiece)


def test_a_bearing_is_assumed_only_while_the_lathe_has_one(
    start: Callable[..., Any], bench: Bench
) -> None:
    monitor = start(MonitorNode)
    start(LatheNode, machine=BARE)

    def stiffness() -> float:
        return monitor.machine.bearing_stiffness if monitor.machine is not None else math.nan

    bench.spin_until(lambda: stiffness() == 0.0, 'a machine without a bearing')
    assert bench.set_together('/lathe', bearing_contact='gap').successful
    bench.spin_until(lambda: stiffness() > 0.0, 'the bearing of a cut that has one')


@pytest.mark.parametrize(
    ('given', 'source'),
    [
        ({}, 'lathe'),
        ({'tool.mass': 0.06}, 'parameters'),
        ({'machine': 'boring_bar'}, 'parameters'),
        ({'tool.mass': 0.06, 'model': 'lathe'}, 'lathe'),
        ({'model': 'none'}, 'none'),
    ],
)
def test_the_machine_comes_from_where_it_is_known(
    start: Callable[..., Any], given: dict[str, Any], source: str
) -> None:
    """By default from its own parameters where any is given, else from the lathe."""
    monitor = start(MonitorNode, **given)
    assert monitor.values['model'] == source
    assert (monitor.machine is not None) == (source == 'parameters')


def test_without_a_model_chatter_is_flagged_all_the_same(
    start: Callable[..., Any], bench: Bench
) -> None:
    """With model:=none the state says so in the diagnostics."""
    start(MonitorNode, model='none')
    flags = bench.listen(Bool, '/chatter_monitor/chatter', LATCHED)
    reports = bench.listen(DiagnosticArray, '/diagnostics')
    bench.spin_until(lambda: flags, 'the flag as the monitor began')
    lathe = Machine(bench, STABLE)
    lathe.cut(3.0)
    lathe.lathe.retune(UNSTABLE)
    lathe.cut(3.0)
    bench.spin_until(lambda: [flag.data for flag in flags] == [False, True], 'the flag')
    said = 'the machine is not known'
    bench.spin_until(
        lambda: any(
            value.value == said
            for report in reports
            for status in report.status
            for value in status.values
        ),
        'the mode',
    )


def test_no_flag_waits_until_a_speed_has_been_found(
    machine: Callable[[Cut], Machine], bench: Bench
) -> None:
    """Sent are the figures that explain the flag, the flag, and then the speed."""
    sent: dict[str, list[tuple[int, Any]]] = {}

    def listen(kind: Any, name: str, qos: QoSProfile) -> None:
        def take(message: Any, info: dict[str, int]) -> None:
            sent.setdefault(name, []).append((info['source_timestamp'], message.data))

        bench.node.create_subscription(kind, f'/chatter_monitor/{name}', take, qos)

    lathe = machine(STABLE)
    listen(Bool, 'chatter', LATCHED)
    for name in ('growth_rate', 'recommended_speed_rpm'):
        listen(Float64, name, DEEP)
    lathe.cut(3.0)
    lathe.lathe.retune(UNSTABLE)
    lathe.cut(3.0)
    bench.spin_until(lambda: 'recommended_speed_rpm' in sent, 'a speed')
    flagged = next(stamp for stamp, up in sent['chatter'] if up)
    assert flagged < sent['recommended_speed_rpm'][0][0]
    assert sent['growth_rate'][0][0] < flagged


def test_the_recorder_keeps_all_that_the_monitor_says(start: Callable[..., Any]) -> None:
    """Every topic of its own, as the graph knows them."""
    node = start(MonitorNode, model='parameters')
    topics = node.get_publisher_names_and_types_by_node('chatter_monitor', node.get_namespace())
    own = {name.lstrip('/') for name, _types in topics if 'chatter_monitor/' in name}
    assert 'chatter_monitor/chatter' in own
    assert own <= set(RECORDED_TOPICS)


@pytest.mark.parametrize(
    ('override', 'words'),
    [
        ({'model': 'guess'}, 'one of auto, parameters, lathe, none'),
        ({'slowest_speed': 5e3, 'fastest_speed': 4e3}, 'slowest'),
    ],
)
def test_a_wrong_parameter_is_refused_with_a_sentence(
    start: Callable[..., Any], override: dict[str, Any], words: str
) -> None:
    """What is allowed is named."""
    with pytest.raises(ParameterError, match=words):
        start(MonitorNode, **override)
