"""What a lathe told about itself in a run: its parameters, and what happened to its cut."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from lathe_chatter.changes import (
    BEGINNING,
    BEGINNING_AGAIN,
    Change,
    Knock,
    parse_change,
    parse_knock,
)
from lathe_chatter.recording.identity import PARAMETERS
from lathe_chatter.recording.reading.reader import Run

_KINDS = {1: 'bool_value', 2: 'integer_value', 3: 'double_value', 4: 'string_value'}


@dataclass
class Act:
    """From one time zero of a lathe to the next.

    Attributes:
        beginning: The sentence of its time zero, empty where the record has none.
        begun: When that was published, ns since the epoch.
        happenings: Changes and knocks in the order in which they took effect.
    """

    beginning: str = ''
    begun: int = 0
    happenings: list[Change | Knock] = field(default_factory=list)


@dataclass(frozen=True)
class Told:
    """What a lathe told.

    Attributes:
        parameters: At its start, by name; empty where nobody was told.
        acts: One, and another for each reset and each new start.
    """

    parameters: dict[str, Any]
    acts: tuple[Act, ...]

    @property
    def logged(self) -> bool:
        """Whether anything of its log is in the record."""
        return any(act.beginning or act.happenings for act in self.acts)

    @property
    def changes(self) -> Iterator[Change]:
        """The changes of the cut, in order."""
        for act in self.acts:
            yield from (each for each in act.happenings if isinstance(each, Change))


def told_by(run: Run, lathe: str) -> Told:
    """What a lathe, by the full name of its node, told in a run.

    Raises:
        RunReadError: If a file is damaged.
    """
    acts = tuple(_acts(run, lathe))
    return Told(_parameters(run, lathe, acts), acts)


def _acts(run: Run, lathe: str) -> list[Act]:
    logger = lathe.lstrip('/').replace('/', '.')
    acts = [Act()]
    for recorded in run.messages('/rosout'):
        if recorded.message.name != logger:
            continue
        sentence = recorded.message.msg
        if sentence in (BEGINNING, BEGINNING_AGAIN):
            if acts[-1].beginning or acts[-1].happenings:
                acts.append(Act())
            acts[-1].beginning, acts[-1].begun = sentence, recorded.publish_time
            continue
        happened = parse_change(sentence) or parse_knock(sentence)
        if happened is not None:
            acts[-1].happenings.append(happened)
    return acts


def _parameters(run: Run, lathe: str, acts: Sequence[Act]) -> dict[str, Any]:
    """The parameters at the start: as the lathe was asked for them, or announced them itself."""
    found = _noted(run, lathe) or {}
    announced = _announced(run, lathe)
    found = {**found, **announced}
    # It was asked when it had been cutting for a while, and may have been told late: what the
    # first change of a value replaced is what it was at the start.
    first: dict[str, Any] = {}
    for act in acts:
        for each in act.happenings:
            if isinstance(each, Change):
                first = {**each.old, **first}
    plain = {name: getattr(value, 'value', value) for name, value in first.items()}
    return {**found, **plain} if found else {}


def _noted(run: Run, lathe: str) -> dict[str, Any] | None:
    for note in run.notes():
        if note.name == PARAMETERS + lathe:
            try:
                values = json.loads(note.values['parameters'])
            except (KeyError, ValueError):
                continue
            if isinstance(values, dict):
                return values
    return None


def _announced(run: Run, lathe: str) -> dict[str, Any]:
    """As it declared them; what is set later is no declaration."""
    found: dict[str, Any] = {}
    for recorded in run.messages('/parameter_events'):
        if recorded.message.node == lathe:
            for parameter in recorded.message.new_parameters:
                if parameter.value.type in _KINDS:
                    found[parameter.name] = getattr(parameter.value, _KINDS[parameter.value.type])
    return found
