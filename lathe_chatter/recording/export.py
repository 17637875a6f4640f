"""A run as files for other programs: CSV, Parquet, and MCAP with one message per sample.

Nothing is held at once but some seconds of the run, and every number keeps its last bit.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lathe_chatter.arrays import Array
from lathe_chatter.errors import LatheChatterError, ParameterError
from lathe_chatter.recording.atomic_output import atomic_folder
from lathe_chatter.recording.dataframes import optional
from lathe_chatter.recording.ros_messages import topic_of_type
from lathe_chatter.recording.run import Run, RunReadError
from lathe_chatter.recording.sample_reader import TIME
from lathe_chatter.recording.sample_series import Selection
from lathe_chatter.recording.writer import RunWriter
from lathe_chatter.samples.codec import encode_number
from lathe_chatter.samples.columns import UNITS
from lathe_chatter.samples.continuity import Continuity, time_text

NUMBER_TYPE = 'std_msgs/msg/Float64'
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
        continuity: Where they do not follow each other.
    """

    path: Path
    samples: int
    continuity: Continuity


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
    return Exported(path, parts.count, parts.continuity)


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
        broken = {'gaps': parts.continuity.gap_places, 'restarts': parts.continuity.restart_places}
        told = {name: json.dumps(value) for name, value in broken.items()}
        writer.add_key_value_metadata({**told, 'run': str(run.path)})
    return Exported(path, parts.count, parts.continuity)


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
        topics = {k: f'{topic}/{n}' for k, n in enumerate(parts.names) if n != TIME}
        for name in topics.values():
            writer.add_topic(topic_of_type(name, NUMBER_TYPE))
        time = parts.names.index(TIME)
        for part in parts:
            for number, row in enumerate(part.tolist(), parts.count - len(part) + 1):
                stamp = base + round(row[time] * 1e9)
                if stamp <= last and number > 1:
                    base += last
                    stamp += last
                last = stamp
                for k, name in topics.items():
                    data = encode_number(row[k])
                    writer.write(name, data, log_time=stamp, publish_time=stamp, sequence=number)
                written += len(topics)
            if written > _COMMIT_AFTER:
                writer.commit_soon()
                written = 0
    return Exported(path, parts.count, parts.continuity)


class _Parts:
    """Chosen samples, some seconds at a time.

    Attributes:
        names: Of the columns, in the order of the record.
        count: Samples so far.
        continuity: Where they do not follow each other, so far.
    """

    def __init__(self, run: Run, chosen: Selection, progress: Progress | None) -> None:
        if not chosen.start <= chosen.end:
            raise ParameterError('start', chosen.start, 's', f'at most the end, {chosen.end:g} s')
        self._run, self._chosen, self._progress = run, chosen, progress
        self.count, self.continuity = 0, Continuity(remember=True)
        first = next(iter(run.sample_blocks(chosen.topic)), None)
        if first is None:
            topic = chosen.topic or run.samples_topic()
            raise run.without_samples(topic)
        wanted = first.columns if chosen.columns is None else (TIME, *chosen.columns)
        missing = sorted(set(wanted) - set(first.columns))
        if missing:
            raise RunReadError(f'The samples of {run.path} have no column {", ".join(missing)}.')
        self.names = tuple(name for name in first.columns if name in wanted)

    def __iter__(self) -> Iterator[Array]:
        """Samples (n, k)."""
        for blocks in self._run.sample_blocks(self._chosen.topic, self.names):
            inside = self._chosen.inside(blocks.times)
            signals = blocks.signals if inside is None else blocks.signals[:, inside]
            if signals.shape[1]:
                self.continuity.follow(signals[self.names.index(TIME)])
                self.count += signals.shape[1]
                yield signals.T
            if self._progress is not None:
                self._progress(len(blocks.times))
        if self.count == 0:
            start, end = self._chosen.start, self._chosen.end
            until = f'to {time_text(end)}' if math.isfinite(end) else 'on'
            raise RunReadError(
                f'{self._run.path} holds no samples from {time_text(start)} {until}.'
            )


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


def discontinuity_sentences(exported: Exported) -> Iterable[str]:
    """What is to be known of samples that do not follow each other."""
    for before, after in exported.continuity.gap_places:
        yield f'samples are missing between {time_text(before)} and {time_text(after)}.'
    for before, after in exported.continuity.restart_places:
        yield f'simulated time goes back from {time_text(before)} to {time_text(after)}.'
