"""A part of a data set as bytes, in each form that it may have; and read back as arrays."""

from __future__ import annotations

import io
import itertools
import json
import tempfile
from pathlib import Path

import numpy as np

from lathe_chatter.dataset.drawing import DrawnRun
from lathe_chatter.dataset.plan import Form
from lathe_chatter.dataset.windows import Table
from lathe_chatter.errors import optional
from lathe_chatter.lathe.config import LatheConfig
from lathe_chatter.lathe.cut_events import Knock

ENDINGS = {Form.PARQUET: '.parquet', Form.HDF5: '.h5', Form.ZARR: '.zarr', Form.MCAP: '_runs'}
Files = dict[str, bytes]
"""What a part consists of by path in its folder; of one file that path is empty."""


def files_of(form: Form, table: Table, runs: list[DrawnRun], duration: float) -> Files:
    """A part in one of the forms.

    Raises:
        MissingPackageError: If a library is missing that the form needs.
    """
    if form is Form.PARQUET:
        return {'': _parquet(table)}
    if form is Form.HDF5:
        with optional('h5py', 'HDF5').File(out := io.BytesIO(), 'w') as file:
            for name, values in table.items():
                file[name] = values.astype('S') if values.dtype.kind == 'U' else values
        return {'': out.getvalue()}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if form is Form.ZARR:
            _zarr(folder, table)
        else:
            _runs(folder, table, runs, duration)
        files = sorted(file for file in folder.rglob('*') if file.is_file())
        return {file.relative_to(folder).as_posix(): file.read_bytes() for file in files}


def _parquet(table: Table) -> bytes:
    """A column each; signals are lists of a fixed length."""
    arrow, out = optional('pyarrow', 'Parquet'), io.BytesIO()
    columns = {
        name: arrow.FixedSizeListArray.from_arrays(values.ravel(), values.shape[1])
        if values.ndim == 2
        else arrow.array(values)
        for name, values in table.items()
    }
    # Noise does not compress: that would take as long as all else and save a hundredth.
    plain = {'compression': 'none', 'use_dictionary': False, 'write_statistics': False}
    optional('pyarrow.parquet', 'Parquet').write_table(arrow.table(columns), out, **plain)
    return out.getvalue()


def _zarr(folder: Path, table: Table) -> None:
    """A group with an array each; of words their numbers, and the words as attributes."""
    zarr = optional('zarr', 'Zarr')
    words = {n: np.unique(v, return_inverse=True) for n, v in table.items() if v.dtype.kind == 'U'}
    numbers = {name: places.astype('u1') for name, (_, places) in words.items()}
    zarr.save_group(str(folder), **{**table, **numbers})
    known = {name: found.tolist() for name, (found, _) in words.items()}
    zarr.open_group(str(folder), mode='r+').attrs.update(known)


def _runs(folder: Path, table: Table, runs: list[DrawnRun], duration: float) -> None:
    """Whole runs, as `lathe-chatter simulate` leaves them, and the truth of their windows."""
    from lathe_chatter.scenario import Scenario, Step
    from lathe_chatter.scenario.simulation import simulate

    for run in runs:
        config, rate = LatheConfig(run.setup, run.cuts[0]), run.setup.sample_rate
        steps = [
            Step(_changes(before, after), at=sample / rate)
            for (_, before), (sample, after) in itertools.pairwise(run.cuts.items())
            if sample < duration * rate
        ]
        name = f'machine_{run.machine:06}_run_{run.number:04}'
        scenario = Scenario(name, name, duration, config.parameters(), tuple(steps))
        knocks = [Knock(sample / rate, impulse) for sample, impulse in run.knocks.items()]
        simulate(scenario, folder / name, knocks=knocks, monitor=False)
    facts = {name: values.tolist() for name, values in table.items() if values.ndim == 1}
    rows = (dict(zip(facts, row, strict=True)) for row in zip(*facts.values(), strict=True))
    text = ''.join(json.dumps(row) + '\n' for row in rows)
    (folder / 'truth.jsonl').write_text(text, encoding='utf-8')


def _changes(before: object, after: object) -> dict[str, object]:
    """The fields of a cut that change."""
    other = {name: value for name, value in vars(after).items() if getattr(before, name) != value}
    return {name: getattr(value, 'value', value) for name, value in other.items()}


def read_part(path: Path) -> Table:
    """The windows of a part in Parquet, HDF5 or Zarr."""
    if path.suffix == ENDINGS[Form.PARQUET]:
        table = optional('pyarrow.parquet', 'Parquet').read_table(path)
        columns = {name: table[name].combine_chunks() for name in table.column_names}
        return {
            name: column.flatten().to_numpy().reshape(len(column), -1)
            if hasattr(column.type, 'list_size')
            else column.to_numpy(zero_copy_only=False)
            for name, column in columns.items()
        }
    if path.suffix == ENDINGS[Form.HDF5]:
        with optional('h5py', 'HDF5').File(path) as file:
            arrays = {name: file[name][()] for name in file}
            return {n: v.astype('U') if v.dtype.kind == 'S' else v for n, v in arrays.items()}
    group = optional('zarr', 'Zarr').open_group(str(path), mode='r')
    words = {name: np.array(known) for name, known in group.attrs.items()}
    arrays = {name: group[name][...] for name in group.array_keys()}
    return {name: words[name][v] if name in words else v for name, v in arrays.items()}
