"""A run as files for other programs: CSV, Parquet, MAT and HDF5.

Nothing is held at once but some seconds of the run, and every number keeps its last bit.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.atomic_output import atomic_output
from lathe_chatter.errors import ExportExistsError, ParameterError, RunReadError, optional
from lathe_chatter.recording.run import Run
from lathe_chatter.recording.sample_blocks import TIME, CutsInARow
from lathe_chatter.recording.sample_series import Selection
from lathe_chatter.samples.columns import UNITS
from lathe_chatter.samples.continuity import Continuity, time_text

_MOST_IN_MAT = 2**28 - 1
"""Samples: a variable of a MAT file has less than 2 GB."""

Progress = Callable[[int], None]
"""Told how many samples have been written since it was told last."""


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


def to_csv(run: Run, path: Path, chosen: Selection, progress: Progress) -> Exported:
    """Write samples as CSV; every number is read back to its last bit.

    The head has the names of the columns, each with its unit, as `cutting_force [N]`.

    Raises:
        ExportExistsError: If the file exists.
        RunReadError: If the run cannot be read, or has no such samples.
        OSError: If the file cannot be written.
    """
    parts = ExportedParts(run, chosen, progress)
    with _new(path) as file, file.open('w', encoding='ascii', newline='') as stream:
        stream.write(','.join(f'{name} [{UNITS.get(name, "")}]' for name in parts.names) + '\n')
        for part in parts:
            stream.writelines(','.join(map(repr, row)) + '\n' for row in part.tolist())
    return Exported(path, parts.count, parts.continuity)


def to_parquet(run: Run, path: Path, chosen: Selection, progress: Progress) -> Exported:
    """Write samples as Parquet, with units, gaps and restarts in its metadata.

    Raises:
        MissingPackageError: If pyarrow is not installed.
        ExportExistsError: If the file exists.
        RunReadError: If the run cannot be read, or has no such samples.
        OSError: If the file cannot be written.
    """
    arrow = optional('pyarrow', 'Parquet')
    parquet = optional('pyarrow.parquet', 'Parquet')
    parts = ExportedParts(run, chosen, progress)
    schema = arrow.schema(
        [
            arrow.field(n, arrow.float64(), nullable=False, metadata={'unit': UNITS.get(n, '')})
            for n in parts.names
        ]
    )
    form = {'compression': 'zstd', 'use_dictionary': False, 'use_byte_stream_split': True}
    with _new(path) as file, parquet.ParquetWriter(file, schema, **form) as writer:
        for part in parts:
            arrays = [np.ascontiguousarray(column) for column in part.T]
            writer.write_table(arrow.table(arrays, schema=schema))
        broken = {'gaps': parts.continuity.gap_places, 'restarts': parts.continuity.restart_places}
        told = {name: json.dumps(value) for name, value in broken.items()}
        writer.add_key_value_metadata({**told, 'run': str(run.path)})
    return Exported(path, parts.count, parts.continuity)


def to_mat(run: Run, path: Path, chosen: Selection, progress: Progress) -> Exported:
    """Write samples as a MAT file (version 5) for MATLAB, Octave and SciPy.

    Each signal is a column of doubles; beside them `units`, a structure, `gaps` and `restarts`
    (m x 2, s) and `run`.

    Raises:
        ExportExistsError: If the file exists.
        RunReadError: If the run cannot be read, has no such samples, or too many for the format.
        OSError: If the file cannot be written.
    """
    from scipy.io import savemat  # half a second to load, and only wanted here

    parts = ExportedParts(run, chosen, progress)
    with _new(path) as file:
        kept = []
        for part in parts:
            kept.append(part)
            if parts.count > _MOST_IN_MAT:
                raise RunReadError(
                    f'{run.path} has more samples than a MAT file can hold, {_MOST_IN_MAT}: '
                    'choose a range of time, or HDF5.'
                )
        signals: dict[str, Any] = {
            name: np.concatenate([part[:, k] for part in kept])
            for k, name in enumerate(parts.names)
        }
        facts: dict[str, Any] = {
            'units': {name: UNITS.get(name, '') for name in parts.names},
            'gaps': np.reshape(parts.continuity.gap_places, (-1, 2)),
            'restarts': np.reshape(parts.continuity.restart_places, (-1, 2)),
            'run': str(run.path),
        }
        savemat(
            str(file),
            {**signals, **facts},
            appendmat=False,
            oned_as='column',
            long_field_names=True,
        )
    return Exported(path, parts.count, parts.continuity)


def to_hdf5(run: Run, path: Path, chosen: Selection, progress: Progress) -> Exported:
    """Write samples as HDF5, which MATLAB (`h5read`), h5py and many others read.

    Each signal is a dataset with its `units`; beside them `gaps` and `restarts` (m x 2, s).

    Raises:
        MissingPackageError: If h5py is not installed.
        ExportExistsError: If the file exists.
        RunReadError: If the run cannot be read, or has no such samples.
        OSError: If the file cannot be written.
    """
    h5py = optional('h5py', 'HDF5')
    parts = ExportedParts(run, chosen, progress)
    with _new(path) as whole, h5py.File(whole, 'w') as file:
        kind = {'dtype': 'f8', 'maxshape': (None,), 'chunks': (1 << 16,)}
        signals = [file.create_dataset(name, (0,), **kind) for name in parts.names]
        for name, signal in zip(parts.names, signals, strict=True):
            signal.attrs['units'] = UNITS.get(name, '')
        for part in parts:
            for signal, column in zip(signals, part.T, strict=True):
                signal.resize((parts.count,))
                signal[-len(column) :] = column
        for name in ('gap', 'restart'):
            places = getattr(parts.continuity, f'{name}_places')
            file[f'{name}s'] = np.reshape(np.array(places, float), (-1, 2))
            file[f'{name}s'].attrs['units'] = UNITS[TIME]
        file.attrs['run'] = str(run.path)
    return Exported(path, parts.count, parts.continuity)


class ExportedParts:
    """Chosen samples, some seconds at a time.

    Args:
        run: Which has them.
        chosen: Which are wanted.
        progress: Told how many have been looked at.

    Attributes:
        names: Of the columns, in the order of the record.
        count: Samples so far.
        continuity: Where they do not follow each other, so far.
        before: How long the cuts took that were before each of the latest part, s (n,).
    """

    def __init__(self, run: Run, chosen: Selection, progress: Progress) -> None:
        """Look whether there are such columns.

        Raises:
            ParameterError: If the range of time is none.
            RunReadError: If the run cannot be read, or has no such samples or columns.
        """
        if not chosen.start <= chosen.end:
            raise ParameterError('start', chosen.start, 's', f'at most the end, {chosen.end:g} s')
        self._run, self._chosen, self._progress = run, chosen, progress
        self.count, self.continuity = 0, Continuity(remember=True)
        self.before: Array = np.zeros(0)
        first = next(iter(run.sample_blocks(chosen.topic)), None)
        if first is None:
            topic = chosen.topic or run.samples_topic()
            raise run.without_samples(topic)
        wanted = first.columns if chosen.columns is None else (TIME, *chosen.columns)
        missing = sorted(set(wanted) - set(first.columns))
        if missing:
            raise RunReadError(
                f'The samples of {run.path} have no column {", ".join(missing)}, only '
                f'{", ".join(first.columns)}.'
            )
        self.names = tuple(name for name in first.columns if name in wanted)

    def __iter__(self) -> Iterator[Array]:
        """Samples (n, k)."""
        cuts = CutsInARow()
        for blocks in self._run.sample_blocks(self._chosen.topic, self.names):
            some = blocks.rows > 0
            self.before = np.repeat(cuts.before(*blocks.spans[:, some]), blocks.rows[some])
            inside = self._chosen.inside(blocks.times)
            signals = blocks.signals
            if inside is not None:
                signals, self.before = signals[:, inside], self.before[inside]
            if signals.shape[1]:
                self.continuity.follow(signals[self.names.index(TIME)])
                self.count += signals.shape[1]
                yield signals.T
            self._progress(len(blocks.times))
        if self.count == 0:
            start, end = self._chosen.start, self._chosen.end
            until = f'to {time_text(end)}' if math.isfinite(end) else 'on'
            raise RunReadError(
                f'{self._run.path} holds no samples from {time_text(start)} {until}.'
            )


def _new(path: Path) -> AbstractContextManager[Path]:
    """Where to write a file that is not there yet."""
    if path.exists():
        raise ExportExistsError(path)
    return atomic_output(path)


def discontinuity_sentences(exported: Exported) -> Iterable[str]:
    """What is to be known of samples that do not follow each other."""
    for before, after in exported.continuity.gap_places:
        yield f'samples are missing between {time_text(before)} and {time_text(after)}.'
    for before, after in exported.continuity.restart_places:
        yield f'simulated time goes back from {time_text(before)} to {time_text(after)}.'
