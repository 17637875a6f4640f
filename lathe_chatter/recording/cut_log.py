"""What a lathe logged of its cuts: its sessions, and what happened in each of them.

The one parser of the sentences of `change_and_knock_sentences`: the recorder follows them as they
come, and who reads a run has them from `recorded_cuts`.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

from lathe_chatter.lathe.change_and_knock_sentences import (
    BEGINNING,
    BEGINNING_AGAIN,
    Change,
    Knock,
    parse_change,
    parse_knock,
)
from lathe_chatter.model import Cut
from lathe_chatter.model.lathe_parameter_table import LATHE

Parameters = Mapping[str, Any]
_NEEDED = {'spindle_speed_rpm', 'depth_of_cut', 'seed'}
"""Declared first and last: who lacks one of them came in the middle, and lacks others too."""
_END = 2**63
"""ns since the epoch: no message is as late."""


@dataclass
class CutSession:
    """From one time zero of a lathe to the next: a start of its process, or a reset.

    Attributes:
        beginning: The sentence of its time zero, empty where the record has none.
        begun: When that was published, ns since the epoch; 0 where it is not known.
        events: Changes and knocks in the order in which they took effect.
        parameters: Of the lathe at time zero, by name; empty where the record does not say.
        noted: The same by what it answered when it was asked, as far as that is in the record.
        noted_at: When it answered, ns since the epoch.
        announced: The same by what it declared.
        contradictions: Where these, or the sentences of its log, do not fit; sentences.
        blocks: Its samples, among the blocks of a `Timeline`.
    """

    beginning: str = ''
    begun: int = 0
    events: list[Change | Knock] = field(default_factory=list)
    parameters: dict[str, Any] = field(default_factory=dict)
    noted: dict[str, Any] = field(default_factory=dict)
    noted_at: int = 0
    announced: dict[str, Any] = field(default_factory=dict)
    contradictions: list[str] = field(default_factory=list)
    blocks: slice = field(default_factory=lambda: slice(0, 0))
    _published: list[int] = field(default_factory=list)

    @property
    def changes(self) -> Iterator[Change]:
        """The changes of the cut, in order."""
        return (each for each in self.events if isinstance(each, Change))

    @property
    def at_its_end(self) -> dict[str, Any]:
        """Its parameters as the last of its changes left them; empty where they are not known."""
        values = dict(self.parameters)
        for change in self.changes if values else ():
            values |= _plain(change.new)
        return values

    def add(self, event: Change | Knock, published: int) -> None:
        """Something happened, published in ns since the epoch."""
        self.events.append(event)
        self._published.append(published)

    def split(self, published: int) -> CutSession:
        """Cut off, as a session of its own, what was published since a time."""
        place = bisect_left(self._published, published)
        later = CutSession(
            begun=published, events=self.events[place:], _published=self._published[place:]
        )
        del self.events[place:], self._published[place:]
        return later


@dataclass
class CutLog:
    """The sessions of one lathe.

    Attributes:
        sessions: One, and another for each reset and each new start.
    """

    sessions: list[CutSession] = field(default_factory=lambda: [CutSession()])
    _said: tuple[list[tuple[Parameters, int]], list[tuple[Parameters, int]]] = ([], [])

    @property
    def logged(self) -> bool:
        """Whether anything that the lathe logged is known."""
        return any(session.beginning or session.events for session in self.sessions)

    @property
    def contradictions(self) -> list[str]:
        """Of all sessions."""
        return [text for session in self.sessions for text in session.contradictions]

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
            self.sessions[-1].add(event, published)

    def assign_parameters(
        self,
        noted: Iterable[tuple[Parameters, int]],
        announced: Iterable[tuple[Parameters, int]] = (),
        *,
        believe_notes: bool = False,
    ) -> None:
        """Give each session the parameters that were in force at its time zero.

        Args:
            noted: What the lathe answered to who asked for its parameters, and when, ns since
                the epoch: at any time of a session.
            announced: What it declared, and when: before it says that it begins.
            believe_notes: Which of the two to believe where they do not fit.
        """
        noted, announced = self._said = list(noted), list(announced)
        begins = [(k, each) for k, each in enumerate(self.sessions)]
        starts = [k for k, each in begins if not k or each.beginning != BEGINNING_AGAIN]
        before = 0
        for first, after in pairwise([*starts, len(self.sessions)]):
            session = self.sessions[first]
            last = after == len(self.sessions)
            until = _END if last else self.sessions[after].begun
            for values, at in noted:
                if (session.begun if first else 0) <= at < until:
                    session.noted, session.noted_at = dict(values), at
                    break
            session.announced = {}
            for values, at in announced:
                if before < at <= (_END if last else session.begun):
                    session.announced |= values
            self._assign(self.sessions[first:after], believe_notes=believe_notes)
            before = session.begun

    def believe_notes(self) -> None:
        """Where what was noted and what was announced do not fit, believe what was noted."""
        self.assign_parameters(*self._said, believe_notes=True)

    def _assign(self, sessions: list[CutSession], *, believe_notes: bool) -> None:
        """To the sessions of one process, from what it said at some time."""
        # It may have been asked late: what the first change of a value replaced was there before.
        former: dict[str, Any] = {}
        for session in sessions:
            for change in session.changes:
                former = {**_plain(change.old), **former}
        first = sessions[0]
        first.noted = {**first.noted, **former} if first.noted else {}
        found = {**first.noted, **first.announced}
        if believe_notes:
            found |= first.noted
        for session in sessions:
            session.contradictions = []
        first.contradictions = [
            f'The parameters that were noted have {name} {first.noted[name]!r} at the start, and '
            f'the lathe announced {announced!r}.'
            for name, announced in first.announced.items()
            if _is_of_cut(name) and name in first.noted and first.noted[name] != announced
        ]
        values = found if found.keys() >= _NEEDED else {}
        for session in sessions:
            session.parameters = dict(values)
            for change in session.changes if values else ():
                for name, old in _plain(change.old).items():
                    if values.get(name, old) != old:
                        session.contradictions.append(
                            f'The log has {name} changed from {old!r} at {change.time:.6f} s, '
                            f'and by the rest of the record it was {values[name]!r}.'
                        )
                values |= _plain(change.new)


def _is_of_cut(name: str) -> bool:
    """Whether the log says when a parameter changes, or it cannot."""
    return name in Cut.__dataclass_fields__ or (name in LATHE and not LATHE[name].run_time)


def _plain(values: Parameters) -> dict[str, Any]:
    """As parameters are: a choice by its value."""
    return {name: getattr(value, 'value', value) for name, value in values.items()}


def logger_of(lathe: str) -> str:
    """The name under which a node, by its full name, logs."""
    return lathe.lstrip('/').replace('/', '.')
