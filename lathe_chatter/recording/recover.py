"""`recover`: every whole chunk of a damaged run into a new one."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from lathe_chatter.atomic_output import atomic_output
from lathe_chatter.errors import NothingSavedError, RunExistsError
from lathe_chatter.recording.file_completeness import lost_at_the_end
from lathe_chatter.recording.mcap_chunk_walk import Damage
from lathe_chatter.recording.metadata_yaml import Topic
from lathe_chatter.recording.open_chunk import OpenChunk, record_bytes
from lathe_chatter.recording.provenance import RECOVERED
from lathe_chatter.recording.recorded_file import Note, RecordedFile, offered_qos
from lathe_chatter.recording.run import Run, read_run
from lathe_chatter.recording.split_file_writer import CLOSED, RunFiles, TopicRecords

_NOT_COPIED = (CLOSED, 'rosbag2')
"""Notes that a writer makes itself."""
_COMMIT_SIZE = 1 << 24
"""Bytes of messages after which what is copied is put on disk."""


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


def recover(path: Path | str, output: Path | str) -> Recovery:
    """Save what is sound of a run, every message with its own type; the original is only read.

    Args:
        path: The run, a folder or a file.
        output: The folder to make.

    Raises:
        RunReadError: If there is no such run.
        NothingSavedError: If nothing of it is sound; no folder is made.
        RunExistsError: If the folder to make exists.
        OSError: If it cannot be written.
    """
    old, output = read_run(path, damaged=True), Path(output)
    distribution = str(((old.folder and old.folder.metadata) or {}).get('ros_distro', 'unknown'))
    if output.exists():
        raise RunExistsError(output)
    with atomic_output(output) as folder:
        copy = _Copy(folder, distribution)
        for place, file in enumerate(old.opened):
            if place:
                copy.files.split()
            copy.add(file)
        lost = lost_at_the_end(old, copy.messages, copy.last)
        if old.damage and not copy.has_anything:
            raise NothingSavedError(old.path, [*map(str, old.damage), *lost])
        noted = json.dumps([*map(str, old.damage), *lost])
        copy.files.note(RECOVERED, {'from': str(old.path), 'damage': noted})
        copy.files.close()
    return Recovery(read_run(output), copy.messages, old.damage, lost)


class _Copy:
    """A new run with what others hold.

    Args:
        folder: To make.
        distribution: Of ROS.

    Attributes:
        files: Of the new run.
        messages: Copied, by name of topic.
        last: When the last was received, by name of topic, ns since the epoch.
    """

    def __init__(self, folder: Path, distribution: str) -> None:
        self.files = RunFiles(folder, distribution)
        self.messages: Counter[str] = Counter()
        self.last: dict[str, int] = {}
        self._schemas: dict[tuple[str, str, bytes], int] = {}
        self._numbers: dict[bytes, int] = {}
        self._described: dict[int, bytes] = {}
        self._noted: list[Note] = []
        self._attached = False

    @property
    def has_anything(self) -> bool:
        """Whether anything was copied."""
        return bool(self._numbers or self._noted or self._attached)

    def add(self, file: RecordedFile) -> None:
        """Copy what a file holds."""
        for note in file.notes():
            if note.name not in _NOT_COPIED and note not in self._noted:
                self._noted.append(note)
                self.files.note(note.name, note.values)
        for attachment in file.attachments():
            self._attached = True
            self.files.attach(attachment.name, attachment.media_type, attachment.data)
        size = 0
        for contents in file.contents():
            chunk = OpenChunk(self._described)
            for raw in file.raw_of(contents.messages):
                number = self._number(raw.channel, raw.schema)
                chunk.add_message(number, raw.log_time, raw.publish_time, raw.sequence, raw.data)
                self.messages[raw.topic] += 1
                self.last[raw.topic] = max(raw.log_time, self.last.get(raw.topic, 0))
            if chunk.has_messages:
                self.files.add_chunk(chunk)
            size += chunk.size
            if size > _COMMIT_SIZE:
                self.files.commit()
                size = 0
        for channel in file.known.channels.values():  # also those without a message
            self._number(channel, file.known.schemas.get(channel.schema_id))
        self.files.commit()

    def _number(self, channel: Any, schema: Any) -> int:
        """The number of a channel in the new run, which it gets when it is met first."""
        schema_record, schema_id = b'', 0
        if schema is not None:
            key = schema.name, schema.encoding, bytes(schema.data)
            new = key not in self._schemas
            schema_id = self._schemas.setdefault(key, len(self._schemas) + 1)
            schema_record = record_bytes(replace(schema, id=schema_id))
        identity = record_bytes(replace(channel, id=0, schema_id=schema_id))
        if identity not in self._numbers:
            number = self._numbers[identity] = len(self._numbers) + 1
            record = record_bytes(replace(channel, id=number, schema_id=schema_id))
            self._described[number] = schema_record + record
            topic = Topic(
                channel.topic,
                schema.name if schema is not None else '',
                '',
                channel.metadata.get('topic_type_hash', ''),
                tuple(offered_qos(channel)),
                channel.message_encoding,
            )
            first = schema_record if schema is not None and new else b''
            self.files.add_topic(TopicRecords(topic, first, record))
        return self._numbers[identity]
