"""A run with one message for each sample of each signal, for viewers that unroll no blocks."""

from __future__ import annotations

from collections import deque
from pathlib import Path

import numpy as np

from lathe_chatter.array_types import Array, Integers
from lathe_chatter.atomic_output import atomic_output
from lathe_chatter.errors import RunExistsError
from lathe_chatter.recording.export import Exported, ExportedParts, Progress
from lathe_chatter.recording.metadata_yaml import Topic
from lathe_chatter.recording.recorded_file import Raw, offered_qos
from lathe_chatter.recording.ros_messages import topic_of_type
from lathe_chatter.recording.run import Run
from lathe_chatter.recording.run_timeline import read_timeline
from lathe_chatter.recording.run_writer import RunWriter
from lathe_chatter.recording.sample_blocks import TIME, CutsInARow
from lathe_chatter.recording.sample_series import Selection
from lathe_chatter.samples.codec import encode_number

NUMBER_TYPE = 'std_msgs/msg/Float64'
_COMMIT_AFTER = 100_000
"""Messages after which the file is put on disk."""


def unroll(run: Run, path: Path, chosen: Selection, progress: Progress) -> Exported:
    """Write a run with one std_msgs/Float64 for each sample of each signal.

    The topics are `<samples>/<column>`, and the messages are dated by simulated time since the
    epoch; a cut that begins anew is counted on from the end of that before. The messages of other
    topics, as those of the monitor, stand among them at the simulated time at which they came,
    as far as ROS describes their types.

    Raises:
        RunExistsError: If the folder exists.
        RunReadError: If the run cannot be read, or has no such samples.
        OSError: If it cannot be written.
    """
    topic = chosen.topic or run.samples_topic()
    parts = ExportedParts(run, chosen, progress)
    others = _others(run, topic, chosen)
    written = 0
    if path.exists():
        raise RunExistsError(path)
    with atomic_output(path) as folder, RunWriter(folder) as writer:
        topics = {k: f'{topic}/{n}' for k, n in enumerate(parts.names) if n != TIME}
        for name in topics.values():
            writer.add_topic(topic_of_type(name, NUMBER_TYPE))
        time = parts.names.index(TIME)
        for part in parts:
            stamps = _stamps(part[:, time], parts.before)
            rows = zip(stamps.tolist(), part.tolist(), strict=True)
            for number, (stamp, row) in enumerate(rows, parts.count - len(part) + 1):
                for k, name in topics.items():
                    data = encode_number(row[k])
                    writer.write(name, data, log_time=stamp, publish_time=stamp, sequence=number)
                written += len(topics)
            while others and others[0][0] <= stamps[-1]:
                _write(writer, *others.popleft())
            if written > _COMMIT_AFTER:
                writer.commit_soon()
                written = 0
        while others:
            _write(writer, *others.popleft())
    return Exported(path, parts.count, parts.continuity)


def _write(writer: RunWriter, stamp: int, raw: Raw) -> None:
    """Write a message of another topic, dated in ns."""
    kind = Topic(
        raw.topic,
        raw.type,
        bytes(raw.schema.data).decode(),
        raw.channel.metadata.get('topic_type_hash', ''),
        tuple(offered_qos(raw.channel)),
    )
    writer.add_topic(kind)
    writer.write(raw.topic, raw.data, log_time=stamp, publish_time=stamp, sequence=raw.sequence)


def _others(run: Run, samples: str, chosen: Selection) -> deque[tuple[int, Raw]]:
    """The messages of other topics that are in the chosen range, each with its new date, ns."""
    timeline, found = read_timeline(run, samples, lambda topic: topic != samples)
    if not len(timeline.last):
        return deque()
    stamps = _stamps(timeline.last, CutsInARow().before(timeline.first, timeline.last))
    kept: list[tuple[int, Raw]] = []
    for each in found:
        schema = each.raw.schema
        if each.raw.channel.message_encoding != 'cdr' or schema is None:
            continue
        if schema.encoding != 'ros2msg':
            continue
        received, _ = timeline.steady(each)
        block = min(int(np.searchsorted(timeline.received, received)), len(stamps) - 1)
        if chosen.start <= timeline.last[block] and timeline.first[block] <= chosen.end:
            kept.append((int(np.interp(received, timeline.received, stamps)), each.raw))
    return deque(sorted(kept, key=lambda pair: pair[0]))


def _stamps(times: Array, before: Array) -> Integers:
    """Dates of samples by their simulated time and what was before their cuts, s; in ns."""
    return np.rint((times + before) * 1e9).astype(np.int64)
