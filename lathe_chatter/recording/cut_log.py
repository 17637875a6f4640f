"""What a lathe logged of its cuts: its sessions, and what happened in each of them.

The one parser of the sentences of `cut_events`: the recorder follows them as they come, and who
reads a run has them from it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
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
from lathe_chatter.recording.provenance import PARAMETERS, parameter_history
from lathe_chatter.recording.run import Run

Parameters = Mapping[str, Any]
_KINDS = {1: 'bool_value', 2: 'integer_value', 3: 'double_value', 4: 'string_value'}
_NEEDED = {'spindle_speed_rpm', 'depth_of_cut', 'seed'}
"""Declared first and last: who lacks one of them came in the middle, and lacks others too."""
_END = 2**63
"""ns since the epoch: no message is as late."""


@dataclass
class CutSession:
    """From one time zero of a lathe to the next.

    Attributes:
        beginning: The sentence of its time zero, empty where the record has none.
        begun: When that was published, ns since the epoch.
        events: Changes and knocks in the order in which they took effect.
        parameters: Of the lathe at time zero, by name; empty where the record does not say.
    """

    beginning: str = ''
    begun: int = 0
    events: list[Change | Knock] = field(default_factory=list)
    parameters: dict[str, Any] = field(default_factory=dict)

    @property
    def changes(self) -> Iterator[Change]:
        """The changes of the cut, in order."""
        return (each for each in self.events if isinstance(each, Change))


@dataclass
class CutLog:
    """The sessions of one lathe.

    Attributes:
        sessions: One, and another for each reset and each new start.
    """

    sessions: list[CutSession] = field(default_factory=lambda: [CutSession()])

    @property
    def parameters(self) -> dict[str, Any]:
        """At the first start, by name; empty where the record does not say."""
        return self.sessions[0].parameters

    @property
    def logged(self) -> bool:
        """Whether anything that the lathe logged is known."""
        return any(session.beginning or session.events for session in self.sessions)

    @property
    def changes(self) -> Iterator[Change]:
        """The changes of the cut, in order."""
        for session in self.sessions:
            yield from session.changes

    def receive(self, sentence: str, published: int) -> None:
        """Follow a sentence that the lathe logged; others are left aside.

        Args:
            sentence: What it says.
            published: When, ns since the epoch.
        """
        if sentence in (BEGINNING, BEGINNING_AGAIN):
            if self.sessions[-1].beginning or self.sessions[-1].events:
                self.sessions.append(CutSession())
            self.sessions[-1].beginning, self.sessions[-1].begun = sentence, published
            return
        event = parse_change(sentence) or parse_knock(sentence)
        if event is not None:
            self.sessions[-1].events.append(event)

    def assign_parameters(
        self,
        noted: Iterable[tuple[Parameters, int]],
        announced: Iterable[tuple[Parameters, int]] = (),
    ) -> None:
        """Give each session the parameters that were in force at its time zero.

        Args:
            noted: What the lathe answered to who asked for its parameters, and when, ns since
                the epoch: at any time of a session.
            announced: What it declared, and when: before it says that it begins.
        """
        noted, announced = list(noted), list(announced)
        starts = [
            k for k, each in enumerate(self.sessions) if not k or each.beginning == BEGINNING
        ]
        before = 0
        for first, after in pairwise([*starts, len(self.sessions)]):
            last = after == len(self.sessions)
            begun = self.sessions[first].begun
            until = _END if last else self.sessions[after].begun
            found: dict[str, Any] = {}
            for values, at in noted:
                if (begun if first else 0) <= at < until:
                    found = dict(values)
                    break
            declared_until = _END if last else begun
            for values, at in announced:
                if before < at <= declared_until:
                    found |= values
            self._assign(first, after, found)
            before = begun

    def _assign(self, first: int, after: int, found: Parameters) -> None:
        """To the sessions of one process, from what it said at some time."""
        # It may have been asked late: what the first change of a value replaced was there before.
        former: dict[str, Any] = {}
        for session in self.sessions[first:after]:
            for change in session.changes:
                former = {**change.old, **former}
        values = {**found, **_plain(former)} if found.keys() >= _NEEDED else {}
        for session in self.sessions[first:after]:
            session.parameters = dict(values)
            for change in session.changes if values else ():
                values |= _plain(change.new)


def _plain(values: Parameters) -> dict[str, Any]:
    """As parameters are: a choice by its value."""
    return {name: getattr(value, 'value', value) for name, value in values.items()}


def read_cut_log(run: Run, lathe: str) -> CutLog:
    """What a lathe, by the full name of its node, logged in a run.

    Raises:
        RunReadError: If a file is damaged.
    """
    log = CutLog()
    logger = logger_of(lathe)
    for recorded in run.messages('/rosout'):
        if recorded.message.name == logger:
            log.receive(recorded.message.msg, recorded.publish_time)
    log.assign_parameters(_noted(run, lathe), _announced(run, lathe))
    return log


def logger_of(lathe: str) -> str:
    """The name under which a node, by its full name, logs."""
    return lathe.lstrip('/').replace('/', '.')


def _noted(run: Run, lathe: str) -> Iterator[tuple[Parameters, int]]:
    """As it was asked for them."""
    for note in run.notes():
        if note.name == PARAMETERS + lathe:
            yield from parameter_history(note.values)


def _announced(run: Run, lathe: str) -> Iterator[tuple[Parameters, int]]:
    """As it declared them; what is set later is no declaration."""
    for recorded in run.messages('/parameter_events'):
        if recorded.message.node == lathe:
            yield (
                {
                    parameter.name: getattr(parameter.value, _KINDS[parameter.value.type])
                    for parameter in recorded.message.new_parameters
                    if parameter.value.type in _KINDS
                },
                recorded.publish_time,
            )
