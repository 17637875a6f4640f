"""What is due when: the rules that the operator node and the simulation share."""

from __future__ import annotations

import math

from lathe_chatter.scenario import CLEARED, FLAGGED, RECOMMENDED, Scenario, Step
from lathe_chatter.scenario.player import ScenarioPlayer
from lathe_chatter.scenario.scenario import ASKED

DEEPER = Step({'depth_of_cut': 1e-3}, at=2.0, because='a deeper cut')
CURE = Step({'spindle_speed_rpm': RECOMMENDED}, when=FLAGGED, after=0.5)
AGAIN = Step({'depth_of_cut': 2e-3}, when=CLEARED)


def player_of(*steps: Step) -> ScenarioPlayer:
    return ScenarioPlayer(Scenario('test', 'Test', 10.0, steps=steps))


def flag(player: ScenarioPlayer, time: float, *, up: bool) -> str:
    return player.on_flag(time, 120.04, 3.21, up=up)


def test_a_step_with_a_time_is_due_once_at_that_time() -> None:
    player = player_of(DEEPER)
    assert player.next_time == 2.0
    assert player.due(1.999, math.nan) is None
    assert player.due(2.0, math.nan) == DEEPER
    assert player.finished
    assert player.due(3.0, math.nan) is None
    assert player.next_time == math.inf
    assert str(DEEPER) == 'depth_of_cut = 0.001  (a deeper cut)'


def test_a_step_accepts_what_a_supervisor_has_asked() -> None:
    accepts = Step({}, when=ASKED, after=0.5, accept=True)
    player = player_of(accepts)
    flag(player, 1.0, up=True)
    assert player.due(3.0, 3500.0) is None
    player.notice(ASKED, 3.2)
    assert player.due(3.6, 3500.0) is None
    assert player.due(3.8, 3500.0) == accepts
    assert flag(player, 4.0, up=False) == 'flag cleared'
    assert str(accepts) == 'the offer of the supervisor is accepted'


def test_a_step_waits_for_the_flag_and_for_a_speed() -> None:
    player = player_of(CURE, AGAIN)
    assert not math.isfinite(player.next_time)
    assert player.due(9.0, 3500.0) is None
    assert flag(player, 1.0, up=True) == 'chatter flagged: 120.0 Hz, growth +3.2 1/s'
    assert player.due(1.4, 3500.0) is None
    assert player.due(1.6, math.nan) is None
    step = player.due(1.7, 3500.4)
    assert step is not None
    assert step.changes == {'spindle_speed_rpm': 3500.0}
    assert player.due(1.7, 3500.0) is None
    assert flag(player, 2.0, up=False) == 'flag cleared'
    assert player.due(2.0, math.nan) == AGAIN
    assert player.said == [FLAGGED, CLEARED]


def test_only_what_is_said_since_the_step_before_counts() -> None:
    player = player_of(DEEPER, CURE)
    flag(player, 1.0, up=True)
    assert player.due(2.0, 3500.0) == DEEPER
    assert player.due(5.0, 3500.0) is None
    flag(player, 6.0, up=False)
    flag(player, 7.0, up=True)
    assert player.due(7.5, 3500.0) is not None


def test_a_flag_that_is_as_it_was_is_no_news() -> None:
    player = player_of()
    assert not flag(player, 0.0, up=False)
    assert player.on_flag(1.0, math.nan, math.nan, up=True) == 'chatter flagged'
    assert not flag(player, 1.5, up=True)
    assert player.said == [FLAGGED]
