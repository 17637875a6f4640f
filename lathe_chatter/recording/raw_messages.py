"""Messages of any topic, as they are in a file and decoded."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from lathe_chatter.recording.chunk_messages import Messages
from lathe_chatter.recording.run_file import RecordedFile


class Raw(NamedTuple):
    """A message as it was recorded.

    Attributes:
        topic: Its name.
        type: As `std_msgs/msg/Bool`.
        log_time: When it was received, ns since the epoch.
        publish_time: When it was published, ns since the epoch.
        sequence: Its number among those of its publisher; 0 from writers that keep none.
        data: CDR.
    """

    topic: str
    type: str
    log_time: int
    publish_time: int
    sequence: int
    data: bytes


class Recorded(NamedTuple):
    """A recorded message.

    Attributes:
        topic: Its name.
        log_time: When it was received, ns since the epoch.
        sequence: Its number among those of its publisher.
        message: As rosbags decodes it.
        publish_time: When it was published, ns since the epoch.
    """

    topic: str
    log_time: int
    sequence: int
    message: Any
    publish_time: int


def raw_of(file: RecordedFile, messages: Messages, topics: tuple[str, ...] = ()) -> Iterator[Raw]:
    """The messages of a chunk that are of some topics, or of any if none is named."""
    known = file.known
    chosen = {
        number: (channel.topic, known.schemas[channel.schema_id].name)
        for number, channel in known.channels.items()
        if (not topics or channel.topic in topics) and channel.schema_id in known.schemas
    }
    for place in np.flatnonzero(np.isin(messages.heads['channel'], list(chosen))):
        head = messages.heads[place]
        yield Raw(
            *chosen[int(head['channel'])],
            int(head['log_time']),
            int(head['publish_time']),
            int(head['sequence']),
            messages.payload(int(place)),
        )
