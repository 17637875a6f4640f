"""`RunWriter`: messages into a rosbag2 folder that is complete on disk after every commit."""

from __future__ import annotations

import contextlib
import json
import math
import os
import shutil
import time
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import NamedTuple

from lathe_chatter.errors import LatheChatterError
from lathe_chatter.recording.background_sync import BackgroundSync
from lathe_chatter.recording.committed_file import CommittedFile, Contents
from lathe_chatter.recording.metadata import (
    FileCount,
    Topic,
    describe,
    dump,
    dump_qos,
    replace_file,
)

__all__ = ['CLOSED', 'DiskFullError', 'RunExistsError', 'RunWriter', 'Topic']

CLOSED = 'lathe_chatter/closed'
"""Name of the MCAP metadata record that ends each file of a run; a killed recorder leaves none.

`next` is the file in which the run goes on, empty in the last; `messages` the counts by topic so
far, as JSON."""


class RunExistsError(LatheChatterError):
    """The folder of a new run exists already: nothing recorded is ever overwritten."""

    def __init__(self, folder: Path) -> None:
        """Name the folder."""
        self.folder = folder
        super().__init__(f'{folder} exists already, and no recorded run is overwritten.')


class DiskFullError(LatheChatterError):
    """The disk has too little room left to go on."""

    def __init__(self, folder: Path, free: int, wanted: int) -> None:
        """Name the folder, what is free on its disk and what must be, in bytes."""
        self.folder = folder
        super().__init__(
            f'The disk of {folder} has {free / 1e6:.1f} MB left and {wanted / 1e6:.1f} MB must '
            'stay free: the recording ends, complete up to here.'
        )


class _Piece(NamedTuple):
    """A file of the run that is finished, or will be when the disk has caught up."""

    name: str
    contents: Contents
    sync: BackgroundSync


class RunWriter:
    """Writes a run: topics and their messages, in files that split without a gap.

    Nothing is on disk before `commit`; call it every 0.25 s or so. As a context it closes
    itself, whatever happens inside.

    Args:
        folder: To make. Its last name is that of the files in it.
        distribution: The ROS distribution, for metadata.yaml; by default the one sourced.
        min_free_space: Bytes that the disk must keep.
        split_duration: s of recording in one file before the next is begun.
        split_size: Bytes, likewise.

    Raises:
        RunExistsError: If the folder exists.
        OSError: If it cannot be made or written.
    """

    def __init__(
        self,
        folder: Path,
        *,
        distribution: str = '',
        min_free_space: int = 0,
        split_duration: float = math.inf,
        split_size: float = math.inf,
    ) -> None:
        """Make the folder with a first, empty file and its metadata."""
        self.folder = folder
        self._distribution = distribution or os.environ.get('ROS_DISTRO', 'unknown')
        self._min_free_space = min_free_space
        self._split_duration = split_duration
        self._split_size = split_size
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            raise RunExistsError(folder) from None
        self._pieces: list[_Piece] = []
        self._topics: dict[str, Topic] = {}
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._notes: dict[str, Mapping[str, str]] = {}
        self._described = True
        self._closed = False
        self._open_file()

    def add_topic(self, topic: Topic) -> None:
        """Announce a topic before its first message; a second time changes nothing."""
        if topic.name not in self._topics:
            self._topics[topic.name] = topic
            self._register(topic)
            self._described = False

    def write(
        self, name: str, data: bytes, *, log_time: int, publish_time: int, sequence: int = 0
    ) -> None:
        """Add a message to a topic.

        Args:
            name: Of the topic.
            data: The message as serialised (CDR).
            log_time: When it was received, ns since the epoch.
            publish_time: When it was published, ns since the epoch.
            sequence: Its number among those of its publisher.
        """
        self._file.add_message(self._channels[name], log_time, publish_time, sequence, data)

    def note(self, name: str, values: Mapping[str, str]) -> None:
        """Keep named values beside the messages, in this file and those that follow.

        Args:
            name: What they are, as `lathe_chatter/parameters/lathe`; a later note of the same
                name takes the place of this one in the files that follow.
            values: As MCAP metadata has them.
        """
        self._notes[name] = dict(values)
        self._file.add_metadata(name, values)

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Attach a file of another kind, a scenario for instance."""
        self._file.attach(name, media_type, data, time.time_ns())

    def commit(self) -> None:
        """Leave a complete file on disk with everything written so far; split where it is time.

        Raises:
            DiskFullError: If less than `min_free_space` is left on the disk; what was written
                so far is on it.
            OSError: If the disk refuses; the file stays as the commit before left it.
        """
        self._file.commit()
        if not self._described:
            self._describe()
        held = self._file.committed
        if held.last - held.first >= self._split_duration * 1e9 or (
            self._file.size >= self._split_size and held.chunks
        ):
            self.split()
        free = shutil.disk_usage(self.folder).free
        if free < self._min_free_space:
            raise DiskFullError(self.folder, free, self._min_free_space)

    def split(self) -> None:
        """Go on in a new file; every message is in the one or the other.

        Raises:
            OSError: If the disk refuses.
        """
        self._end_file(self._name(len(self._pieces) + 1))
        self._open_file()

    def close(self) -> None:
        """Finish the files and the metadata; a second time does nothing.

        Raises:
            OSError: If the disk refuses; every file stays as its last commit left it.
        """
        if self._closed:
            return
        self._closed = True
        try:
            self._end_file('')
            for piece in self._pieces:
                piece.sync.join()
        finally:
            self._describe()

    def abandon(self) -> None:
        """Leave everything as the last commit left it: the disk takes no more."""
        if self._closed:
            return
        self._closed = True
        self._file.abandon()
        with contextlib.suppress(OSError):
            self._describe()

    def __enter__(self) -> RunWriter:  # noqa: PYI034 -- Self needs Python 3.11
        """The folder and its first file are there."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close, also after an exception: what was recorded before it counts."""
        self.close()

    @property
    def counts(self) -> Counter[str]:
        """Messages on disk by name of topic."""
        names = {number: name for name, number in self._channels.items()}
        total: Counter[str] = Counter()
        for _, contents in self._files():
            for number, count in contents.counts.items():
                total[names[number]] += count
        return total

    def _name(self, number: int) -> str:
        return f'{self.folder.name}_{number}.mcap'

    def _files(self) -> list[tuple[str, Contents]]:
        """Every file with what it holds on disk; the last is the one that is written to."""
        finished = [(piece.name, piece.contents) for piece in self._pieces]
        if len(finished) < self._begun:
            finished.append((self._name(len(finished)), self._file.committed))
        return finished

    def _open_file(self) -> None:
        """Begin a file, with all that is known, and say so in the metadata."""
        self._file = CommittedFile(self.folder / self._name(len(self._pieces)))
        self._begun = len(self._pieces) + 1
        self._schemas.clear()
        # In the same order, so with the same numbers in every file.
        for topic in self._topics.values():
            self._register(topic)
        for name, values in self._notes.items():
            self._file.add_metadata(name, values)
        self._describe()

    def _end_file(self, next_name: str) -> None:
        """Close the file: what it holds, where the run goes on, and what rosbag2 wants to know."""
        self._file.commit()
        counts = json.dumps(dict(sorted(self.counts.items())))
        self._file.add_metadata(CLOSED, {'next': next_name, 'messages': counts})
        self._file.add_metadata('rosbag2', {'serialized_metadata': self._description()})
        name = self._name(len(self._pieces))
        sync = self._file.close(wait=False)
        self._pieces.append(_Piece(name, self._file.committed, sync))

    def _register(self, topic: Topic) -> None:
        """Tell the present file of a topic."""
        if topic.type not in self._schemas:
            self._schemas[topic.type] = self._file.add_schema(
                topic.type, 'ros2msg', topic.definition.encode()
            )
        self._channels[topic.name] = self._file.add_channel(
            topic.name,
            self._schemas[topic.type],
            {'offered_qos_profiles': dump_qos(topic.qos), 'topic_type_hash': topic.type_hash},
        )

    def _description(self) -> str:
        files = [
            FileCount(name, held.first, held.last, sum(held.counts.values()))
            for name, held in self._files()
        ]
        values = describe(files, self._topics.values(), self.counts, self._distribution)
        return dump(values)

    def _describe(self) -> None:
        replace_file(self.folder, self._description())
        self._described = True
