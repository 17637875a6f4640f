"""metadata.yaml of a rosbag2 folder, version 9: what rosbag2 wants beside the MCAP files."""

from __future__ import annotations

import contextlib
import os
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import yaml

FILE_NAME = 'metadata.yaml'
VERSION = 9
_DUMPER = getattr(yaml, 'CSafeDumper', yaml.SafeDumper)


@dataclass(frozen=True)
class Topic:
    """A recorded topic.

    Attributes:
        name: With its namespace, beginning with a slash.
        type: Of its messages, as `std_msgs/msg/Bool`.
        definition: The full text of the type and of those that it uses (ros2msg).
        type_hash: RIHS01.
        qos: The profiles that its publishers offer, as rosbag2 writes them.
        encoding: Of its messages.
        repeated: How many of its latest messages each later file of a run begins with: such as
            a late reader would get from its publisher.
    """

    name: str
    type: str
    definition: str
    type_hash: str
    qos: tuple[Mapping[str, Any], ...] = ()
    encoding: str = 'cdr'
    repeated: int = 0


class FileCount(NamedTuple):
    """What one MCAP file of a run holds; log times in ns since the epoch."""

    path: str
    first: int
    last: int
    messages: int


def describe(
    files: Sequence[FileCount],
    topics: Iterable[Topic],
    counts: Counter[str],
    distribution: str,
) -> dict[str, Any]:
    """The content of metadata.yaml.

    Args:
        files: In order.
        topics: Every one that was announced.
        counts: Messages by name of topic.
        distribution: Of ROS.
    """
    written = [file for file in files if file.messages]
    start = min((file.first for file in written), default=0)
    end = max((file.last for file in written), default=0)
    return {
        'rosbag2_bagfile_information': {
            'version': VERSION,
            'storage_identifier': 'mcap',
            'duration': {'nanoseconds': end - start},
            'starting_time': {'nanoseconds_since_epoch': start},
            'message_count': sum(file.messages for file in files),
            'topics_with_message_count': [
                {
                    'topic_metadata': {
                        'name': topic.name,
                        'type': topic.type,
                        'serialization_format': topic.encoding,
                        'offered_qos_profiles': [dict(profile) for profile in topic.qos],
                        'type_description_hash': topic.type_hash,
                    },
                    'message_count': counts[topic.name],
                }
                for topic in topics
            ],
            'compression_format': '',
            'compression_mode': '',
            'relative_file_paths': [file.path for file in files],
            'files': [
                {
                    'path': file.path,
                    'starting_time': {'nanoseconds_since_epoch': file.first},
                    'duration': {'nanoseconds': file.last - file.first},
                    'message_count': file.messages,
                }
                for file in files
            ],
            'custom_data': None,
            'ros_distro': distribution,
        }
    }


def dump(values: Any) -> str:
    """YAML in the order of the values."""
    text: str = yaml.dump(values, Dumper=_DUMPER, sort_keys=False)
    return text


def dump_qos(qos: Sequence[Mapping[str, Any]]) -> str:
    """Offered profiles as the metadata of an MCAP channel has them."""
    return dump([dict(profile) for profile in qos]).strip()


def replace_file(folder: Path, text: str) -> None:
    """Replace metadata.yaml as a whole: a reader finds the old one or the new one.

    Raises:
        OSError: If the disk refuses; the old one then stays.
    """
    temporary = folder / f'{FILE_NAME}.tmp'
    try:
        with temporary.open('w', encoding='utf-8') as stream:
            stream.write(text)
            stream.flush()
            os.fsync(stream.fileno())
        temporary.replace(folder / FILE_NAME)
    except OSError:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
        raise
    sync_folder(folder)


def sync_folder(folder: Path) -> None:
    """Put the names in a folder on the disk: a file without its name is lost in a power cut."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
