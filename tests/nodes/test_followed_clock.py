"""A lathe under another node's /clock: jumps, steps back and stops are told, and do no harm."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Log
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from support.node_bench import LATCHED, Bench

from lathe_chatter.nodes.lathe_node import LatheNode
from lathe_chatter.samples import SAMPLE_COLUMNS


def moment(milliseconds: int) -> Time:
    return Time(sec=milliseconds // 1000, nanosec=milliseconds % 1000 * 10**6)


class FollowedClock:
    """A /clock that a test drives, and a lathe that follows it."""

    def __init__(self, start: Callable[..., Any], bench: Bench, **values: Any) -> None:
        self._clock = bench.node.create_publisher(Clock, '/clock', 10)
        self.node: LatheNode = start(LatheNode, use_sim_time=True, **values)
        self.bench = bench
        self.joints = bench.listen(JointState, '/lathe/joint_states')
        self.diagnostics = bench.listen(DiagnosticArray, '/diagnostics')
        self.log = bench.listen(Log, '/rosout', LATCHED)
        bench.spin_until(self._clock.get_subscription_count, 'a follower')

    def show(self, *milliseconds: int) -> None:
        for time in map(moment, milliseconds):
            self._clock.publish(Clock(clock=time))
            shows = partial(self.shows, time)
            self.bench.spin_until(shows, 'the clock')

    def shows(self, time: Time) -> bool:
        return bool(self.node.get_clock().now().to_msg() == time)

    def cut_until(self, milliseconds: int) -> float:
        """Until the stamps are there: the time that was cut, s."""
        end = moment(milliseconds)
        self.bench.spin_until(
            lambda: self.joints and self.joints[-1].header.stamp == end, 'the last joint state'
        )
        self.bench.pause('/lathe')
        return float(self.bench.trigger('/lathe/step').message.split()[2]) - 0.002

    def said(self, words: str) -> list[str]:
        """What of the log has some words, once there is any."""
        found = lambda: [entry.msg for entry in self.log if words in entry.msg]  # noqa: E731
        self.bench.spin_until(found, words)
        return found()

    def pace(self, words: str) -> None:
        """Wait until the diagnostics say something of the pace."""
        self.bench.spin_until(
            lambda: words in [s.message for m in self.diagnostics[-2:] for s in m.status], words
        )


def test_under_anothers_clock_it_cuts_that_time_and_no_other(
    start: Callable[..., Any], bench: Bench
) -> None:
    clock = FollowedClock(start, bench)
    clock.show(*range(100_000, 100_080, 8), 102_016)  # at last a jump of many ticks
    assert round((2.016 - clock.cut_until(102_016)) * 1000) in range(0, 80, 8)


def test_a_jump_of_the_clock_is_told_and_not_cut(start: Callable[..., Any], bench: Bench) -> None:
    clock = FollowedClock(start, bench)
    clock.show(*range(100_000, 100_080, 8), 3_700_000, *range(3_700_002, 3_700_080, 2))
    (told,) = clock.said('ahead of the cut')
    assert re.match(
        r'/clock is 3599\.\d+ s ahead of the cut at 3700\.\d+ s, more than the 5 s', told
    )
    clock.pace('behind: simulated time was given up')
    assert clock.cut_until(3_700_078) < 0.2


def test_how_far_the_clock_is_caught_up_with_can_be_chosen(
    start: Callable[..., Any], bench: Bench
) -> None:
    clock = FollowedClock(start, bench, clock_catch_up=20.0)
    clock.show(*range(100_000, 100_080, 8), 112_000)
    assert clock.cut_until(112_000) == pytest.approx(12.0, abs=0.08)


def test_a_clock_that_goes_back_or_stands_still_is_told(
    start: Callable[..., Any], bench: Bench
) -> None:
    clock = FollowedClock(start, bench)
    clock.show(*range(100_000, 100_080, 2), 50_000, 50_002)
    assert clock.said('went back')[0].startswith('/clock went back to 50.00')
    assert clock.said('stands still') == ['/clock stands still at 50.002 s, and the cut with it.']
    clock.pace('/clock stands still')
    clock.show(50_004)
    clock.said('/clock goes on at 50.004 s.')
    clock.show(50_006)


def test_where_the_samples_are_on_the_clock_is_told_at_each_jump(
    start: Callable[..., Any], bench: Bench
) -> None:
    clock = FollowedClock(start, bench, force_noise=0.1)  # no two displacements are equal
    blocks = bench.listen(Float64MultiArray, '/lathe/samples')
    clock.show(*range(100_000, 100_080, 2), *range(50_000, 50_080, 2))
    clock.cut_until(50_078)
    clock.said('Time 0 of the samples is 100.0')
    clock.said('Time 0 of the samples is 49.')
    told = [float(each.split()[6]) for each in clock.said('Time 0 of the samples')]
    bench.spin_until(
        lambda: any(
            value.key == 'time 0 on /clock, s' and abs(float(value.value) - told[-1]) < 2e-6
            for status in clock.diagnostics[-1].status
            for value in status.values
        ),
        'the same in /diagnostics',
    )
    time, place = (SAMPLE_COLUMNS.index(name) for name in ('time', 'tool_displacement'))
    width = len(SAMPLE_COLUMNS)
    ends = {block.data[place - width]: block.data[time - width] for block in blocks}
    joints = [joint for joint in clock.joints if joint.position[0] in ends]
    assert len(joints) > 10
    for joint in joints:
        stamp = joint.header.stamp.sec + joint.header.stamp.nanosec / 1e9
        offset = stamp - ends[joint.position[0]]
        assert min(abs(offset - zero) for zero in told) < 2e-6


def test_without_a_clock_it_waits_and_says_so(start: Callable[..., Any], bench: Bench) -> None:
    clock = FollowedClock(start, bench)  # a publisher is there, and has shown nothing
    clock.pace('waiting for /clock')
    clock.said('/clock has shown no time yet: nothing is cut before.')
    assert not clock.joints


def test_a_pace_of_its_own_is_refused(start: Callable[..., Any], bench: Bench) -> None:
    clock = FollowedClock(start, bench)
    why = 'real_time_factor has no effect under use_sim_time: the pace is that of /clock.'
    assert bench.set('/lathe', real_time_factor=3.0)[0].reason == why
    assert clock.node.values['real_time_factor'] == 1.0
