"""Whether all files of a run are there, in order, whole, and as their writer left them."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from lathe_chatter.recording.crash_safe_counters import FILE_NAME as UNFINISHED
from lathe_chatter.recording.crash_safe_counters import taken
from lathe_chatter.recording.metadata_yaml import FILE_NAME
from lathe_chatter.recording.provenance import ENDED_EARLY, IDENTITY, RECOVERED
from lathe_chatter.recording.recorded_file import Note
from lathe_chatter.recording.run import Run
from lathe_chatter.recording.split_file_writer import CLOSED
from lathe_chatter.recording.verification_result import Finding, Verification

_STILL = 'The run is still being recorded: this is what is on disk of it.'


def check_files(found: Verification) -> None:
    """Every file to its last byte, and that none is missing."""
    for damage in found.run.damage:
        found.add_loss(str(damage))
    for file in found.run.opened:
        name = file.path.name
        if not file.has_end:
            found.add_loss(f'{name} has no sound summary: readers that need one refuse it.')
            continue
        if file.proof is False:
            found.add_loss(f'{name} is not, byte for byte, what was written.')
        elif file.proof is None:
            what = 'any of it' if file.unproven else 'what stands outside of its chunks'
            found.remark(
                f'{name} has no CRC of its data: whether {what} was altered cannot be told.'
            )
        for text in file.contradictions():
            found.add_loss(f'{name}: {text}.')
    folder = found.run.folder
    if folder is not None:
        if folder.metadata is None:
            found.add_loss(f'{found.run.path / FILE_NAME} is missing or damaged.')
        for name in folder.strangers:
            found.remark(f'{name} is in the folder, and of another run: it was not looked at.')


def check_end(found: Verification, notes: list[Note]) -> None:
    """That the recorder finished, and all its files are there."""
    end = max((count.last for count in found.samples.values()), default=math.nan)
    for text in lost_at_the_end(found.run, found.messages, found.last, end):
        found.finished = False
        if text == _STILL:
            found.findings.append(Finding(loss=False, text=text, unproven=True))
        else:
            found.add_loss(text)
    for note in notes:
        if note.name == ENDED_EARLY:
            found.add_loss(f'The run ended early. {note.values.get("reason", "")}'.strip())
        if note.name == RECOVERED:
            lost = noted(note, 'damage') or ()
            said = f'This run was recovered from {note.values.get("from", "another")}.'
            (found.add_loss if lost else found.remark)(said)
            for text in lost:
                found.add_loss(f'Before the recovery: {text}')


def lost_at_the_end(
    run: Run, messages: Mapping[str, int], last: Mapping[str, int], end: float = math.nan
) -> list[str]:
    """What a recorder that did not finish had taken, and is not there, as sentences.

    Args:
        run: Of the recorder.
        messages: That are there, by name of topic.
        last: When the last of them was received, ns since the epoch.
        end: Simulated time of the last sample that is there, s.

    Returns:
        None at all where the recorder did finish.
    """
    counts = taken(run.path) if run.folder else {}
    notes = run.notes()
    ours = (run.path / UNFINISHED).exists() or any(note.name == IDENTITY for note in notes)
    if any(file.being_written for file in run.opened):
        return [_STILL]
    ends = [note.values for note in notes if note.name == CLOSED]
    if not ours or (len(ends) >= len(run.files) and not ends[-1].get('next')):
        return []
    names: dict[int, str] = {}
    for file in run.opened:
        names |= {number: channel.topic for number, channel in file.known.channels.items()}
    found: list[str] = []
    for channel, (count, when) in sorted(counts.items()):
        name = names.get(channel, '')
        lost = count - messages.get(name, 0)
        if lost > 0 and name in last:
            span = f'in the last {(when - last[name]) / 1e9:.3f} s'
            found.append(f'{name}: {lost} messages that had come are not there, {span}.')
        elif lost > 0:
            named = name or 'a topic that is not there either'
            found.append(f'{named}: none of the {lost} messages that had come are there.')
    missing = found or not counts
    what = 'what came at the end is not there' if missing else 'all that it had taken is there'
    where = '' if math.isnan(end) else f', the last sample is of {end:.6f} s'
    return [*found, f'The recorder did not finish: {what}{where}.']


def check_order(found: Verification) -> None:
    """That each file goes on in the next, as its writer noted at its end."""
    files = found.run.files
    for file, following in zip(found.run.opened, (*files[1:], None), strict=True):
        path = file.path
        nexts = [note.values.get('next', '') for note in file.notes() if note.name == CLOSED]
        name = following.name if following else ''
        if not nexts or nexts[-1] == name or nexts[-1] in found.missing:
            continue
        if nexts[-1] and not following and (path.parent / nexts[-1]).exists():
            continue  # it was begun since
        if nexts[-1] and not following:
            found.add_loss(f'{nexts[-1]} is missing, in which the run went on.')
        else:
            goes_on = f'goes on in {nexts[-1]}' if nexts[-1] else 'is the last'
            found.add_loss(f'{path.name} {goes_on}, and here {name} follows: names were changed.')


def noted(note: Note, name: str) -> Any:
    """What a note holds as JSON; None where it is damaged, which the CRC of the body tells."""
    try:
        return json.loads(note.values[name])
    except (KeyError, ValueError):
        return None
