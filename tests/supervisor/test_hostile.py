"""What goes wrong around a supervisor that acts, and that it then does nothing it must not."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import pytest
from support.supervised_lathe import Disturb, SupervisedLathe, faults_of, undisturbed

from lathe_chatter.model import BearingContact, Cut, Machine
from lathe_chatter.supervisor import Action, Limits, Seen

CALM = Cut(depth_of_cut=3e-4, bearing_contact=BearingContact.NONE, sensor_noise=1e-7)
DEEP = 1e-3
"""m: unstable at 3000 rev/min, stable at others."""
FALSE_ALARM = 4e-4


@dataclass(frozen=True)
class Kind:
    """One kind of disturbance.

    Attributes:
        name: For people.
        disturb: What becomes of what is seen.
        limits: Of the supervisor.
        told: What it is told of the machine.
        prepare: Done before the chatter.
        depth: Of the cut that chatters, m.
        most: Moves that may be made.
    """

    name: str
    disturb: Disturb = undisturbed
    limits: Limits = field(default_factory=Limits)
    told: Machine | None = None
    prepare: Callable[[SupervisedLathe], None] = lambda _there: None
    depth: float = DEEP
    most: int = 3


def hindered(reason: str, when: Callable[[SupervisedLathe, Seen], bool]) -> Disturb:
    def disturb(there: SupervisedLathe, seen: Seen) -> Seen:
        return replace(seen, hindrance=reason) if when(there, seen) else seen

    return disturb


def replaced(**values: Any) -> Disturb:
    return lambda _there, seen: replace(seen, **values)


def by_hand(when: Callable[[SupervisedLathe, Seen], bool], **changes: Any) -> Disturb:
    """Somebody changes something once."""

    def disturb(there: SupervisedLathe, seen: Seen) -> Seen | None:
        if not there.hands and when(there, seen):
            there.set_by_hand(**changes)
            return None
        return seen

    return disturb


def amid_ramp(there: SupervisedLathe, _seen: Seen) -> bool:
    return bool(there.actions) and bool(there.actions[-1][1].changes)


def at_alarm(_there: SupervisedLathe, seen: Seen) -> bool:
    return seen.chatter


def refusing(*names: str) -> Callable[[SupervisedLathe], None]:
    def refuse(action: Action) -> str:
        return 'it may not be set' if not names or set(names) & set(action.changes) else ''

    def prepare(there: SupervisedLathe) -> None:
        there.refuse = refuse

    return prepare


def without_machine(when: Callable[[SupervisedLathe, Seen], bool]) -> Disturb:
    def disturb(there: SupervisedLathe, seen: Seen) -> Seen:
        if when(there, seen):
            there.supervisor.machine = None
        return seen

    return disturb


def kinds() -> Iterator[Kind]:
    whens: dict[str, tuple[Callable[[SupervisedLathe, Seen], bool], int]] = {
        'always': (lambda _there, _seen: True, 0),
        'from the alarm on': (at_alarm, 0),
        'amid the ramp': (amid_ramp, 3),
        'now and then': (lambda _there, seen: seen.time % 0.2 < 0.1, 3),
    }
    reasons = (
        *('samples were lost', 'nothing comes from the monitor', 'there is another supervisor'),
        *('the monitor does not know the state of the cut', 'the lathe cannot be reached'),
    )
    for reason in reasons:
        for name, (when, most) in whens.items():
            yield Kind(f'{reason}, {name}', hindered(reason, when), most=most)
    for name, (when, most) in whens.items():
        yield Kind(f'no machine, {name}', without_machine(when), most=most)
    hands: dict[str, dict[str, Any]] = {
        'a faster spindle': {'spindle_speed_rpm': 3100.0},
        'a slower spindle': {'spindle_speed_rpm': 2900.0},
        'a deeper cut': {'depth_of_cut': 0.9e-3},
        'a smaller feed': {'feed_speed': 0.001},
        'another clearance': {'bearing_clearance': 1e-5},
        'a varied speed': {'speed_variation_amplitude': 0.05},
    }
    for name, changes in hands.items():
        yield Kind(f'a hand: {name}, at the alarm', by_hand(at_alarm, **changes))
        yield Kind(f'a hand: {name}, amid the ramp', by_hand(amid_ramp, **changes))
    yield Kind('refused: the speed', prepare=refusing('spindle_speed_rpm'), most=1)
    yield Kind('refused: everything', prepare=refusing(), most=1)
    figures = ('growth_rate', 'frequency', 'amplitude', 'margin', 'cutting_stiffness')
    for name in figures:
        yield Kind(f'{name} not known', replaced(**{name: math.nan}))
        yield Kind(f'{name} beyond all', replaced(**{name: math.inf}))
        yield Kind(f'{name} negative', replaced(**{name: -1.0}))
    yield Kind('nothing known', replaced(**dict.fromkeys(figures, math.nan)), most=0)
    yield Kind('a flag that never falls', replaced(chatter=True), depth=FALSE_ALARM)
    yield Kind('a flag that never rises', replaced(chatter=False), most=0)
    yield Kind(
        'a flag that flickers',
        lambda _there, seen: replace(seen, chatter=seen.chatter and seen.time % 0.1 < 0.05),
        most=20,  # each is another chatter
    )
    yield Kind('a clock that stands', replaced(time=1.0))
    yield Kind(
        'a clock that leaps ahead',
        lambda _there, seen: replace(seen, time=seen.time + (1e6 if seen.time > 1.0 else 0.0)),
    )
    yield Kind(
        'a clock that goes back',
        lambda _there, seen: replace(seen, time=seen.time - (1e3 if seen.time > 1.0 else 0.0)),
    )
    yield Kind(
        'looks that come late', lambda _there, seen: seen if seen.time % 0.5 < 0.01 else None
    )
    wrong = replace(Machine(), cutting_coefficient=1e6)
    yield Kind('told a third of C', told=wrong)
    yield Kind('told ten times C', told=replace(wrong, cutting_coefficient=3.5e7))
    yield Kind('no speed left', limits=Limits(2999.0, 3001.0, smallest_depth=1e-3))
    yield Kind('no move allowed', limits=Limits(most_moves=0.0), most=0)
    yield Kind('a tiny amplitude limit', limits=Limits(amplitude_limit=1e-7))
    yield Kind('a ramp that takes minutes', limits=Limits(ramp=10.0))


@pytest.mark.parametrize('kind', list(kinds()), ids=lambda kind: kind.name)
def test_it_does_nothing_that_it_must_not(kind: Kind) -> None:
    there = SupervisedLathe(CALM, told=kind.told, limits=kind.limits, disturb=kind.disturb)
    kind.prepare(there)
    there.run(0.5)
    there.set_by_hand(told=False, depth_of_cut=kind.depth)
    there.run(3.0)
    assert not faults_of(there, there.changed[0][1])
    moves = [move for move in there.moves if not move[1].stop]
    assert len(moves) <= kind.most, there.said


def test_there_are_fifty_kinds_or_more() -> None:
    assert len({kind.name for kind in kinds()}) >= 50
