"""A part of a data set as bytes, in each form that it may have; and read back as arrays."""

from __future__ import annotations

import itertools
import json
import tempfile
import warnings
from pathlib import Path

from lathe_chatter.dataset.plan import Form
from lathe_chatter.dataset.windows import DrawnRun, Table, unit_of
from lathe_chatter.errors import optional
from lathe_chatter.lathe.change_and_knock_sentences import Knock

ENDINGS = {Form.PARQUET: '.parquet', Form.HDF5: '.h5', Form.ZARR: '.zarr', Form.MCAP: '_runs'}
Files = dict[str, bytes]
"""What a part consists of, by path in its folder; a part that is one file is `.`."""


def files_of(form: Form, table: Table, runs: list[DrawnRun], duration: float) -> Files:
    """A part in one of the forms.

    Raises:
        MissingPackageError: If a library is missing that the form needs.
    """
    # Words as bytes, which HDF5 and Zarr hold as they are.
    plain = {n: v.astype('S') if v.dtype.kind == 'U' else v for n, v in table.items()}
    with tempfile.TemporaryDirectory() as name:
        part = Path(name) / 'part'
        if form is Form.PARQUET:
            _write_parquet(part, table)
        elif form is Form.HDF5:
            with optional('h5py', 'HDF5').File(part, 'w') as file:
                file.update(plain)
                for column in plain:
                    file[column].attrs['units'] = unit_of(column)
        elif form is Form.ZARR:
            with warnings.catch_warnings():
                warnings.simplefilter('ignore')  # Zarr 3 has not settled on bytes yet
                zarr = optional('zarr', 'Zarr')
                zarr.save_group(str(part), **plain)
                group = zarr.open_group(str(part), mode='r+')
                for column in plain:
                    group[column].attrs['units'] = unit_of(column)
        else:
            _write_runs(part, table, runs, duration)
        files = [part] if part.is_file() else sorted(f for f in part.rglob('*') if f.is_file())
        return {file.relative_to(part).as_posix(): file.read_bytes() for file in files}


def _write_parquet(path: Path, table: Table) -> None:
    """A column each; signals are lists of a fixed length."""
    arrow = optional('pyarrow', 'Parquet')
    columns = {
        name: arrow.FixedSizeListArray.from_arrays(values.ravel(), values.shape[1])
        if values.ndim == 2
        else arrow.array(values)
        for name, values in table.items()
    }
    schema = arrow.schema(
        arrow.field(name, column.type, metadata={'unit': unit_of(name)})
        for name, column in columns.items()
    )
    # Noise does not compress: that would take as long as all else and save a hundredth.
    plain = {'compression': 'none', 'use_dictionary': False, 'write_statistics': False}
    optional('pyarrow.parquet', 'Parquet').write_table(
        arrow.table(columns, schema=schema), path, **plain
    )


def _write_runs(folder: Path, table: Table, runs: list[DrawnRun], duration: float) -> None:
    """Whole runs, as `lathe-chatter simulate` leaves them, and the truth of their windows."""
    from lathe_chatter.scenario import Scenario, Step
    from lathe_chatter.scenario.simulation import simulate

    for run in runs:
        rate, steps = run.config.setup.sample_rate, list[Step]()
        for (_, before), (sample, after) in itertools.pairwise(run.cuts.items()):
            new = {n: v for n, v in vars(after).items() if getattr(before, n) != v}
            if sample < duration * rate:
                changes = {name: getattr(value, 'value', value) for name, value in new.items()}
                steps.append(Step(changes, at=sample / rate))
        name = f'machine_{run.machine:06}_run_{run.number:04}'
        scenario = Scenario(name, name, duration, run.config.parameters(), tuple(steps))
        knocks = [Knock(sample / rate, impulse) for sample, impulse in run.knocks.items()]
        simulate(scenario, folder / name, knocks=knocks, monitor=False)
    facts = {name: values.tolist() for name, values in table.items() if values.ndim == 1}
    rows = (dict(zip(facts, row, strict=True)) for row in zip(*facts.values(), strict=True))
    lines = [json.dumps(row) + '\n' for row in rows]
    (folder / 'truth.jsonl').write_text(''.join(lines), encoding='utf-8')


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
    else:
        group = optional('zarr', 'Zarr').open_group(str(path), mode='r')
        arrays = {name: group[name][...] for name in group.array_keys()}
    return {n: v.astype('U') if v.dtype.kind == 'S' else v for n, v in arrays.items()}
