"""`recover`: every whole chunk of a damaged run into a new one."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import NamedTuple

from lathe_chatter.recording.atomic_output import atomic_folder
from lathe_chatter.recording.completeness import lost_at_the_end
from lathe_chatter.recording.mcap_reader import Damage
from lathe_chatter.recording.provenance import RECOVERED
from lathe_chatter.recording.raw_messages import raw_of
from lathe_chatter.recording.run import Run, read_run
from lathe_chatter.recording.run_file import RecordedFile, offers_of
from lathe_chatter.recording.split_files import CLOSED
from lathe_chatter.recording.writer import RunWriter, Topic

_NOT_COPIED = (CLOSED, 'rosbag2')
"""Notes that a writer makes itself."""


class Recovery(NamedTuple):
    """What became of a damaged run.

    Attributes:
        run: The new one.
        messages: Saved, by name of topic.
        damage: What could not be read of the old one.
        lost: What its recorder had taken and is in no file, as sentences.
    """

    run: Run
    messages: Counter[str]
    damage: list[Damage]
    lost: list[str]


def recover(path: Path | str, output: Path) -> Recovery:
    """Save what is sound of a run; the original is only read.

    Args:
        path: The run, a folder or a file.
        output: The folder to make.

    Raises:
        RunReadError: If there is no such run.
        RunExistsError: If the folder to make exists.
        OSError: If it cannot be written.
    """
    old = read_run(path, damaged=True)
    saved: Counter[str] = Counter()
    last: dict[str, int] = {}
    damage: list[Damage] = [*old.damage]
    with atomic_folder(output), RunWriter(output) as writer:
        for place, file in enumerate(old.files):
            if place:
                writer.split()
            _copy(RecordedFile(file, damage.append), writer, saved, last)
        lost = lost_at_the_end(old, saved, last)
        said = json.dumps([*map(str, damage), *lost])
        writer.note(RECOVERED, {'from': str(old.path), 'damage': said})
    return Recovery(read_run(output), saved, damage, lost)


def _copy(
    file: RecordedFile, writer: RunWriter, saved: Counter[str], last: dict[str, int]
) -> None:
    """Copy what one file holds, counting messages and noting when the last was received."""
    for note in file.notes():
        if note.name not in _NOT_COPIED:
            writer.note(note.name, note.values)
    for attachment in file.attachments():
        writer.attach(attachment.name, attachment.media_type, attachment.data)
    for contents in file.contents():
        for raw in raw_of(file, contents.messages):
            writer.add_topic(_topic(file, raw.topic))
            writer.write(
                raw.topic,
                raw.data,
                log_time=raw.log_time,
                publish_time=raw.publish_time,
                sequence=raw.sequence,
            )
            saved[raw.topic] += 1
            last[raw.topic] = max(raw.log_time, last.get(raw.topic, 0))
        writer.commit()


def _topic(file: RecordedFile, name: str) -> Topic:
    """What a topic is, as the file describes it."""
    channel = next(c for c in file.known.channels.values() if c.topic == name)
    schema = file.known.schemas[channel.schema_id]
    return Topic(
        name,
        schema.name,
        schema.data.decode(),
        channel.metadata.get('topic_type_hash', ''),
        tuple(offers_of(channel)),
    )
