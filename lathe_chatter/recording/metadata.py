"""metadata.yaml of a rosbag2 folder, version 9: what rosbag2 wants beside the MCAP files."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

FILE_NAME = 'metadata.yaml'
VERSION = 9


@dataclass(frozen=True)
class Topic:
    """A recorded topic.

    Attributes:
        name: With its namespace, beginning with a slash.
        type: Of its messages, as `std_msgs/msg/Bool`.
        definition: The full text of the type and of those that it uses (ros2msg).
        type_hash: RIHS01.
        qos: The profiles that its publishers offer, as rosbag2 writes them.
    """

    name: str
    type: str
    definition: str
    type_hash: str
    qos: tuple[Mapping[str, Any], ...] = ()


@dataclass
class FileCount:
    """What one MCAP file of a run holds; times in ns since the epoch."""

    path: str
    first: int | None = None
    last: int | None = None
    messages: int = 0

    def note(self, time: int) -> None:
        """Count a message."""
        self.first = time if self.first is None else min(self.first, time)
        self.last = time if self.last is None else max(self.last, time)
        self.messages += 1


@dataclass
class RunCount:
    """What a run holds so far."""

    files: list[FileCount] = field(default_factory=list)
    topics: dict[str, tuple[Topic, int]] = field(default_factory=dict)


def describe(count: RunCount, distribution: str) -> dict[str, Any]:
    """The content of metadata.yaml."""
    firsts = [file.first for file in count.files if file.first is not None]
    lasts = [file.last for file in count.files if file.last is not None]
    start, end = min(firsts, default=0), max(lasts, default=0)
    return {
        'rosbag2_bagfile_information': {
            'version': VERSION,
            'storage_identifier': 'mcap',
            'duration': {'nanoseconds': end - start},
            'starting_time': {'nanoseconds_since_epoch': start},
            'message_count': sum(file.messages for file in count.files),
            'topics_with_message_count': [
                {
                    'topic_metadata': {
                        'name': topic.name,
                        'type': topic.type,
                        'serialization_format': 'cdr',
                        'offered_qos_profiles': [dict(profile) for profile in topic.qos],
                        'type_description_hash': topic.type_hash,
                    },
                    'message_count': messages,
                }
                for topic, messages in count.topics.values()
            ],
            'compression_format': '',
            'compression_mode': '',
            'relative_file_paths': [file.path for file in count.files],
            'files': [
                {
                    'path': file.path,
                    'starting_time': {'nanoseconds_since_epoch': file.first or 0},
                    'duration': {'nanoseconds': (file.last or 0) - (file.first or 0)},
                    'message_count': file.messages,
                }
                for file in count.files
            ],
            'custom_data': None,
            'ros_distro': distribution,
        }
    }


def dump_qos(qos: Sequence[Mapping[str, Any]]) -> str:
    """Offered profiles as the metadata of an MCAP channel has them."""
    return yaml.safe_dump([dict(profile) for profile in qos], sort_keys=False).strip()


def write_metadata(folder: Path, count: RunCount, distribution: str) -> None:
    """Replace metadata.yaml as a whole: a reader finds the old one or the new one."""
    text = yaml.safe_dump(describe(count, distribution), sort_keys=False)
    temporary = folder / f'{FILE_NAME}.tmp'
    with temporary.open('w', encoding='utf-8') as stream:
        stream.write(text)
        stream.flush()
        os.fsync(stream.fileno())
    temporary.replace(folder / FILE_NAME)
