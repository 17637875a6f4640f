"""What happens to a cut as sentences that people read and programs read back.

The lathe logs one when a change takes effect, with its simulated time; so every recorder of
/rosout has it, and the reader of a run takes the change from there:

    At 0.000000 s: the cut begins.
    At 3.000000 s: depth_of_cut 0.0005 -> 0.00062 m, spindle_speed_rpm 3000.0 -> 7800.0 rev/min.
    At 4.500000 s: knock of 0.002 N s.

Every number in them is the whole number, to its last bit: a run can be computed again from them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, fields
from enum import Enum
from typing import Any

from lathe_chatter.errors import ParameterError
from lathe_chatter.model import Cut
from lathe_chatter.model.quantity_fields import quantity_of

BEGINNING = 'At 0.000000 s: the cut begins.'
BEGINNING_AGAIN = 'At 0.000000 s: the cut begins again.'

_SENTENCE = re.compile(r'^At (?P<time>[0-9.e+-]+) s: (?P<changes>.+ -> .+)\.$')
_KNOCK = re.compile(r'^At (?P<time>[0-9.e+-]+) s: knock of (?P<impulse>\S+) N s\.$')
_CHANGE = re.compile(r'^(?P<name>\w+) (?P<old>\S+) -> (?P<new>\S+)(?: \S+)*$')


@dataclass(frozen=True)
class Change:
    """What of a cut changed when.

    Attributes:
        time: Simulated time from which the new values hold, s.
        old: The former values by name of field.
        new: The new ones.
    """

    time: float
    old: dict[str, Any]
    new: dict[str, Any]


@dataclass(frozen=True)
class Knock:
    """A hit on the tool.

    Attributes:
        time: Simulated time, s.
        impulse: N s.
    """

    time: float
    impulse: float


def change_sentence(time: float, old: Cut, new: Cut) -> str:
    """The sentence for a change of the cut at a simulated time, empty where nothing differs."""
    changes = ', '.join(_differences(old, new))
    return changes and f'At {_instant(time)} s: {changes}.'


def knock_sentence(time: float, impulse: float) -> str:
    """The sentence for a knock of an impulse, N s, at a simulated time, s."""
    return f'At {_instant(time)} s: knock of {impulse!r} N s.'


def parse_change(sentence: str) -> Change | None:
    """The change that a sentence of `change_sentence` tells, or None if it tells none."""
    match = _SENTENCE.match(sentence)
    time = _number(match['time']) if match else None
    if match is None or time is None:
        return None
    old: dict[str, Any] = {}
    new: dict[str, Any] = {}
    for part in match['changes'].split(', '):
        change = _CHANGE.match(part)
        if change is None or change['name'] not in Cut.__dataclass_fields__:
            return None
        try:
            before = Cut().with_changes(**{change['name']: _value(change['old'])})
            after = Cut().with_changes(**{change['name']: _value(change['new'])})
        except ParameterError:
            return None
        old[change['name']] = getattr(before, change['name'])
        new[change['name']] = getattr(after, change['name'])
    return Change(time, old, new)


def parse_knock(sentence: str) -> Knock | None:
    """The knock that a sentence of `knock_sentence` tells, or None if it tells none."""
    match = _KNOCK.match(sentence)
    time, impulse = (_number(match[1]), _number(match[2])) if match else (None, None)
    return None if time is None or impulse is None else Knock(time, impulse)


_ON_THE_SHOP_FLOOR = {
    'spindle_speed_rpm': ('', 1.0, 'rev/min'),
    'depth_of_cut': ('depth', 1e3, 'mm'),
    'bearing_clearance': ('clearance', 1e6, 'µm'),
    'feed_speed': ('feed', 1e3, 'mm/s'),
    'feed_per_revolution': ('feed', 1e3, 'mm/rev'),
}
"""Word, factor and unit of what an operator changes most."""


def on_the_shop_floor(name: str, value: Any) -> str:
    """A field of a cut with its value, short and in the units of the shop floor."""
    if name in _ON_THE_SHOP_FLOOR:
        word, factor, unit = _ON_THE_SHOP_FLOOR[name]
        return f'{word} {value * factor:g} {unit}'.lstrip()
    if name == 'bearing_contact':
        return f'contact {_shown(value)}'
    shown = f'{value:g}' if isinstance(value, float) else _shown(value)
    return f'{name} {shown}'


def _differences(old: Cut, new: Cut) -> Iterator[str]:
    """Each field that differs, with its unit; repr keeps every bit of a number."""
    for entry in fields(Cut):
        before, after = getattr(old, entry.name), getattr(new, entry.name)
        if before != after:
            limits = quantity_of(entry)
            unit = f' {limits.unit}' if limits is not None and limits.unit else ''
            yield f'{entry.name} {_shown(before)} -> {_shown(after)}{unit}'


def _shown(value: Any) -> str:
    """A number with every bit, a choice by its value."""
    return str(value.value) if isinstance(value, Enum) else repr(value)


def _instant(time: float) -> str:
    """A time in microseconds where that is all of it, else to the last bit."""
    short = f'{time:.6f}'
    return short if float(short) == time else repr(time)


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def _value(text: str) -> Any:
    """A number where it is one."""
    number = _number(text)
    return text if number is None else number
