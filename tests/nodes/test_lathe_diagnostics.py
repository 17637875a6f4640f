from __future__ import annotations

import time

import pytest

from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import Cut as ModelCut
from lathe_chatter.nodes.lathe_diagnostics import Durations, TickStatistics
from lathe_chatter.nodes.real_time_loop import SECOND, Pacer, RequestLoad
from lathe_chatter.nodes.simulation_control import RunControl

TICK = 2_000_000


def test_quantiles_are_those_of_the_latest() -> None:
    durations = Durations()
    assert durations.quantiles(0.5, 1.0) == (0.0, 0.0)
    for value in range(10_000):
        durations.add(value)
    assert durations.quantiles(0.0, 1.0) == (10_000 - 4096, 9999)
    durations.clear()
    durations.add(3.0)
    assert durations.quantiles(0.5) == (3.0,)


class Cut:
    """Statistics of a lathe at the beginning of a second."""

    def __init__(self, lathe: VirtualLathe) -> None:
        self.lathe, self.control, self.pacer = lathe, RunControl(), Pacer(TICK)
        self.requests = RequestLoad()
        self.statistics = TickStatistics(self.pacer, TICK, self.requests)

    def tick(self) -> None:
        self.lathe.advance(20)
        self.statistics.note_tick(0, self.lathe)

    @property
    def cutting(self) -> str:
        return self.statistics.cutting(self.control, self.lathe).message

    def pace(self, asked: float = 1.0, late: float = 0.0, clock: str = '') -> str:
        status = self.statistics.pace(
            self.control, asked=asked, late=late, clock=clock, scheduling=''
        )
        assert status.values['state'] == self.control.state.value
        return status.message


def test_the_verdict_on_the_pace_says_what_is_wrong_first() -> None:
    cut = Cut(VirtualLathe())
    assert cut.pace() == 'keeping up'
    assert cut.pace(asked=0.0) == 'as fast as possible'
    assert cut.pace(late=0.5) == 'catching up'
    assert cut.pace(clock='/clock stands still', late=0.5) == '/clock stands still'
    cut.control.pause(pause=True)
    assert cut.pace() == 'paused'
    assert cut.pace(late=0.5) == 'paused'
    cut.requests.taken = 10**12
    assert cut.pace() == 'paused'  # as of a reset, which takes long by itself
    cut.pacer.start(0)
    cut.pacer.due(100 * TICK)
    assert cut.pace(late=0.5) == 'behind: simulated time was given up'
    cut.statistics.begin_second()
    cut.requests.taken = 10**13
    cut.pacer.due(200 * TICK)
    assert cut.pace() == 'flooded: requests take much of the time'
    cut.statistics.begin_second()
    assert cut.pace() == 'paused'


def test_the_factor_reached_is_known_between_ticks_that_are_seldom(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = [0]
    monkeypatch.setattr(time, 'monotonic_ns', lambda: now[0])
    cut = Cut(VirtualLathe())
    cut.pacer.change(0.001, 0)  # a tick of 2 ms in 2 s
    reached = []
    for second in range(1, 9):
        now[0] = second * SECOND
        if second % 2 == 0:
            cut.tick()
        status = cut.statistics.pace(cut.control, asked=0.001, late=0.0, clock='', scheduling='')
        reached.append(status.values['real-time factor'])
        cut.statistics.begin_second()
    assert reached[1:] == pytest.approx([0.001, *[0.001] * 6], rel=1e-6)
    cut.control.pause(pause=True)
    for second in range(9, 12):
        now[0] = second * SECOND
        status = cut.statistics.pace(cut.control, asked=0.001, late=0.0, clock='', scheduling='')
        cut.statistics.begin_second()
    assert status.values['real-time factor'] == 0.0


def test_the_speed_is_the_one_that_the_spindle_turns_with() -> None:
    cut = Cut(VirtualLathe(spindle_acceleration=1000.0))
    for _ in range(2):
        cut.tick()
    cut.lathe.retune(cut.lathe.cut.with_changes(spindle_speed_rpm=5000.0))
    for _ in range(100):  # 0.2 s
        cut.tick()
    values = cut.statistics.cutting(cut.control, cut.lathe).values
    assert values['spindle speed, rev/min'] == pytest.approx(3199.0, abs=0.2)
    assert values['spindle speed asked for, rev/min'] == 5000.0
    cut.lathe = VirtualLathe()  # a reset
    cut.tick()
    values = cut.statistics.cutting(cut.control, cut.lathe).values
    assert values['spindle speed, rev/min'] == 3000.0


def test_the_status_of_the_cut_claims_no_more_than_the_ticks_showed() -> None:
    cut = Cut(VirtualLathe())
    assert cut.cutting == 'at rest'
    cut.tick()
    assert cut.cutting == 'cutting'
    cut.statistics.begin_second()
    assert cut.cutting == 'at rest'
    cut.pacer.change(0.002, 0)  # a tick a second
    assert cut.cutting == 'cutting'
    cut.control.pause(pause=True)
    assert cut.cutting == 'at rest'
    out = Cut(VirtualLathe(cut=ModelCut(feed_speed=0.0)))
    out.lathe.knock(-1.0)  # away from the workpiece
    out.tick()
    assert out.cutting == ('cutting' if out.lathe.tool_in_cut else 'out of the cut')
    assert not out.lathe.tool_in_cut
    none = Cut(VirtualLathe(cut=ModelCut(depth_of_cut=0.0)))
    none.tick()
    assert none.cutting == 'no depth of cut'
