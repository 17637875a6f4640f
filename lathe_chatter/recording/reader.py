"""`read_run`: a recorded run as arrays and messages."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mcap.exceptions import McapError
from mcap.reader import make_reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from lathe_chatter.errors import LatheChatterError
from lathe_chatter.model import Array

_SPLIT = re.compile(r'_(\d+)\.mcap$')


_DAMAGE = (McapError, ValueError, RuntimeError, EOFError, struct.error)
"""What readers raise on a damaged file: mcap's own, a CRC, lz4's, too few bytes."""


class RunReadError(LatheChatterError):
    """A path that holds no run that can be read; the text says why."""


class Recorded(NamedTuple):
    """A recorded message.

    Attributes:
        topic: Its name.
        log_time: When it was received, ns since the epoch.
        sequence: Its number among those of its publisher.
        message: As rosbags decodes it.
    """

    topic: str
    log_time: int
    sequence: int
    message: Any


class Samples(NamedTuple):
    """The samples of one lathe.

    Attributes:
        columns: Each signal by name (n,), SI.
        log_times: When each block was received, ns since the epoch (blocks,).
        block_ends: Simulated time of the last sample of each block, s (blocks,).
        gaps: Where samples are missing: simulated times before and after, s.
    """

    columns: dict[str, Array]
    log_times: np.ndarray[Any, np.dtype[np.int64]]
    block_ends: Array
    gaps: list[tuple[float, float]]

    def simulated_time(self, log_time: int) -> float:
        """Simulated time when something else was recorded, s: that of the blocks about it."""
        relative = (self.log_times - self.log_times[0]).astype(float)
        return float(np.interp(float(log_time - self.log_times[0]), relative, self.block_ends))


@dataclass(frozen=True)
class Run:
    """A recorded run; nothing is read before it is asked for.

    Attributes:
        path: As it was given.
        files: The MCAP files in order.
    """

    path: Path
    files: tuple[Path, ...]

    @cached_property
    def topics(self) -> dict[str, str]:
        """The type of each topic by name."""
        found: dict[str, str] = {}
        for file in self.files:
            try:
                with file.open('rb') as stream:
                    summary = make_reader(stream).get_summary()
            except _DAMAGE as error:
                raise RunReadError(f'{file} is damaged: {error}.') from None
            if summary is None:
                raise RunReadError(f'{file} has no summary: it is damaged or no MCAP file.')
            for channel in summary.channels.values():
                found[channel.topic] = summary.schemas[channel.schema_id].name
        return found

    def messages(self, *topics: str) -> Iterator[Recorded]:
        """The messages of some topics in order of reception.

        Raises:
            RunReadError: If a file is damaged.
        """
        store = get_typestore(Stores.ROS2_JAZZY)
        known = set(store.fielddefs)
        for file in self.files:
            with file.open('rb') as stream:
                reader = make_reader(stream, validate_crcs=True)
                try:
                    for schema, channel, message in reader.iter_messages(topics=list(topics)):
                        if schema is None:
                            continue
                        if schema.name not in known:
                            store.register(get_types_from_msg(schema.data.decode(), schema.name))
                            known.add(schema.name)
                        yield Recorded(
                            channel.topic,
                            message.log_time,
                            message.sequence,
                            store.deserialize_cdr(message.data, schema.name),
                        )
                except _DAMAGE as error:
                    raise RunReadError(f'{file} is damaged: {error}.') from None

    def samples(self, topic: str | None = None) -> Samples:
        """The samples of a lathe, joined.

        Args:
            topic: Of the samples; may be left out where the run has one lathe.

        Raises:
            RunReadError: If there are none, or several lathes and no topic is named.
        """
        name = topic or self._only_samples()
        blocks: list[Array] = []
        log_times: list[int] = []
        labels: tuple[str, ...] = ()
        for recorded in self.messages(name):
            layout = recorded.message.layout
            labels = tuple(layout.dim[1].label.split(','))
            blocks.append(np.asarray(recorded.message.data).reshape(-1, len(labels)))
            log_times.append(recorded.log_time)
        if not blocks:
            raise RunReadError(f'{self.path} holds no samples of {name}.')
        joined = np.concatenate(blocks)
        time = labels.index('time')
        ends = np.array([block[-1, time] for block in blocks])
        starts = np.array([block[0, time] for block in blocks])
        step = float(np.median(np.diff(joined[:, time]))) if len(joined) > 1 else 0.0
        broken = np.flatnonzero(np.abs(starts[1:] - ends[:-1] - step) > 0.5 * step)
        return Samples(
            {label: joined[:, place] for place, label in enumerate(labels)},
            np.array(log_times, dtype=np.int64),
            ends,
            [(float(ends[place]), float(starts[place + 1])) for place in broken],
        )

    def _only_samples(self) -> str:
        names = sorted(name for name in self.topics if name.endswith('/samples'))
        if not names:
            raise RunReadError(f'{self.path} holds no samples of a lathe.')
        if len(names) > 1:
            raise RunReadError(f'{self.path} holds several lathes, {", ".join(names)}: name one.')
        return names[0]


def read_run(path: Path | str) -> Run:
    """Open a recorded run.

    Args:
        path: A rosbag2 folder with MCAP files, or one MCAP file.

    Raises:
        RunReadError: If there is no such run.
    """
    path = Path(path)
    if path.is_file():
        return Run(path, (path,))
    files = [file for file in path.glob('*.mcap') if _SPLIT.search(file.name)]
    if not files:
        what = 'holds no recorded run' if path.is_dir() else 'does not exist'
        raise RunReadError(f'{path} {what}.')
    return Run(path, tuple(sorted(files, key=_split_number)))


def _split_number(file: Path) -> int:
    """The place of a file among those of a split run."""
    match = _SPLIT.search(file.name)
    return int(match[1]) if match else 0
