"""What a lathe told about itself in a run: its parameters, and what happened to its cut."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

from lathe_chatter.lathe.cut_events import (
    BEGINNING,
    BEGINNING_AGAIN,
    Change,
    Knock,
    parse_change,
    parse_knock,
)
from lathe_chatter.recording.provenance import PARAMETERS, lives_in
from lathe_chatter.recording.run import Run

_KINDS = {1: 'bool_value', 2: 'integer_value', 3: 'double_value', 4: 'string_value'}
_END = 2**63
"""ns since the epoch: no message is as late."""


@dataclass
class Act:
    """From one time zero of a lathe to the next.

    Attributes:
        beginning: The sentence of its time zero, empty where the record has none.
        begun: When that was published, ns since the epoch.
        happenings: Changes and knocks in the order in which they took effect.
        parameters: With which the lathe was started for this act, by name; empty where nobody
            was told, or it was not started but reset.
    """

    beginning: str = ''
    begun: int = 0
    parameters: dict[str, Any] = field(default_factory=dict)
    happenings: list[Change | Knock] = field(default_factory=list)


@dataclass(frozen=True)
class Told:
    """What a lathe told.

    Attributes:
        acts: One, and another for each reset and each new start.
    """

    acts: tuple[Act, ...]

    @property
    def parameters(self) -> dict[str, Any]:
        """At its first start, by name; empty where nobody was told."""
        return self.acts[0].parameters

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
    starts = [k for k, act in enumerate(acts) if not k or act.beginning == BEGINNING]
    announced = _announced(run, lathe, acts[0].begun if len(starts) > 1 else _END)
    for first, after in pairwise([*starts, len(acts)]):
        since = acts[first].begun if first else 0
        until = acts[after].begun if after < len(acts) else _END
        found = {**_noted(run, lathe, since, until), **({} if first else announced)}
        acts[first].parameters = _at_the_start(found, acts[first:after])
    return Told(acts)


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


def _at_the_start(found: dict[str, Any], acts: Sequence[Act]) -> dict[str, Any]:
    """The parameters at a start, from those of some time before the next; empty where none.

    The lathe was asked when it had been cutting for a while, and may have been told late: what
    the first change of a value replaced is what it was at the start.
    """
    first: dict[str, Any] = {}
    for act in acts:
        for each in act.happenings:
            if isinstance(each, Change):
                first = {**each.old, **first}
    plain = {name: getattr(value, 'value', value) for name, value in first.items()}
    return {**found, **plain} if found else {}


def _noted(run: Run, lathe: str, since: int, until: int) -> dict[str, Any]:
    """As it was asked for them between two times, ns since the epoch."""
    for note in run.notes():
        if note.name == PARAMETERS + lathe:
            for values, log_time in lives_in(note.values):
                if since <= log_time < until:
                    return values
    return {}


def _announced(run: Run, lathe: str, until: int) -> dict[str, Any]:
    """As it declared them; what is set later is no declaration.

    Args:
        run: Which.
        lathe: The full name of its node.
        until: When it began, ns since the epoch, if another of its name followed: that one
            declares its own before it says that it begins.
    """
    found: dict[str, Any] = {}
    for recorded in run.messages('/parameter_events'):
        if recorded.message.node == lathe and recorded.publish_time <= until:
            for parameter in recorded.message.new_parameters:
                if parameter.value.type in _KINDS:
                    found[parameter.name] = getattr(parameter.value, _KINDS[parameter.value.type])
    return found
