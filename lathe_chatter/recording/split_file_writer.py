"""The files of a run that is being written: topics, what each file begins with, metadata.yaml."""

from __future__ import annotations

import contextlib
import json
import math
import shutil
import time
from collections import Counter, deque
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from mcap.records import Channel, Schema

from lathe_chatter.errors import DiskFullError, RunExistsError
from lathe_chatter.recording.disk_thread import DiskThread, FileSync
from lathe_chatter.recording.mcap_writer import CommittedFile, Contents
from lathe_chatter.recording.metadata_yaml import (
    FileCount,
    Topic,
    describe,
    dump,
    dump_qos,
    replace_file,
)
from lathe_chatter.recording.open_chunk import Compression, OpenChunk, record_bytes

CLOSED = 'lathe_chatter/closed'
"""Name of the MCAP metadata record that ends each file of a run; a killed recorder leaves none.

`next` is the file in which the run goes on, empty in the last; `messages` the counts by topic so
far, as JSON."""
_RENEWAL_PERIOD = 10.0
"""s after which metadata.yaml is written anew: what a kill leaves is not much older."""


class TopicRecords(NamedTuple):
    """A topic with its records.

    Attributes:
        topic: Which.
        schema: Of its type; empty where a topic before has the same.
        channel: The channel.
        described: Both, as a chunk has them.
    """

    topic: Topic
    schema: bytes
    channel: bytes
    described: bytes = b''


_Kind = tuple[str, str, str]
"""Name, hash and definition of a type."""


class TopicTable:
    """Gives topics their numbers.

    Attributes:
        numbers: Of the latest channel, by name of topic: each type of a topic has its own.
        described: Schema and channel as a chunk has them, by number of the channel.
    """

    def __init__(self) -> None:
        """Begin empty."""
        self.numbers: dict[str, int] = {}
        self.described: dict[int, bytes] = {}
        self._schemas: dict[_Kind, tuple[int, bytes]] = {}
        self._kinds: dict[str, _Kind] = {}

    def add(self, topic: Topic) -> TopicRecords | None:
        """The records of a topic that is new, or of a new type; None for one that is known."""
        kind = topic.type, topic.type_hash, topic.definition
        if self._kinds.get(topic.name) == kind:
            return None
        self._kinds[topic.name] = kind
        known = kind in self._schemas
        if not known:
            number = len(self._schemas) + 1
            data = topic.definition.encode()
            schema = Schema(id=number, name=topic.type, encoding='ros2msg', data=data)
            self._schemas[kind] = number, record_bytes(schema)
        schema_number, schema_record = self._schemas[kind]
        number = len(self.described) + 1
        channel = record_bytes(
            Channel(
                id=number,
                topic=topic.name,
                message_encoding='cdr',
                metadata={
                    'offered_qos_profiles': dump_qos(topic.qos),
                    'topic_type_hash': topic.type_hash,
                },
                schema_id=schema_number,
            )
        )
        self.described[number] = schema_record + channel
        self.numbers[topic.name] = number
        described = self.described[number]
        return TopicRecords(topic, b'' if known else schema_record, channel, described)


class _FinishedFile(NamedTuple):
    """A file of the run that is finished, or will be when the disk has caught up."""

    name: str
    contents: Contents
    sync: FileSync


class RunFiles:
    """Writes chunks, notes and attachments into files that follow each other.

    Args:
        folder: To make.
        distribution: Of ROS, for metadata.yaml.
        min_free_space: Bytes that the disk must keep.
        split_duration: s of recording in one file before the next is begun.
        split_size: Bytes, likewise.
        compression: Of the chunks.

    Attributes:
        repeated: Messages that files begin with because those before had them, by topic.

    Raises:
        RunExistsError: If the folder exists.
        OSError: If it cannot be made or written.
    """

    def __init__(  # noqa: PLR0913 -- what a user may choose of a recording
        self,
        folder: Path,
        distribution: str,
        *,
        min_free_space: int = 0,
        split_duration: float = math.inf,
        split_size: float = math.inf,
        compression: Compression = Compression.LZ4,
    ) -> None:
        """Make the folder with a first, empty file and its metadata."""
        self._folder = folder
        self._distribution = distribution
        self._min_free_space = min_free_space
        self._split_duration = split_duration
        self._split_size = split_size
        self._compression = compression
        self.repeated: Counter[str] = Counter()
        self._kept: dict[int, deque[tuple[int, bytes]]] = {}
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            raise RunExistsError(folder) from None
        self._finished: list[_FinishedFile] = []
        self._topics: list[TopicRecords] = []
        self._notes: dict[str, Mapping[str, str]] = {}
        self._described = True
        self._renewal = DiskThread('metadata.yaml')
        self._open_file()

    def add_topic(self, records: TopicRecords) -> None:
        """Announce a topic, in the order of the numbers of their channels."""
        self._topics.append(records)
        self._file.add_channel(records.schema, records.channel)
        self._described = False

    def add_chunk(self, chunk: OpenChunk) -> None:
        """Add the messages of a chunk."""
        for channel, published, data in chunk.kept:
            most = self._topics[channel - 1].topic.repeated
            self._kept.setdefault(channel, deque(maxlen=most)).append((published, data))
        self._file.add_chunk(chunk)

    def note(self, name: str, values: Mapping[str, str]) -> None:
        """Keep named values, in this file and those that follow."""
        self._notes[name] = values
        self._file.add_metadata(name, values)

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Attach a file of another kind."""
        self._file.attach(name, media_type, data, time.time_ns())

    def commit(self) -> None:
        """Leave a complete file on disk with everything added so far; split where it is time.

        Raises:
            DiskFullError: If less than `min_free_space` is left on the disk.
            OSError: If the disk refuses; the file stays as the commit before left it.
        """
        self._file.commit()
        self._renewal.check()
        if not self._described:
            self._describe()
        elif time.monotonic() - self._described_at >= _RENEWAL_PERIOD:
            self._renew_description()
        held = self._file.committed
        if held.last - held.first >= self._split_duration * 1e9 or (
            self._file.size >= self._split_size and held.chunks
        ):
            self.split()
        free = shutil.disk_usage(self._folder).free
        if free < self._min_free_space:
            raise DiskFullError(self._folder, free, self._min_free_space)

    def split(self) -> None:
        """Go on in a new file.

        Raises:
            OSError: If the disk refuses.
        """
        self._end_file(self._name(len(self._finished) + 1))
        last = self._finished[-1].contents.last
        self._open_file()
        self._repeat(last)

    def _repeat(self, received: int) -> None:
        """Begin a file with what a late reader would get; dated by the end of the last one, ns."""
        numbers = range(1, len(self._topics) + 1)
        described = {k: self._topics[k - 1].described for k in numbers if k in self._kept}
        chunk = OpenChunk(described)
        for channel, messages in self._kept.items():
            self.repeated[self._topics[channel - 1].topic.name] += len(messages)
            for published, data in messages:
                # Its number was given to the first copy, and is no number of this one.
                chunk.add_message(channel, received, published, 0, data)
        if chunk.has_messages:
            self._file.add_chunk(chunk)

    def close(self) -> None:
        """Finish the files and the metadata.

        Raises:
            OSError: If the disk refuses; every file stays as its last commit left it.
        """
        try:
            self._end_file('')
            for file in self._finished:
                file.sync.join()
        finally:
            try:
                self._describe()
            finally:
                self._renewal.end()

    def abandon(self) -> None:
        """Leave everything as the last commit left it: the disk takes no more."""
        self._file.abandon()
        with contextlib.suppress(OSError):
            self._describe()
        self._renewal.end()

    @property
    def counts(self) -> Counter[str]:
        """Messages on disk by name of topic."""
        names = {k + 1: records.topic.name for k, records in enumerate(self._topics)}
        total: Counter[str] = Counter()
        for _, contents in self._files():
            for number, count in contents.counts.items():
                total[names[number]] += count
        return total

    @property
    def safe_messages(self) -> int:
        """How many messages no loss of power can take any more."""
        finished = sum(file.sync.messages for file in self._finished)
        return finished + (self._file.safe_messages if len(self._finished) < self._begun else 0)

    def _name(self, number: int) -> str:
        return f'{self._folder.name}_{number}.mcap'

    def _files(self) -> list[tuple[str, Contents]]:
        """Every file with what it holds on disk; the last is the one that is written to."""
        finished = [(file.name, file.contents) for file in self._finished]
        if len(finished) < self._begun:
            finished.append((self._name(len(finished)), self._file.committed))
        return finished

    def _open_file(self) -> None:
        """Begin a file, with all that is known, and say so in the metadata."""
        path = self._folder / self._name(len(self._finished))
        self._file = CommittedFile(path, self._compression)
        self._begun = len(self._finished) + 1
        # In the same order, so with the same numbers in every file.
        for records in self._topics:
            self._file.add_channel(records.schema, records.channel)
        for name, values in self._notes.items():
            self._file.add_metadata(name, values)
        self._describe()

    def _end_file(self, next_name: str) -> None:
        """Close the file: what it holds, where the run goes on, and what rosbag2 wants to know."""
        self._file.commit()
        counts = json.dumps(dict(sorted(self.counts.items())))
        self._file.add_metadata(CLOSED, {'next': next_name, 'messages': counts})
        self._file.add_metadata('rosbag2', {'serialized_metadata': self._description()})
        name = self._name(len(self._finished))
        sync = self._file.close()
        self._finished.append(_FinishedFile(name, self._file.committed, sync))

    def _description(self) -> str:
        files = [
            FileCount(name, held.first, held.last, sum(held.counts.values()))
            for name, held in self._files()
        ]
        topics = {records.topic.name: records.topic for records in self._topics}
        values = describe(files, topics.values(), self.counts, self._distribution)
        return dump(values)

    def _describe(self) -> None:
        """Write metadata.yaml, and wait until the disk has it."""
        text = self._description()
        self._renewal.do_now(lambda: replace_file(self._folder, text))
        self._described, self._described_at = True, time.monotonic()

    def _renew_description(self) -> None:
        """Write metadata.yaml with what is there by now; a slow disk holds nobody up."""
        text = self._description()
        self._renewal.do_later(lambda: replace_file(self._folder, text))
        self._described_at = time.monotonic()
