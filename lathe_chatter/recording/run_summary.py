"""The closing summary of a run: what it holds and what happened, in the run itself."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

from lathe_chatter.errors import LatheChatterError
from lathe_chatter.lathe.cut_events import Change
from lathe_chatter.model import BearingContact, Cut, Machine
from lathe_chatter.model.parameters import cut_from, machine_from
from lathe_chatter.recording.cut_session import Journal, SamplesHeard

SUMMARY = 'lathe_chatter/summary'
"""Name of the record; every value is JSON."""


def closing_summary(
    journal: Journal, parameters: Mapping[str, Sequence[tuple[Mapping[str, Any], int]]]
) -> dict[str, str]:
    """What to note at the end of a run.

    Args:
        journal: Of the run.
        parameters: Of lathes, by the full names of their nodes: what each told, and when, ns
            since the epoch.
    """
    values: dict[str, Any] = {
        'messages': dict(sorted(journal.messages.items())),
        'samples': {topic: _samples(heard) for topic, heard in journal.samples.items()},
        'chatter': [
            {'time': time, 'topic': topic, 'flag': up} for time, topic, up in journal.flags
        ],
        'linear_model': {
            topic: _verdicts(journal, topic, parameters.get(topic.removesuffix('/samples'), ()))
            for topic in journal.samples
        },
    }
    return {name: json.dumps(value) for name, value in values.items()}


def _samples(heard: SamplesHeard) -> dict[str, Any]:
    counted = heard.continuity
    return {
        'samples': counted.samples,
        'first': heard.first,
        'last': counted.last,
        'head': heard.head,
        'lost': counted.lost,
        'gaps': counted.gaps,
        'restarts': counted.restarts,
        'silences': heard.silences,
        'longest_silence': heard.longest,
        'complaint': heard.complaint,
    }


def _verdicts(
    journal: Journal, topic: str, told: Sequence[tuple[Mapping[str, Any], int]]
) -> list[dict[str, Any]]:
    """Of each cut of a lathe, in order: what the linear model says of it."""
    starts = journal.starts_of(topic.removesuffix('/samples'))
    verdicts: list[dict[str, Any]] = []
    for k, start in enumerate(starts):
        since = start.begun if k else 0
        until = starts[k + 1].begun if k + 1 < len(starts) else math.inf
        parameters = next((values for values, at in told if since <= at < until), None)
        if parameters is not None:
            verdicts += _verdicts_since(parameters, start.changes)
    return verdicts


def _verdicts_since(
    parameters: Mapping[str, Any], changes: Sequence[Change]
) -> list[dict[str, Any]]:
    """Of each cut since a start of a lathe."""
    try:
        machine, cut = machine_from(parameters), cut_from(parameters)
        for change in reversed(changes):  # the parameters may have been told after some
            cut = cut.with_changes(**change.old)
        verdicts = [_verdict(0.0, machine, cut)]
        for change in changes:
            cut = cut.with_changes(**change.new)
            verdicts.append(_verdict(change.time, machine, cut))
    except LatheChatterError as error:
        return [{'error': str(error)}]
    return verdicts


def _verdict(time: float, machine: Machine, cut: Cut) -> dict[str, Any]:
    """Growth rate, 1/s, and frequency, Hz, of the rightmost root, open and on the bearing."""
    # Not at the top: the monitor and the recorder would load it at their start.
    from lathe_chatter.stability import rightmost_root

    told: dict[str, Any] = {
        'time': time,
        'spindle_speed_rpm': cut.spindle_speed_rpm,
        'depth_of_cut': cut.depth_of_cut,
    }
    for name, seated in (('open', False), ('seated', True)):
        if seated and cut.bearing_contact is BearingContact.NONE:
            continue
        root = rightmost_root(machine, cut.spindle_speed_rpm, cut.depth_of_cut, seated=seated)
        told[name] = {
            'growth_rate': root.real,
            'frequency': root.imag / (2.0 * math.pi),
            'stable': root.real < 0.0,
        }
    return told
