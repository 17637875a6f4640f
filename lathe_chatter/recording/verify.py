"""`verify`: whether a recorded run is complete, proven from the files and their payload."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lathe_chatter.array_types import Array, Integers
from lathe_chatter.errors import LayoutError
from lathe_chatter.recording.clock_steps import CLOCK, noted_steps, step_sentence, steps_back
from lathe_chatter.recording.file_completeness import (
    check_end,
    check_files,
    check_order,
    noted,
)
from lathe_chatter.recording.metadata_yaml_check import check_metadata
from lathe_chatter.recording.provenance import (
    LONGEST_STALL,
    PUBLISHERS,
    RECEPTION,
    STALLS,
    noted_pauses,
)
from lathe_chatter.recording.recorded_file import Note, offered_qos
from lathe_chatter.recording.recorder_stalls import STALL
from lathe_chatter.recording.run import Run, read_run
from lathe_chatter.recording.sequence_gaps import Numbering
from lathe_chatter.recording.verification_result import Finding, SampleCount, Verification
from lathe_chatter.samples.continuity import Continuity, missing_in, time_text
from lathe_chatter.samples.mixed_streams import MixedContinuity

__all__ = ['Finding', 'SampleCount', 'Verification', 'verify']

_MANY = 5
"""Places of one kind up to which each has its sentence."""

Progress = Callable[[int], None]
"""Told how many messages have been looked at since it was told last."""


def verify(path: Path | str, progress: Progress = lambda _count: None) -> Verification:
    """Look at every byte of a run, also one of another recorder, and at what its payload tells.

    Args:
        path: A folder or a file.
        progress: Told of every message once, and again of those with samples.

    Raises:
        RunReadError: If there is no such run.
    """
    found = Verification(read_run(path, damaged=True))
    numberings = _check_messages(found, progress)
    check_files(found)
    _check_samples(found, progress)
    notes = found.run.notes()
    check_end(found, notes)
    check_order(found)
    check_metadata(found)
    _check_reception(found, notes, numberings)
    return found


def _check_messages(found: Verification, progress: Progress) -> dict[str, Numbering]:
    """Read all there is, and follow the numbers that publishers gave."""
    heads: dict[str, list[NDArray[Any]]] = {}
    for file in found.run.opened:
        damages, there = len(found.run.damage), 0
        for contents in file.contents():
            part = contents.messages.heads
            there += len(part)
            for number in np.unique(part['channel']).tolist():
                channel = file.known.channels.get(number)
                if channel is not None:  # else told as damage
                    of_it = part[part['channel'] == number][['sequence', 'log_time']]
                    heads.setdefault(channel.topic, []).append(of_it)
            progress(len(part))
        counted = file.known.statistics
        undamaged = len(found.run.damage) == damages
        if counted is not None and undamaged and counted.message_count != there:
            found.add_loss(
                f'The summary of {file.path.name} counts {counted.message_count} messages, and '
                f'{there} are there.'
            )
    publishers = _publishers(found.run)
    numberings: dict[str, Numbering] = {}
    for topic in sorted(heads):
        of_it = np.concatenate(heads[topic])
        found.messages[topic] = len(of_it)
        found.last[topic] = int(of_it['log_time'].max())
        numbered = of_it[of_it['sequence'] > 0]
        if len(numbered):
            numbering = numberings[topic] = _numbering(numbered)
            numbering.settle(publishers.get(topic, 1), math.inf)
            _report_numbering(found, topic, numbering, publishers.get(topic, 1))
    return numberings


def _numbering(heads: NDArray[Any]) -> Numbering:
    """The numbers of a topic followed as they were written, or as received if that fits better."""
    received = heads[np.argsort(heads['log_time'], kind='stable')]
    if _steps_back(received) < _steps_back(heads):
        heads = received
    numbering = Numbering()
    times = heads['log_time'].astype(float) / 1e9
    numbering.take_many(heads['sequence'].astype(np.int64), times)
    return numbering


def _steps_back(heads: NDArray[Any]) -> int:
    return int(np.count_nonzero(heads['sequence'][1:] < heads['sequence'][:-1]))


def _report_numbering(
    found: Verification, topic: str, numbering: Numbering, publishers: int
) -> None:
    """Say what the numbers of a topic say is missing."""
    pauses = [(begin / 1e9, end / 1e9) for begin, end in noted_pauses(found.run.notes(), 'clock')]
    losses = [
        loss
        for loss in numbering.losses
        if not any(begin <= loss.until and loss.since <= end for begin, end in pauses)
    ]
    missing = sum(loss.messages for loss in losses)
    if len(losses) > _MANY:
        found.add_loss(
            f'{topic}: {missing} messages are missing in {len(losses)} places between '
            f'{_clock(losses[0].since)} and {_clock(losses[-1].until)}, '
            f'{max(loss.messages for loss in losses)} of them in one.'
        )
    else:
        for loss in losses:
            found.add_loss(
                f'{topic}: {loss.messages} messages are missing between {_clock(loss.since)} and '
                f'{_clock(loss.until)}.'
            )
    if numbering.before and publishers == 1:
        found.remark(
            f'{topic}: the record begins with message {numbering.before + 1} of its publisher.'
        )


def _publishers(run: Run) -> dict[str, int]:
    """How many publishers each topic had when it was found, or in all where that was noted."""
    numbers: dict[str, int] = {}
    for file in run.opened:
        for channel in file.known.channels.values():
            numbers[channel.topic] = max(len(offered_qos(channel)), 1)
    for note in run.notes():
        for topic in note.values if note.name == PUBLISHERS else ():
            count = noted(note, topic)
            if isinstance(count, int):
                numbers[topic] = max(count, numbers.get(topic, 1))
    return numbers


def _check_samples(found: Verification, progress: Progress) -> None:
    """That the samples follow each other, by their own times."""
    for topic in found.run.samples_topics():
        continuity = MixedContinuity(remember=True)
        count, first, last, strange = 0, math.nan, math.nan, 0
        received: list[Integers] = [np.zeros(0, np.int64)]
        spans: list[Array] = [np.zeros((2, 0))]
        try:
            for block in found.run.sample_blocks(topic, columns=()):
                progress(len(block.rows))
                received.append(block.log_times)
                spans.append(block.spans)
                times = block.times
                if not len(times):
                    continue
                strange += int(np.count_nonzero(~np.isfinite(times)))
                continuity.follow(times)
                first = float(times[0]) if not count else first
                last = float(times[-1])
                count += len(times)
        except (LayoutError, ValueError) as error:
            found.add_loss(f'{topic}: {error} What comes after it was not looked at.')
        found.samples[topic] = SampleCount(count, first, last)
        _report_steps(found, topic, np.concatenate(received), np.hstack(spans))
        if strange:
            found.add_loss(f'{topic}: the times of {strange} samples are no numbers.')
        late = missing_in((0.0, first), continuity.step) if count and continuity.step else 0
        if late > 0:
            found.remark(
                f'{topic}: the record begins at {time_text(first)} of simulated time, '
                f'{late} samples late.'
            )
        if continuity.mixed:
            found.add_loss(
                f'{topic}: samples of several publishers are mixed, first at '
                f'{time_text(continuity.mixed_from)} and last at '
                f'{time_text(continuity.mixed_until)} of simulated time, which goes to and fro '
                f'{continuity.mixed} times there: whether any are missing cannot be told.'
            )
        _report_breaks(found, topic, continuity)


def _report_steps(found: Verification, topic: str, received: Integers, spans: Array) -> None:
    """Say where the clock was set back that dates samples, unless the recorder has noted it.

    Where simulated time goes back too, a writer may have dated its samples by that.
    """
    if any(note.name == CLOCK for note in found.run.notes()):
        return
    places, sizes = steps_back(received)
    for place, size in zip(places.tolist(), sizes.tolist(), strict=True):
        if spans[0, place + 1] <= spans[1, place]:
            continue
        said = step_sentence(size / 1e9)
        found.remark(f'{topic}: at {_clock(int(received[place]) / 1e9)} {said}')


def _report_breaks(found: Verification, topic: str, continuity: Continuity) -> None:
    """Say where samples do not follow those before: where there are many places, in short."""
    pauses = noted_pauses(found.run.notes(), topic)
    gaps, restarts = continuity.gap_places, continuity.restart_places
    if pauses:
        left_out = [gap for gap in gaps if gap in pauses]
        gaps = [gap for gap in gaps if gap not in pauses]
        found.remark(
            f'{topic}: {sum(after - before for before, after in left_out):.6f} s of simulated '
            f'time were left out in {len(left_out)} pauses of the recorder.'
        )
    if len(gaps) > _MANY:
        longest = max(gaps, key=lambda gap: gap[1] - gap[0])
        found.add_loss(
            f'{topic}: {continuity.lost} samples are missing in {len(gaps)} gaps between '
            f'{time_text(gaps[0][0])} and {time_text(gaps[-1][1])} of simulated time, most of '
            f'them, {missing_in(longest, continuity.step)}, between {time_text(longest[0])} and '
            f'{time_text(longest[1])}.'
        )
        gaps = []
    for gap in gaps:
        found.add_loss(
            f'{topic}: {missing_in(gap, continuity.step) or "some"} samples are missing '
            f'between {time_text(gap[0])} and {time_text(gap[1])} of simulated time.'
        )
    if len(restarts) > _MANY:
        found.remark(
            f'{topic}: simulated time goes back {len(restarts)} times between '
            f'{time_text(restarts[0][0])} and {time_text(restarts[-1][1])}: the lathe was reset '
            'or started again.'
        )
        restarts = []
    for before, after in restarts:
        found.remark(
            f'{topic}: simulated time goes back from {time_text(before)} to '
            f'{time_text(after)}: the lathe was reset or started again.'
        )


def _check_reception(
    found: Verification, notes: list[Note], numberings: Mapping[str, Numbering]
) -> None:
    """What the recorder itself says was lost on the way to it."""
    for note in notes:
        for step in noted_steps(note.values) if note.name == CLOCK else ():
            found.remark(f'At {_clock(step.before / 1e9)} {step_sentence(step.seconds)}')
        if note.name != RECEPTION:
            continue
        for topic in note.values:
            heard = noted(note, topic)
            if topic == STALLS and heard:
                times = 'once' if heard == 1 else f'{heard} times'
                longest = note.values.get(LONGEST_STALL, 'an unknown number of')
                found.remark(
                    f'The recorder took no messages for more than {STALL:g} s {times}, '
                    f'for {longest} s at most; what was lost by it, if anything, is told by topic.'
                )
            if not isinstance(heard, dict):
                continue
            lost, there = heard.get('lost', 0), found.messages[topic]
            if lost > numberings.get(topic, Numbering()).lost:
                found.add_loss(f'{topic}: the recorder missed {lost} messages on the way to it.')
            if heard.get('messages', there) + heard.get('repeated', 0) != there:
                found.add_loss(
                    f'{topic}: {heard["messages"]} messages were recorded, and {there} are there.'
                )


def _clock(seconds: float) -> str:
    """A time of reception for people, UTC."""
    return f'{datetime.fromtimestamp(seconds, timezone.utc):%H:%M:%S.%f} UTC'
