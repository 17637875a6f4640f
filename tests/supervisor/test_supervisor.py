"""A supervisor of the core on a real lathe and a real detector, in simulated time."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import cycle, pairwise
from typing import Any

import numpy as np
import pytest
from support.supervised_lathe import SupervisedLathe, faults_of

from lathe_chatter.model import BearingContact, Cut, Machine
from lathe_chatter.stability import rightmost_root
from lathe_chatter.supervisor import Limits, Mode, Seen, Supervisor

CALM = Cut(depth_of_cut=3e-4, bearing_contact=BearingContact.NONE, sensor_noise=1e-7)
DEEP = 1e-3


def chattering(
    mode: Mode = Mode.ACT, limits: Limits | None = None, *, rpm: float = 3000.0, **options: Any
) -> SupervisedLathe:
    """A cut that is just flagged; nobody's hand has made it deeper."""
    calm = CALM.with_changes(spindle_speed_rpm=rpm)
    there = SupervisedLathe(calm, limits=limits, mode=mode, **options)
    there.run(0.5)
    there.set_by_hand(told=False, depth_of_cut=DEEP)
    there.run(3.0, lambda: there.known.chatter)
    assert there.known.chatter
    return there


def test_chatter_is_ended_by_one_move_to_a_stable_speed() -> None:
    there = chattering()
    there.run(2.5)
    assert not there.known.chatter
    assert len(there.moves) == 1
    cut = there.lathe.cut
    assert cut.depth_of_cut == DEEP
    at = cut.spindle_speed_rpm, cut.depth_of_cut
    assert rightmost_root(Machine(), *at, seated=False).real < 0.0
    first, last = there.said
    for words in ('growing at', 'I set spindle_speed_rpm from 3000 to', 'predicted: growth -'):
        assert words in first
    assert 'The chatter has ended' in last
    assert not faults_of(there, CALM.with_changes(depth_of_cut=DEEP))


@pytest.mark.parametrize(('quiet_before', 'when'), [(True, ', 1.2 s after the flag'), (False, '')])
def test_of_a_flag_that_was_up_before_no_time_is_said(*, quiet_before: bool, when: str) -> None:
    supervisor = Supervisor(Limits(), Mode.ACT)
    if quiet_before:
        assert supervisor.look(Seen(0.0, CALM)) is None
    supervisor.look(Seen(1.0, CALM, chatter=True))
    action = supervisor.look(Seen(2.2, CALM))
    assert action is not None
    assert action.sentence == f'The chatter has ended{when}; 0 moves.'


def test_a_flag_that_falls_without_a_judgement_is_no_end_of_the_chatter() -> None:
    supervisor = Supervisor(Limits(), Mode.ACT)
    supervisor.look(Seen(0.0, CALM))
    for again in (False, True):  # a monitor that begins anew, and hears the same
        supervisor.look(Seen(1.0, CALM, chatter=True))
        assert supervisor.look(Seen(2.0, CALM, judged=False)) is None
        if again:
            supervisor.look(Seen(2.5, CALM, chatter=True))
            action = supervisor.look(Seen(4.0, CALM))
        else:
            action = supervisor.look(Seen(4.0, CALM))
        assert action is not None
        when = '1.5' if again else '1.0'
        assert action.sentence == f'The chatter has ended, {when} s after the flag; 0 moves.'
        assert supervisor.look(Seen(5.0, CALM)) is None


@pytest.mark.parametrize('stays', [False, True])
def test_chatter_of_a_run_before_has_not_ended_in_another(stays: bool) -> None:
    supervisor = Supervisor(Limits(), Mode.ACT)
    supervisor.look(Seen(1.0, CALM, chatter=True))
    supervisor.another_run()
    if stays:  # until the monitor, which has begun anew as well, has judged
        supervisor.look(Seen(1.5, CALM, chatter=True))
    assert supervisor.look(Seen(2.0, CALM)) is None
    supervisor.look(Seen(3.0, CALM, chatter=True))
    action = supervisor.look(Seen(4.0, CALM))
    assert action is not None
    assert action.sentence == 'The chatter has ended, 1.0 s after the flag; 0 moves.'


def test_no_move_is_made_where_the_flag_fell_while_one_was_looked_for() -> None:
    there = chattering(disturb=lambda _there, seen: replace(seen, flag_stays=lambda: False))
    there.run(2.5)  # in which it moves where the flag stays
    assert not there.moves
    assert not there.said
    assert there.supervisor.moves == 0


@pytest.mark.parametrize('late', [0.02, 0.1])
def test_the_ramp_is_kept_also_where_every_other_step_comes_late(late: float) -> None:
    there = chattering(limits=Limits(ramp=1000.0))
    latencies = cycle([late, 0.0])
    there.latency = lambda: next(latencies)
    there.run(2.5)
    for (before, old), (time, new) in pairwise(there.changed):
        assert abs(new.spindle_speed_rpm - old.spindle_speed_rpm) <= 1000.0 * (time - before) + 0.1
    assert abs(there.lathe.cut.spindle_speed_rpm - 3000.0) > 300.0


def test_a_spindle_that_ramps_by_itself_is_told_once() -> None:
    there = chattering(disturb=lambda _there, seen: replace(seen, spindle_acceleration=4000.0))
    there.run(1.0)
    assert len(there.changed) == 2


@pytest.mark.parametrize('accepted', [False, True])
def test_in_ask_it_waits(accepted: bool) -> None:
    assert SupervisedLathe(CALM, mode=Mode.ASK).accept() == (
        False,
        'Nothing is waiting to be accepted.',
    )
    there = chattering(Mode.ASK)
    there.run(0.3)
    assert '~/accept does it' in there.said[-1]
    assert len(there.changed) == 1
    if accepted:
        done, message = there.accept()
        assert done
        assert 'as was accepted' in message
    there.run(1.5)
    assert (len(there.changed) > 1) is accepted
    assert there.known.chatter is not accepted


def test_an_offer_lapses_when_somebody_changes_the_cut() -> None:
    there = chattering(Mode.ASK)
    there.run(0.3)
    there.set_by_hand(spindle_speed_rpm=3010.0)
    withdrawn = 'What was offered is withdrawn, for somebody else has just changed something.'
    assert withdrawn in there.said
    there.run(0.1)
    assert there.accept() == (False, 'Nothing is waiting to be accepted.')


def test_an_offer_is_not_accepted_for_another_cut_or_while_something_is_in_the_way() -> None:
    for changed, said in (
        ({'hindrance': 'samples were lost'}, 'Nothing is done, for samples were lost.'),
        ({'cut': CALM}, 'Nothing is done, for the cut has changed.'),
    ):
        there = chattering(Mode.ASK)
        there.run(0.3)
        seen = replace(there.seen(), **changed)  # type: ignore[arg-type]
        done, why, action = there.supervisor.accept(seen)
        assert (done, why) == (False, said)
        assert action is not None
        assert action.sentence == said.replace('Nothing is done', 'What was offered is withdrawn')
        again = there.supervisor.accept(there.seen())
        assert again == (False, 'Nothing is waiting to be accepted.', None)


def test_an_offer_of_a_run_before_does_not_stand_in_another() -> None:
    there = chattering(Mode.ASK)
    there.run(0.3)
    action = there.supervisor.another_run()
    assert action is not None
    assert action.sentence == 'What was offered is withdrawn, for the lathe has begun again.'
    assert there.supervisor.another_run() is None


def test_what_was_offered_and_withdrawn_was_not_tried_and_is_offered_again() -> None:
    there = chattering(Mode.ASK)
    there.run(0.3)
    offered = there.said[-1]
    there._disturb = lambda _there, seen: replace(seen, hindrance='samples were lost')
    there.run(0.1)
    assert 'nothing is done, for samples were lost' in there.said[-1]
    there._disturb = lambda _there, seen: seen
    there.run(2.5)
    speed = offered.split(' set spindle_speed_rpm from 3000 to ')[1].split()[0]
    assert f' set spindle_speed_rpm from 3000 to {speed} ' in there.said[-1]
    assert '~/accept does it' in there.said[-1]


def test_a_hand_amid_a_ramp_leaves_the_speed_where_it_is() -> None:
    there = chattering(limits=Limits(ramp=100.0))
    there.run(0.5)
    speed = there.lathe.cut.spindle_speed_rpm
    assert speed != 3000.0
    there.set_by_hand(depth_of_cut=1.01 * DEEP)
    there.run(0.5)
    assert 'Somebody else changes the cut: the speed stays where it is on its way.' in there.said
    assert there.lathe.cut.spindle_speed_rpm == pytest.approx(speed, abs=10.0)
    assert there.supervisor.hand_moved(there.time) is None  # of none that is on its way


def test_in_shadow_it_says_once_what_it_would_do() -> None:
    there = chattering(Mode.SHADOW)
    there.run(1.5)
    assert len(there.changed) == 1
    (sentence,) = there.said
    assert 'I would set' in sentence
    assert not there.accept()[0]


def test_vibration_beyond_its_limit_that_does_not_fall_stops_the_lathe() -> None:
    limits = Limits(2990.0, 3010.0, smallest_depth=DEEP, largest_variation=0.0,
                    amplitude_limit=5e-6)  # fmt: skip
    there = chattering(limits=limits)
    there.run(3.0)
    assert there.stopped
    assert there.said[-1].endswith('beyond amplitude_limit, 5 um: I stop.')


def test_a_varied_speed_ends_chatter_where_no_constant_one_does() -> None:
    limits = Limits(1580.0, 2420.0, ramp=40e3, smallest_depth=DEEP)
    there = chattering(limits=limits, rpm=2000.0)
    there.run(2.5)
    assert there.lathe.cut.speed_variation_amplitude > 0.0
    assert np.mean(there.vibration[-50:]) < 0.3 * max(there.vibration)


def test_where_nothing_helps_a_person_has_to_decide() -> None:
    limits = Limits(2990.0, 3010.0, smallest_depth=DEEP, largest_variation=0.0,
                    amplitude_limit=0.1)  # fmt: skip
    there = chattering(limits=limits)
    there.run(1.0)
    assert not there.moves
    assert there.said == [there.said[0]]
    none = 'no move within the limits is predicted to help; a person has to decide.'
    assert there.said[0].endswith(none)


def test_after_moves_that_were_no_cure_nothing_is_said_of_those_that_were_made() -> None:
    limits = Limits(2990.0, 3010.0, smallest_depth=DEEP, largest_variation=0.0,
                    amplitude_limit=0.1)  # fmt: skip
    supervisor = Supervisor(limits, Mode.ACT)
    supervisor.machine = Machine()
    supervisor._tried.append(CALM)
    action = supervisor._move(Seen(1.0, CALM.with_changes(depth_of_cut=DEEP)), 'So')
    assert action is not None
    none = 'no move within the limits that was not tried is predicted to help'
    assert action.sentence == f'So: {none}; a person has to decide.'


@pytest.mark.parametrize(('most', 'tried'), [(0, ''), (1, ' 1 move was no cure.')])
def test_a_move_more_than_it_may_make_is_asked_for(most: int, tried: str) -> None:
    supervisor = Supervisor(Limits(most_moves=most), Mode.ACT)
    supervisor.machine = Machine()
    supervisor.moves = most
    action = supervisor._move(Seen(1.0, CALM.with_changes(depth_of_cut=DEEP)), 'So')
    assert action is not None
    assert not action.changes
    assert action.sentence.endswith(f': ~/accept does it.{tried}')


def test_without_a_machine_or_an_amplitude_nothing_is_done() -> None:
    for machine, said in (
        (None, 'no machine is known, or the monitor works without it'),
        (Machine(), 'the amplitude is not known'),
    ):
        supervisor = Supervisor(Limits(), Mode.ACT)
        supervisor.machine = machine
        action = supervisor.look(Seen(1.0, CALM, chatter=True, frequency=130.0))
        assert action is not None
        assert action.sentence == f'Chatter at 130.0 Hz: nothing is done, for {said}.'


def test_one_that_has_only_just_begun_holds_still_and_blames_nobody() -> None:
    supervisor = Supervisor(Limits(), Mode.ACT, begun=0.0)
    supervisor.machine = Machine()
    action = supervisor.look(Seen(1.9, CALM, chatter=True))
    assert action is not None
    assert action.sentence == (
        'Chatter flagged: nothing is done, for I have only just begun to watch.'
    )


@pytest.mark.parametrize(('rate', 'words'), [(4.0, 'growing at 4.0'), (-4.0, 'growth rate -4.0')])
def test_what_does_not_grow_is_not_said_to_grow(rate: float, words: str) -> None:
    supervisor = Supervisor(Limits())
    action = supervisor.look(Seen(1.0, CALM, chatter=True, growth_rate=rate, amplitude=1e-5))
    assert action is not None
    assert f'Chatter {words} 1/s, amplitude 10 um' in action.sentence


def test_hands_off_while_somebody_else_acts() -> None:
    there = SupervisedLathe(CALM)
    there.run(0.5)
    there.set_by_hand(depth_of_cut=DEEP)
    there.run(1.9)
    assert there.known.chatter
    assert not there.moves
    assert 'somebody else has just changed something' in there.said[-1]
    there.run(1.5)
    assert len(there.moves) == 1


def looks(supervisor: Supervisor, **values: float | bool) -> list[str]:
    """The sentences of three seconds in which the same is seen."""
    supervisor.machine = Machine()
    seen = [Seen(0.02 * k, CALM, **values) for k in range(150)]  # type: ignore[arg-type]
    return [action.sentence for each in seen if (action := supervisor.look(each)) is not None]


def first_move(cut: Cut, amplitude: Callable[[float], float], growth_rate: float) -> float:
    """When it moves after a flag that comes at 0 s, s; infinite where it waits for 4 s."""
    supervisor = Supervisor(Limits(), Mode.ACT)
    supervisor.machine = Machine()
    for k in range(-100, 200):
        time = 0.02 * k
        seen = Seen(time, cut, k >= 0, growth_rate, 130.0, amplitude(time))
        action = supervisor.look(seen)
        if action is not None and action.changes:
            return time
    return math.inf


def unsteady(time: float) -> float:
    return 1e-6 * (1.0 + 0.5 * math.sin(9.0 * time))


def test_chatter_that_had_grown_before_its_flag_is_believed_once_it_is_steady() -> None:
    stable = CALM.with_changes(depth_of_cut=6.4e-4)  # as the machine is told
    assert 0.9 < first_move(stable, lambda _time: 5e-5, 0.0) < 1.2
    assert first_move(stable, unsteady, 0.0) == math.inf


def test_chatter_that_stays_small_is_believed_in_a_cut_that_is_expected_to_chatter() -> None:
    assert 1.9 < first_move(CALM.with_changes(depth_of_cut=DEEP), unsteady, 0.0) < 2.5


def test_vibration_that_grows_near_its_limit_is_not_waited_on() -> None:
    deep = CALM.with_changes(depth_of_cut=DEEP)
    assert first_move(deep, lambda time: 2e-4 * math.exp(5.0 * min(time, 0.0)), 5.0) == 0.0
    assert first_move(deep, lambda time: 2e-4 * math.exp(5.0 * min(time, 0.0)), -5.0) > 0.0


def test_a_small_margin_is_warned_of_once() -> None:
    (sentence,) = looks(Supervisor(Limits(), Mode.ACT), margin=0.05)
    assert sentence == 'The depth may grow by 5 % only, less than margin_limit, 10 %.'
    (sentence,) = looks(Supervisor(Limits(), Mode.ACT), margin=0.0996)
    assert sentence == 'The depth may grow by 9.9 % only, less than margin_limit, 10 %.'
    (sentence,) = looks(Supervisor(Limits(), Mode.ACT), margin=-0.012)
    assert sentence == (
        'The depth is at or beyond the limit: its margin is -1.2 %, less than margin_limit, 10 %.'
    )
    assert not looks(Supervisor(Limits(), Mode.ACT), margin=0.2)


def test_it_moves_early_only_if_so_told() -> None:
    machine = Machine()
    cut = CALM.with_changes(depth_of_cut=6.4e-4)
    supervisor = Supervisor(Limits(), Mode.ACT, move_early=True)
    supervisor.machine = machine
    for k in range(100):
        action = supervisor.look(Seen(0.02 * k, cut, margin=0.04, amplitude=1e-7))
        if action is not None:
            break
    assert action is not None
    assert action.changes
    assert action.sentence.startswith('The depth may grow by 4 % only')


def test_a_refusal_is_said_and_ends_the_attempts() -> None:
    there = chattering()
    there.refuse = lambda _action: 'spindle_speed_rpm may not be set.'
    there.run(2.0)
    assert len(there.changed) == 1
    refused = 'the lathe refused: spindle_speed_rpm may not be set.'
    assert f'Nothing more is done, for {refused}' in there.said
    assert there.said[-1].endswith(f': nothing is done, for {refused}')
