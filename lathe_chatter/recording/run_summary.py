"""The closing summary of a run: what it holds and what happened, in the run itself."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Any

from lathe_chatter.errors import LatheChatterError
from lathe_chatter.model import BearingContact, Cut, Machine
from lathe_chatter.model.lathe_parameter_table import cut_from, machine_from
from lathe_chatter.recording.cut_log import CutSession
from lathe_chatter.recording.provenance import ENDED_EARLY
from lathe_chatter.recording.recording_statistics import RunLog, SamplesReceived
from lathe_chatter.recording.run_writer import RunWriter

SUMMARY = 'lathe_chatter/summary'
"""Name of the record; every value is JSON."""
_COMPILING = (
    'All messages are on disk; for the closing summary something is compiled, once for each '
    'installation: half a minute at most ...'
)


def note_end(
    writer: RunWriter,
    log: RunLog,
    parameters: Mapping[str, Sequence[tuple[Mapping[str, Any], int]]],
    ended_early: str = '',
    say: Callable[[str], object] = lambda _sentence: None,
) -> None:
    """Note what a run holds, and what happened, before it is closed.

    Args:
        writer: Of the run.
        log: Of the run.
        parameters: As for `closing_summary`.
        ended_early: Why it has not all that it was to have, a sentence; else empty.
        say: Is told in a sentence where it takes long.

    Raises:
        OSError: If the disk refuses.
    """
    if ended_early:
        writer.note(ENDED_EARLY, {'reason': ended_early})
    told: AbstractContextManager[None] = nullcontext()
    if log.samples:
        # Not at the top: a recorder would load Numba at its start.
        from lathe_chatter.compiled import before_compiling

        told = before_compiling(lambda: say(_COMPILING))
    with told:
        writer.note(SUMMARY, closing_summary(log, parameters))


def closing_summary(
    log: RunLog, parameters: Mapping[str, Sequence[tuple[Mapping[str, Any], int]]]
) -> dict[str, str]:
    """What to note at the end of a run.

    Args:
        log: Of the run.
        parameters: Of lathes, by the full names of their nodes: what each said, and when, ns
            since the epoch.
    """
    values: dict[str, Any] = {
        'messages': dict(sorted(log.messages.items())),
        'samples': {topic: _samples(received) for topic, received in log.samples.items()},
        'chatter': [{'time': time, 'topic': topic, 'flag': up} for time, topic, up in log.flags],
        'linear_model': {
            topic: _verdicts(log, topic, parameters.get(topic.removesuffix('/samples'), ()))
            for topic in log.samples
        },
    }
    return {name: json.dumps(value) for name, value in values.items()}


def _samples(received: SamplesReceived) -> dict[str, Any]:
    counted = received.continuity
    return {
        'samples': counted.samples,
        'first': received.first,
        'last': counted.last,
        'head': received.head,
        'lost': counted.lost,
        'gaps': counted.gaps,
        'restarts': counted.restarts,
        'silences': received.silences,
        'longest_silence': received.longest,
        'complaint': received.mixture or received.complaint,
    }


def _verdicts(
    log: RunLog, topic: str, noted: Sequence[tuple[Mapping[str, Any], int]]
) -> list[dict[str, Any]]:
    """Of each cut of a lathe, in order: what the linear model says of it."""
    cut_log = log.cut_log_of(topic.removesuffix('/samples'))
    cut_log.assign_parameters(noted)
    received = log.samples[topic]
    begins = [received.first or 0.0 if received.head else 0.0]
    begins += [0.0] * (len(cut_log.sessions) - 1)
    return [
        verdict
        for session, begin in zip(cut_log.sessions, begins, strict=True)
        for verdict in _verdicts_in(session, begin)
    ]


def _verdicts_in(session: CutSession, begin: float) -> list[dict[str, Any]]:
    """Of each cut of a session, of which there are samples from some time on, s."""
    if not session.parameters:
        return []
    try:
        machine, cut = machine_from(session.parameters), cut_from(session.parameters)
        verdicts = [_verdict(begin, machine, cut)]
        for change in session.changes:
            cut = cut.with_changes(**change.new)
            verdicts.append(_verdict(change.time, machine, cut))
    except LatheChatterError as error:
        return [{'error': str(error)}]
    return verdicts


def _verdict(time: float, machine: Machine, cut: Cut) -> dict[str, Any]:
    """Growth rate, 1/s, and frequency, Hz, of the rightmost root, open and on the bearing."""
    # Not at the top: the monitor and the recorder would load it at their start.
    from lathe_chatter.stability import root_of

    verdict: dict[str, Any] = {
        'time': time,
        'spindle_speed_rpm': cut.spindle_speed_rpm,
        'depth_of_cut': cut.depth_of_cut,
    }
    for name, seated in (('open', False), ('seated', True)):
        if seated and cut.bearing_contact is BearingContact.NONE:
            continue
        root = root_of(machine, cut, seated=seated)
        verdict[name] = {
            'growth_rate': root.real,
            'frequency': root.imag / (2.0 * math.pi),
            'stable': root.real < 0.0,
        }
    return verdict
