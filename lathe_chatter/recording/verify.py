"""`verify`: whether a recorded run is complete, proven from the files and their payload."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, NamedTuple

from lathe_chatter.errors import LayoutError
from lathe_chatter.recording.identity import IDENTITY, RECEPTION, RECOVERED, STALLS
from lathe_chatter.recording.metadata import FILE_NAME
from lathe_chatter.recording.numbering import Numbering
from lathe_chatter.recording.reader import Run, read_run
from lathe_chatter.recording.recorded_file import Note, RecordedFile, offers_of
from lathe_chatter.recording.run_files import CLOSED
from lathe_chatter.recording.run_folder import run_folder
from lathe_chatter.recording.sample_blocks import SAMPLES_TYPE
from lathe_chatter.recording.sample_series import Seams
from lathe_chatter.recording.summary import body_is_sound, read_summary


class Finding(NamedTuple):
    """Something that is to be known about a run.

    Attributes:
        loss: Whether something is missing or damaged; else it is a remark.
        text: One sentence that names topic or file, and the interval.
    """

    loss: bool
    text: str


class SampleCount(NamedTuple):
    """The samples of a topic: how many, and the simulated times of the first and last, s."""

    samples: int
    first: float
    last: float


@dataclass
class Verification:
    """What was found in a run.

    Attributes:
        run: Which.
        messages: By name of topic.
        samples: By name of topic.
        findings: Losses and remarks.
        finished: Whether its recorder came to an end, or is not ours to tell.
    """

    run: Run
    messages: Counter[str] = field(default_factory=Counter)
    samples: dict[str, SampleCount] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)
    finished: bool = True

    @property
    def missing(self) -> set[str]:
        """Names of files that are not there."""
        return {damage.file.name for damage in self.run.damage if not damage.end}

    @property
    def complete(self) -> bool:
        """Whether nothing is missing or damaged."""
        return not any(finding.loss for finding in self.findings)

    def lose(self, text: str) -> None:
        """Something is missing or damaged."""
        self.findings.append(Finding(loss=True, text=text))

    def remark(self, text: str) -> None:
        """Something is worth knowing."""
        self.findings.append(Finding(loss=False, text=text))


def verify(path: Path | str) -> Verification:
    """Look at every byte of a run, also one of another recorder, and at what its payload tells.

    Raises:
        RunReadError: If there is no such run.
    """
    found = Verification(read_run(path, damaged=True))
    numberings = _check_messages(found)
    _check_files(found)
    _check_samples(found)
    notes = found.run.notes()
    _check_end(found, notes)
    _check_order(found)
    _check_metadata(found)
    _check_reception(found, notes, numberings)
    return found


def _check_messages(found: Verification) -> dict[str, Numbering]:
    """Read all there is, and follow the numbers that publishers gave."""
    numberings: dict[str, Numbering] = {}
    for raw in found.run.raw_messages():
        found.messages[raw.topic] += 1
        if raw.sequence:
            numbering = numberings.setdefault(raw.topic, Numbering())
            numbering.take(raw.sequence, raw.log_time / 1e9)
    publishers = _publishers(found.run)
    for topic, numbering in sorted(numberings.items()):
        numbering.settle(publishers.get(topic, 1), math.inf)
        for loss in numbering.losses:
            found.lose(
                f'{topic}: {loss.messages} messages are missing between {_clock(loss.since)} and '
                f'{_clock(loss.until)}.'
            )
        if numbering.before and publishers.get(topic, 1) == 1:
            found.remark(
                f'{topic}: the record begins with message {numbering.before + 1} of its publisher.'
            )
    return numberings


def _publishers(run: Run) -> dict[str, int]:
    """How many publishers each topic had when it was found."""
    numbers: dict[str, int] = {}
    for path in run.files:
        for channel in RecordedFile(path, lambda _damage: None).known.channels.values():
            numbers[channel.topic] = max(len(offers_of(channel)), 1)
    return numbers


def _check_files(found: Verification) -> None:
    """Every file to its last byte, and that none is missing."""
    for damage in found.run.damage:
        found.lose(str(damage))
    for path in found.run.files:
        summary = read_summary(path)
        if summary is None:
            found.lose(f'{path.name} has no sound summary: readers that need one refuse it.')
        elif not body_is_sound(path, summary):
            found.lose(f'{path.name} is not, byte for byte, what was written.')
    if found.run.path.is_dir():
        folder = run_folder(found.run.path)
        if folder.metadata is None:
            found.lose(f'{found.run.path / FILE_NAME} is missing or damaged.')
        for name in folder.strangers:
            found.remark(f'{name} is in the folder, and of another run: it was not looked at.')


def _check_samples(found: Verification) -> None:
    """That the samples follow each other, by their own times."""
    for topic, kind in sorted(found.run.topics.items()):
        if kind != SAMPLES_TYPE or not topic.endswith('/samples'):
            continue
        seams = Seams()
        count, first, last = 0, math.nan, math.nan
        try:
            for block in found.run.sample_blocks(topic):
                times = block.samples[:, block.columns.index('time')]
                if not len(times):
                    continue
                seams.follow(times)
                first = float(times[0]) if not count else first
                last = float(times[-1])
                count += len(times)
        except (LayoutError, ValueError) as error:
            found.lose(f'{topic}: {error}')
        found.samples[topic] = SampleCount(count, first, last)
        late = round(first / seams.step) - 1 if count and seams.step else 0
        if late > 0:
            found.remark(
                f'{topic}: the record begins at {first:.6f} s of simulated time, {late} samples '
                'late.'
            )
        for before, after in seams.gaps:
            missing = round((after - before) / seams.step) - 1
            found.lose(
                f'{topic}: {missing} samples are missing between {before:.6f} s and {after:.6f} s '
                'of simulated time.'
            )
        for before, after in seams.restarts:
            found.remark(
                f'{topic}: simulated time goes back from {before:.6f} s to {after:.6f} s: the '
                'lathe was reset or started again.'
            )


def _check_end(found: Verification, notes: list[Note]) -> None:
    """That the recorder finished, and all its files are there."""
    ours = any(note.name == IDENTITY for note in notes)
    ends = [note.values for note in notes if note.name == CLOSED]
    if ours and (not ends or len(ends) < len(found.run.files) or ends[-1].get('next')):
        last = max((count.last for count in found.samples.values()), default=math.nan)
        where = '' if math.isnan(last) else f', the last sample is of {last:.6f} s'
        found.finished = False
        found.lose(f'The recorder did not finish: what came at the end is not there{where}.')
    for note in notes:
        if note.name == RECOVERED:
            found.lose(f'This run was recovered from {note.values.get("from", "another")}.')
            for text in _values(note, 'damage') or ():
                found.lose(f'Before the recovery: {text}')


def _check_order(found: Verification) -> None:
    """That each file goes on in the next, as its writer noted at its end."""
    files = found.run.files
    for path, following in zip(files, (*files[1:], None), strict=True):
        nexts = [note.values.get('next', '') for note in _notes_of(path) if note.name == CLOSED]
        name = following.name if following else ''
        if not nexts or nexts[-1] == name or nexts[-1] in found.missing:
            continue
        if nexts[-1] and not following:
            found.lose(f'{nexts[-1]} is missing, in which the run went on.')
        else:
            goes_on = f'goes on in {nexts[-1]}' if nexts[-1] else 'is the last'
            found.lose(f'{path.name} {goes_on}, and here {name} follows: names were changed.')


def _notes_of(path: Path) -> list[Note]:
    return list(RecordedFile(path, lambda _damage: None).notes())


def _check_metadata(found: Verification) -> None:
    """That metadata.yaml counts what is there; of a run that was not finished it may be older."""
    if not found.run.path.is_dir() or not found.finished:
        return
    metadata = run_folder(found.run.path).metadata or {}
    told: dict[str, int] = {}
    try:
        for entry in metadata.get('topics_with_message_count') or ():
            name = str(entry['topic_metadata']['name'])
            told[name] = told.get(name, 0) + int(entry['message_count'])
    except (KeyError, TypeError, ValueError):
        found.lose(f'{FILE_NAME} does not count the messages of each topic.')
        return
    for name in sorted({*told, *found.messages} if metadata else ()):
        if told.get(name, 0) != found.messages[name]:
            found.lose(
                f'{FILE_NAME} counts {told.get(name, 0)} messages of {name}, and '
                f'{found.messages[name]} are there.'
            )


def _check_reception(
    found: Verification, notes: list[Note], numberings: Mapping[str, Numbering]
) -> None:
    """What the recorder itself says was lost on the way to it."""
    for note in notes:
        if note.name != RECEPTION:
            continue
        for topic in note.values:
            heard = _values(note, topic)
            if topic == STALLS and heard:
                found.remark(f'The recorder stood still {heard} times.')
            if not isinstance(heard, dict):
                continue
            lost, there = heard.get('lost', 0), found.messages[topic]
            if lost > numberings.get(topic, Numbering()).lost:
                found.lose(f'{topic}: the recorder missed {lost} messages on the way to it.')
            if heard.get('messages', there) != there:
                found.lose(
                    f'{topic}: {heard["messages"]} messages were recorded, and {there} are there.'
                )


def _values(note: Note, name: str) -> Any:
    """What a note holds as JSON; None where it is damaged, which the CRC of the body tells."""
    try:
        return json.loads(note.values[name])
    except (KeyError, ValueError):
        return None


def _clock(seconds: float) -> str:
    """A time of reception for people, UTC."""
    return f'{datetime.fromtimestamp(seconds, timezone.utc):%H:%M:%S.%f} UTC'
