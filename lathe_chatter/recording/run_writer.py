"""`RunWriter`: messages into a rosbag2 folder that is complete on disk after every commit."""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Mapping
from contextlib import AbstractContextManager
from pathlib import Path

from lathe_chatter.errors import DiskFullError, RunExistsError
from lathe_chatter.recording.crash_safe_counters import UnfinishedCounts
from lathe_chatter.recording.disk_thread import DiskThread
from lathe_chatter.recording.metadata_yaml import Topic
from lathe_chatter.recording.open_chunk import Compression, OpenChunk
from lathe_chatter.recording.split_file_writer import CLOSED, RunFiles, TopicTable

__all__ = ['CLOSED', 'DiskFullError', 'RunExistsError', 'RunWriter', 'Topic']

_MEDIA_TYPES = {'.yaml': 'application/yaml', '.json': 'application/json', '.txt': 'text/plain'}
_CHUNK_SIZE = 1 << 20
"""Larger than what comes between two commits of a lathe in real time, which each end a chunk; and
it fits into the cache of a processor that reads it: chunks of 4 MB take it twice the time."""


class RunWriter(AbstractContextManager['RunWriter']):
    """Writes a run: topics and their messages, in files that split without a gap.

    Nothing is on disk before a commit; ask for one every 0.25 s or so. Messages are gathered
    here; a thread compresses them and has them written, so that whoever brings them is not held
    up. As a context it closes itself, whatever happens inside.

    Args:
        folder: To make. Its last name is that of the files in it.
        distribution: The ROS distribution, for metadata.yaml; by default the one sourced.
        min_free_space: Bytes that the disk must keep.
        split_duration: s of recording in one file before the next is begun.
        split_size: Bytes, likewise.
        compression: Of the chunks.

    Raises:
        RunExistsError: If the folder exists.
        OSError: If it cannot be made or written.
    """

    def __init__(  # noqa: PLR0913 -- what a user may choose of a recording
        self,
        folder: Path | str,
        *,
        distribution: str = '',
        min_free_space: int = 0,
        split_duration: float = math.inf,
        split_size: float = math.inf,
        compression: Compression = Compression.LZ4,
    ) -> None:
        """Make the folder with a first, empty file and its metadata."""
        self.folder = folder = Path(folder)
        self._files = RunFiles(
            folder,
            distribution or os.environ.get('ROS_DISTRO', 'unknown'),
            min_free_space=min_free_space,
            split_duration=split_duration,
            split_size=split_size,
            compression=compression,
        )
        self._counts = UnfinishedCounts(folder)
        self._topics = TopicTable()
        self._chunk = OpenChunk(self._topics.described)
        self._repeated: dict[int, int] = {}
        self._closed = False
        self._thread = DiskThread('run writer')

    def add_topic(self, topic: Topic) -> None:
        """Announce a topic before its first message; a second time changes nothing.

        With another type it goes on in another channel.
        """
        records = self._topics.add(topic)
        if records is not None:
            self._repeated[self._topics.numbers[topic.name]] = topic.repeated
            self._thread.do_later(lambda: self._files.add_topic(records))

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
        chunk, channel = self._chunk, self._topics.numbers[name]
        chunk.add_message(channel, log_time, publish_time, sequence, data)
        self._counts.count(channel, log_time)
        if self._repeated[channel]:
            chunk.kept.append((channel, publish_time, data))
        if chunk.size > _CHUNK_SIZE:
            self._send_chunk()

    def note(self, name: str, values: Mapping[str, str]) -> None:
        """Keep named values beside the messages, in this file and those that follow.

        Args:
            name: What they are, as `lathe_chatter/parameters/lathe`; a later note of the same
                name takes the place of this one in the files that follow.
            values: As MCAP metadata has them.
        """
        self._send_chunk()
        kept = dict(values)
        self._thread.do_later(lambda: self._files.note(name, kept))

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Attach a file of another kind, a scenario for instance."""
        self._send_chunk()
        self._thread.do_later(lambda: self._files.attach(name, media_type, data))

    def attach_file(self, file: Path) -> None:
        """Attach a file as it is.

        Raises:
            OSError: If it cannot be read.
        """
        kind = _MEDIA_TYPES.get(file.suffix, 'application/octet-stream')
        self.attach(file.name, kind, file.read_bytes())

    def commit(self) -> None:
        """Leave a complete file on disk with everything written so far; split where it is time.

        Raises:
            DiskFullError: If less than `min_free_space` is left on the disk; what was written
                so far is on it.
            OSError: If the disk refuses; the file stays as the commit before left it.
        """
        self._thread.check()
        self._send_chunk()
        self._thread.do_now(self._files.commit)

    def commit_soon(self) -> None:
        """Commit without waiting for it, some milliseconds from now.

        Raises:
            DiskFullError: As `commit`, of a commit that was asked for before.
            OSError: Likewise.
        """
        self._thread.check()
        self._send_chunk()
        self._thread.do_later(self._files.commit)

    def split(self) -> None:
        """Go on in a new file; every message is in the one or the other.

        Raises:
            OSError: If the disk refuses.
        """
        self._send_chunk()
        self._thread.do_now(self._files.split)

    def close(self) -> None:
        """Finish the files and the metadata; a second time does nothing.

        Raises:
            OSError: If the disk refuses; every file stays as its last commit left it.
        """
        if self._closed:
            return
        self._closed = True
        self._send_chunk()
        finished = False
        try:
            self._thread.do_now(self._files.close)
            finished = True
        finally:
            self._thread.end()
            self._counts.close(finished=finished)

    def abandon(self) -> None:
        """Leave everything as the last commit left it: the disk takes no more."""
        if self._closed:
            return
        self._closed = True
        self._thread.do_now(self._files.abandon)
        self._thread.end()
        self._counts.close(finished=False)

    def __exit__(self, *_error: object) -> None:
        """Close, also after an exception: what was recorded before it counts."""
        self.close()

    @property
    def counts(self) -> Counter[str]:
        """Messages on disk by name of topic."""
        return self._files.counts

    @property
    def repeated(self) -> Counter[str]:
        """Messages that a file begins with because one before had them, by name of topic."""
        return self._files.repeated

    @property
    def safe_messages(self) -> int:
        """How many messages no loss of power can take any more."""
        return self._files.safe_messages

    def _send_chunk(self) -> None:
        """Hand the messages gathered so far to the thread."""
        if self._chunk.has_messages:
            chunk, self._chunk = self._chunk, OpenChunk(self._topics.described)
            self._thread.do_later(lambda: self._files.add_chunk(chunk))
