"""The cuts of a lathe in a recorded run: its sessions, each with its samples and parameters."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from lathe_chatter.errors import MixedSamplesError, RunReadError
from lathe_chatter.recording.cut_log import CutLog, CutSession, Parameters, logger_of
from lathe_chatter.recording.decoding import decoded
from lathe_chatter.recording.provenance import PARAMETERS, parameter_history
from lathe_chatter.recording.run_timeline import Placed, Timeline, read_timeline

if TYPE_CHECKING:
    from lathe_chatter.recording.run import Run

LOG, _EVENTS = '/rosout', '/parameter_events'
_KINDS = {1: 'bool_value', 2: 'integer_value', 3: 'double_value', 4: 'string_value'}
_LATE = 1_000_000_000
"""ns by which samples are before the lathe says that it begins, where they are of another."""


@dataclass(frozen=True)
class RecordedCuts:
    """What a run has of a lathe.

    Attributes:
        log: Its sessions.
        timeline: The blocks of its samples.
        messages: Those of other topics that were asked for, in the order in which they came.
    """

    log: CutLog
    timeline: Timeline
    messages: list[Placed]

    def session_at(self, received: int) -> CutSession:
        """The session of the last samples that were received by a time, ns without steps.

        What the monitor says is of samples that have come, not of those after a reset.
        """
        block = max(int(np.searchsorted(self.timeline.received, received, 'right')) - 1, 0)
        for session in self.log.sessions:
            if session.blocks.start <= block < session.blocks.stop:
                return session
        return self.sampled[-1]

    @property
    def unseen(self) -> float:
        """For how long before the first samples changes of the cut are not in the record, s.

        Of a file of a run without those before it, the parameters are of the start of them all.
        """
        first = self.sampled[0]
        published = int(self.timeline.published[first.blocks.start])
        if first.beginning or not 0 < first.noted_at < published - _LATE:
            return 0.0
        return (published - first.noted_at) / 1e9

    @property
    def sampled(self) -> list[CutSession]:
        """The sessions of which there are samples."""
        return [each for each in self.log.sessions if each.blocks.start < each.blocks.stop]


def recorded_cuts(
    run: Run, lathe: str, others: Callable[[str], bool] = lambda _topic: False
) -> RecordedCuts:
    """What a run has of a lathe, by the full name of its node.

    Args:
        run: Which.
        lathe: As `/lathe`.
        others: Whether messages of another topic are wanted too.

    Raises:
        RunReadError: If a file is damaged.
        MixedSamplesError: If several lathes sent their samples at once.
        LayoutError: If a message is no block of samples.
    """
    timeline, found = read_timeline(
        run, f'{lathe}/samples', lambda topic: topic in (LOG, _EVENTS) or others(topic)
    )
    if math.isfinite(mixed := timeline.mixed_at):
        raise MixedSamplesError(f'{lathe}/samples', mixed)
    log, announced = CutLog(), []
    for each in found:
        if each.raw.topic not in (LOG, _EVENTS):
            continue
        message = message_of(each)
        _, published = timeline.steady(each)
        if each.raw.topic == LOG and message.name == logger_of(lathe):
            log.receive(message.msg, published)
        elif each.raw.topic == _EVENTS and message.node == lathe:
            announced.append((_declared(message), published))
    _assign_blocks(log, timeline)
    log.assign_parameters(_noted(run, lathe), announced)
    return RecordedCuts(log, timeline, [each for each in found if others(each.raw.topic)])


def message_of(found: Placed) -> Any:
    """The decoded message.

    Raises:
        RunReadError: If it cannot be decoded.
    """
    recorded = decoded(found.raw)
    if isinstance(recorded, str):
        raise RunReadError(recorded)
    return recorded.message


def _assign_blocks(log: CutLog, timeline: Timeline) -> None:
    """Give each session its samples, and add those of which the log has no word."""
    sessions = log.sessions
    begins = [timeline.block_at(session.begun) for session in sessions]
    begin, begun, published = begins[0], sessions[0].begun, timeline.published
    if begin:
        before = begun - int(published[0])
        # Where simulated time goes back just there they are, however short before.
        goes_back = begin in timeline.restarts and abs(begun - int(published[begin])) < before
        if goes_back or before > _LATE:
            sessions.insert(0, CutSession())
            begins.insert(0, 0)
    begins[0] = 0
    for block in timeline.restarts:
        if block not in begins:
            before = max(k for k, begun in enumerate(begins) if begun < block)
            later = sessions[before].split(int(timeline.published[block]))
            sessions.insert(before + 1, later)
            begins.insert(before + 1, int(block))
    begins = np.maximum.accumulate(begins).tolist()
    for session, start, stop in zip(
        sessions, begins, [*begins[1:], len(timeline.places)], strict=True
    ):
        session.blocks = slice(start, stop)


def _noted(run: Run, lathe: str) -> Iterator[tuple[Parameters, int]]:
    """As it was asked for them."""
    for note in run.notes():
        if note.name == PARAMETERS + lathe:
            yield from parameter_history(note.values)


def _declared(message: Any) -> Parameters:
    """What a node declared; what is set later is no declaration."""
    return {
        parameter.name: getattr(parameter.value, _KINDS[parameter.value.type])
        for parameter in message.new_parameters
        if parameter.value.type in _KINDS
    }
