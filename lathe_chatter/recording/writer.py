"""`RunWriter`: messages into a rosbag2 folder that is complete on disk after every commit."""

from __future__ import annotations

import contextlib
import os
import shutil
from pathlib import Path
from types import TracebackType

from lathe_chatter.errors import LatheChatterError
from lathe_chatter.recording.committed_file import CommittedFile
from lathe_chatter.recording.metadata import (
    FileCount,
    RunCount,
    Topic,
    dump_qos,
    write_metadata,
)

__all__ = ['DiskFullError', 'RunExistsError', 'RunWriter', 'Topic']


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


class RunWriter:
    """Writes a run: topics and their messages, in files that split without a gap.

    Nothing is on disk before `commit`; call it every 0.25 s or so. As a context it closes
    itself, whatever happens inside.

    Args:
        folder: To make. Its last name is that of the files in it.
        distribution: The ROS distribution, for metadata.yaml.
        min_free_space: Bytes that the disk must keep.

    Raises:
        RunExistsError: If the folder exists.
        OSError: If it cannot be made or written.
    """

    def __init__(self, folder: Path, *, distribution: str = '', min_free_space: int = 0) -> None:
        """Make the folder with a first, empty file and its metadata."""
        self.folder = folder
        self._distribution = distribution or os.environ.get('ROS_DISTRO', 'unknown')
        self._min_free_space = min_free_space
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            raise RunExistsError(folder) from None
        self._count = RunCount()
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._file = self._next_file()

    def add_topic(self, topic: Topic) -> None:
        """Announce a topic before its first message; a second time changes nothing."""
        if topic.name not in self._count.topics:
            self._count.topics[topic.name] = (topic, 0)
            self._register(topic)

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
        self._file.writer.add_message(
            channel_id=self._channels[name],
            log_time=log_time,
            data=data,
            publish_time=publish_time,
            sequence=sequence & 0xFFFFFFFF,
        )
        topic, messages = self._count.topics[name]
        self._count.topics[name] = (topic, messages + 1)
        self._count.files[-1].note(log_time)

    def commit(self) -> None:
        """Leave a complete file on disk with everything written so far.

        Raises:
            DiskFullError: If less than `min_free_space` is left on the disk; what was written
                so far is on it.
            OSError: If the disk refuses; the file stays as the commit before left it.
        """
        self._file.commit()
        free = shutil.disk_usage(self.folder).free
        if free < self._min_free_space:
            raise DiskFullError(self.folder, free, self._min_free_space)

    def split(self) -> None:
        """Go on in a new file; every message is in the one or the other."""
        self._file.close()
        self._file = self._next_file()
        for topic, _ in self._count.topics.values():
            self._register(topic)

    def close(self) -> None:
        """Finish the files and the metadata."""
        try:
            self._file.close()
        finally:
            write_metadata(self.folder, self._count, self._distribution)

    def abandon(self) -> None:
        """Leave everything as the last commit left it: the disk takes no more."""
        with contextlib.suppress(OSError):
            self._file.abandon()
        with contextlib.suppress(OSError):
            write_metadata(self.folder, self._count, self._distribution)

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

    def _next_file(self) -> CommittedFile:
        """Begin a file, and say so in the metadata."""
        self._channels.clear()
        self._schemas.clear()
        name = f'{self.folder.name}_{len(self._count.files)}.mcap'
        file = CommittedFile(self.folder / name)
        self._count.files.append(FileCount(name))
        write_metadata(self.folder, self._count, self._distribution)
        return file

    def _register(self, topic: Topic) -> None:
        """Tell the present file of a topic."""
        writer = self._file.writer
        if topic.type not in self._schemas:
            self._schemas[topic.type] = writer.register_schema(
                topic.type, 'ros2msg', topic.definition.encode()
            )
        self._channels[topic.name] = writer.register_channel(
            topic.name,
            'cdr',
            self._schemas[topic.type],
            {'offered_qos_profiles': dump_qos(topic.qos), 'topic_type_hash': topic.type_hash},
        )
