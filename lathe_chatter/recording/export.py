"""A run as files for other programs: CSV, Parquet, and MCAP with one message per sample.

Nothing is held at once but some seconds of the run, and every number keeps its last bit.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lathe_chatter.arrays import Array
from lathe_chatter.errors import LatheChatterError, ParameterError
from lathe_chatter.recording.atomic_output import atomic_folder
from lathe_chatter.recording.dataframes import UNITS, optional
from lathe_chatter.recording.ros_messages import topic_of_type
from lathe_chatter.recording.run import Run, RunReadError
from lathe_chatter.recording.sample_series import Seams, at
from lathe_chatter.recording.writer import RunWriter

NUMBER_TYPE = 'std_msgs/msg/Float64'
_TIME = 'time'
_NUMBER = struct.Struct('<4sd')
_ENCAPSULATION = b'\x00\x01\x00\x00'
_COMMIT_AFTER = 100_000
"""Messages after which an unrolled file is put on disk."""

Progress = Callable[[int], None]
"""Told how many samples have been written since it was told last."""


class ExportExistsError(LatheChatterError):
    """A file that is there already: nothing is overwritten."""

    def __init__(self, path: Path) -> None:
        """Name the file."""
        super().__init__(f'{path} exists already, and no file is overwritten.')


class Exported(NamedTuple):
    """What was written.

    Attributes:
        path: The file or folder.
        samples: How many.
        seams: Where they do not follow each other.
    """

    path: Path
    samples: int
    seams: Seams


class Selection(NamedTuple):
    """Which samples of a run.

    Attributes:
        topic: Of the samples; None where the run has one lathe.
        columns: Names; None for all. The time is always among them.
        start: Simulated time of the first, s.
        end: Simulated time of the last, s.
    """

    topic: str | None = None
    columns: tuple[str, ...] | None = None
    start: float = -np.inf
    end: float = np.inf


def to_csv(
    run: Run, path: Path, chosen: Selection | None = None, progress: Progress | None = None
) -> Exported:
    """Write samples as CSV, with a head of names; every number is read back to its last bit.

    Raises:
        ExportExistsError: If the file exists.
        RunReadError: If the run cannot be read, or has no such samples.
        OSError: If the file cannot be written.
    """
    parts = _Parts(run, chosen or Selection(), progress)
    with _whole(path), path.open('w', encoding='ascii', newline='') as stream:
        stream.write(','.join(parts.names) + '\n')
        for part in parts:
            stream.writelines(','.join(map(repr, row)) + '\n' for row in part.tolist())
    return Exported(path, parts.count, parts.seams)


def to_parquet(
    run: Run, path: Path, chosen: Selection | None = None, progress: Progress | None = None
) -> Exported:
    """Write samples as Parquet, with units, gaps and restarts in its metadata.

    Raises:
        MissingPackageError: If pyarrow is not installed.
        ExportExistsError: If the file exists.
        RunReadError: If the run cannot be read, or has no such samples.
        OSError: If the file cannot be written.
    """
    arrow = optional('pyarrow', 'Parquet')
    parquet = optional('pyarrow.parquet', 'Parquet')
    parts = _Parts(run, chosen or Selection(), progress)
    schema = arrow.schema(
        [
            arrow.field(n, arrow.float64(), nullable=False, metadata={'unit': UNITS.get(n, '')})
            for n in parts.names
        ]
    )
    form = {'compression': 'zstd', 'use_dictionary': False, 'use_byte_stream_split': True}
    with _whole(path), parquet.ParquetWriter(path, schema, **form) as writer:
        for part in parts:
            arrays = [np.ascontiguousarray(column) for column in part.T]
            writer.write_table(arrow.table(arrays, schema=schema))
        seams = {'gaps': parts.seams.gaps, 'restarts': parts.seams.restarts}
        told = {name: json.dumps(value) for name, value in seams.items()}
        writer.add_key_value_metadata({**told, 'run': str(run.path)})
    return Exported(path, parts.count, parts.seams)


def unroll(
    run: Run, path: Path, chosen: Selection | None = None, progress: Progress | None = None
) -> Exported:
    """Write a run with one std_msgs/Float64 for each sample of each signal.

    The topics are `<samples>/<column>`, and the messages are dated by simulated time since the
    epoch; where simulated time goes back, it is counted on from there.

    Raises:
        RunExistsError: If the folder exists.
        RunReadError: If the run cannot be read, or has no such samples.
        OSError: If it cannot be written.
    """
    chosen = chosen or Selection()
    parts = _Parts(run, chosen, progress)
    topic = chosen.topic or run.samples_topic()
    written, base, last = 0, 0, 0
    with atomic_folder(path), RunWriter(path) as writer:
        topics = {k: f'{topic}/{n}' for k, n in enumerate(parts.names) if n != _TIME}
        for name in topics.values():
            writer.add_topic(topic_of_type(name, NUMBER_TYPE))
        time = parts.names.index(_TIME)
        for part in parts:
            for number, row in enumerate(part.tolist(), parts.count - len(part) + 1):
                stamp = base + round(row[time] * 1e9)
                if stamp <= last and number > 1:
                    base += last
                    stamp += last
                last = stamp
                for k, name in topics.items():
                    data = _NUMBER.pack(_ENCAPSULATION, row[k])
                    writer.write(name, data, log_time=stamp, publish_time=stamp, sequence=number)
                written += len(topics)
            if written > _COMMIT_AFTER:
                writer.commit_soon()
                written = 0
    return Exported(path, parts.count, parts.seams)


class _Parts:
    """Chosen samples, some seconds at a time.

    Attributes:
        names: Of the columns, in the order of the record.
        count: Samples so far.
        seams: Where they do not follow each other, so far.
    """

    def __init__(self, run: Run, chosen: Selection, progress: Progress | None) -> None:
        if not chosen.start <= chosen.end:
            raise ParameterError('start', chosen.start, 's', f'at most the end, {chosen.end:g} s')
        self._run, self._chosen, self._progress = run, chosen, progress
        self.count, self.seams = 0, Seams()
        first = next(iter(run.sample_blocks(chosen.topic)), None)
        if first is None:
            topic = chosen.topic or run.samples_topic()
            raise run.without_samples(topic)
        wanted = first.columns if chosen.columns is None else (_TIME, *chosen.columns)
        missing = sorted(set(wanted) - set(first.columns))
        if missing:
            raise RunReadError(f'The samples of {run.path} have no column {", ".join(missing)}.')
        self.names = tuple(name for name in first.columns if name in wanted)

    def __iter__(self) -> Iterator[Array]:
        """Samples (n, k)."""
        for blocks in self._run.sample_blocks(self._chosen.topic):
            places = [blocks.columns.index(name) for name in self.names]
            part = blocks.samples[:, places]
            time = part[:, self.names.index(_TIME)]
            if len(time) and (self._chosen.start > time.min() or self._chosen.end < time.max()):
                inside = (time >= self._chosen.start) & (time <= self._chosen.end)
                part, time = part[inside], time[inside]
            if len(time):
                self.seams.follow(time)
                self.count += len(part)
                yield part
            if self._progress is not None:
                self._progress(len(blocks.samples))
        if self.count == 0:
            start, end = self._chosen.start, self._chosen.end
            until = f'to {at(end)}' if math.isfinite(end) else 'on'
            raise RunReadError(f'{self._run.path} holds no samples from {at(start)} {until}.')


@contextmanager
def _whole(path: Path) -> Iterator[None]:
    """A new file that is there whole or not at all."""
    if path.exists():
        raise ExportExistsError(path)
    try:
        yield
    except BaseException:
        path.unlink(missing_ok=True)
        raise


def seam_sentences(exported: Exported) -> Iterable[str]:
    """What is to be known of samples that do not follow each other."""
    for before, after in exported.seams.gaps:
        yield f'samples are missing between {at(before)} and {at(after)}.'
    for before, after in exported.seams.restarts:
        yield f'simulated time goes back from {at(before)} to {at(after)}.'
