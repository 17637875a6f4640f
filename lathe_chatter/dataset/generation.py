"""Makes a data set, or what is missing of it: parts that are there whole or not at all."""

from __future__ import annotations

import hashlib
import itertools
import shutil
import warnings
from collections.abc import Callable
from concurrent.futures import Executor
from contextlib import closing, nullcontext
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from lathe_chatter.atomic_output import atomic_output
from lathe_chatter.code_identity import code_identity
from lathe_chatter.dataset.plan import Form, Plan
from lathe_chatter.dataset.windows import DrawnRun, Table, drawn_machine, unit_of, windows_of
from lathe_chatter.errors import DatasetError, optional, reason_of
from lathe_chatter.executors import run_batches
from lathe_chatter.lathe.change_and_knock_sentences import Knock
from lathe_chatter.lathe.doubts import doubts
from lathe_chatter.model.lathe_parameter_table import LATHE
from lathe_chatter.resumable_results import ResultFile, json_line
from lathe_chatter.shipped_files import rendered

ENDINGS = {Form.PARQUET: '.parquet', Form.HDF5: '.h5', Form.ZARR: '.zarr', Form.MCAP: '_runs'}
Files = dict[str, bytes]
"""What a part consists of, by path in its folder; a part that is one file is `.`."""
MANIFEST, CARD = 'manifest.jsonl', 'README.md'
_ENTRY = 'part windows stable too_fast ended_early windows_sha256 files machines processor'
"""What a line of the manifest says of a part."""
_PART_SIZE = 8e6
"""Bytes of a part, where one machine has not more: some seconds of work, and little to lose."""


def parts_of(plan: Plan) -> dict[str, range]:
    """The machines of each part by its path, of one split each: always the same."""
    windows = 4 * len(plan.columns) * len(plan.starts) * plan.length
    size = 80 * plan.samples if plan.form is Form.MCAP else windows
    step = max(1, round(_PART_SIZE / (plan.runs * size)))
    return {
        f'{split}/part-{number:05}{ENDINGS[plan.form]}': machines[first : first + step]
        for split, machines in plan.machines_of().items()
        for number, first in enumerate(range(0, len(machines), step))
    }


def make_part(plan: Plan, part: tuple[str, range]) -> tuple[Files, dict[str, Any]]:
    """The bytes of a part, and what the manifest says of it."""
    machines = {number: drawn_machine(plan, number) for number in part[1]}
    table, runs = windows_of(plan, machines)
    files = _files_of(plan, table, runs)
    digest = hashlib.sha256(b''.join(values.tobytes() for values in table.values()))
    return files, {
        'part': part[0],
        'windows': len(table['machine']),
        'stable': int(table['stable'].sum()),
        'too_fast': sum(bool(doubts(one.setup, one.cut)) for one in machines.values()),
        'ended_early': len(runs) * len(plan.starts) - len(table['machine']),
        'windows_sha256': digest.hexdigest(),
        'files': {n: [len(b), hashlib.sha256(b).hexdigest()] for n, b in files.items()},
        'machines': {number: config.description.sections() for number, config in machines.items()},
    }


def make_dataset(
    plan: Plan,
    folder: Path | str,
    *,
    executor: Executor | None = None,
    progress: Callable[[int, int], object] = lambda _done, _total: None,
) -> list[dict[str, Any]]:
    """Make a data set in a folder, or go on where that was interrupted.

    Args:
        plan: What it is.
        folder: To make, or that holds some of the same plan already.
        executor: Where it is made, see `executors`; by default threads, one a core.
        progress: Is told how many windows of how many are there.

    Returns:
        What the manifest says of each part.

    Raises:
        DatasetError: If the folder holds something else, or cannot be written.
        ResultFileError: If it holds the data of another plan, or of another version.
        WorkerError: If workers are lost, or have another version.
        MissingPackageError: If a library is missing that the form needs.
    """
    identity = hashlib.sha256(repr(plan).encode()).hexdigest()[:16]
    header = {'kind': 'lathe_chatter data set 2', 'plan': identity, 'code': code_identity()}
    folder, manifest = Path(folder), Path(folder) / MANIFEST
    try:
        if folder.is_dir() and not manifest.exists() and any(folder.iterdir()):
            raise DatasetError(f'{folder} holds other files: give another folder.')
        with closing(ResultFile(manifest, header, _known_part)) as file:
            there = {entry['part']: entry for entry in file.entries if _is_there(folder, entry)}
            missing = [[part] for part in parts_of(plan).items() if part[0] not in there]
            _write(folder / CARD, _card(plan=plan, header=header, parts=[]))
            progress(sum(entry['windows'] for entry in there.values()), plan.windows)
            for done in run_batches(partial(make_part, plan), missing, executor=executor):
                ((files, entry),) = done.results
                _write(folder / entry['part'], files)
                there[entry['part']] = {**entry, 'processor': done.processor}
                file.add(there[entry['part']])
                progress(sum(entry['windows'] for entry in there.values()), plan.windows)
        entries = [there[name] for name in parts_of(plan)]
        _write(folder / CARD, _card(plan=plan, header=header, parts=entries))
        _write(manifest, {'.': b''.join(map(json_line, [header, *entries]))})
    except OSError as error:
        said = f'{error.filename or folder} cannot be written: {reason_of(error)}; what is there'
        raise DatasetError(f'{said} is whole, and the same call goes on from it.') from None
    return entries


def _card(**facts: Any) -> Files:
    """The data card, of a data set that is whole, or before: then without parts."""
    return {'.': rendered('dataset/card.md.j2', **facts, unit_of=unit_of, table=LATHE).encode()}


def _known_part(entry: dict[str, Any]) -> dict[str, Any]:
    """A line of the manifest; a ValueError if it is another."""
    if entry.keys() != {*_ENTRY.split()}:
        raise ValueError(entry)
    return entry


def _is_there(folder: Path, entry: dict[str, Any]) -> bool:
    """Whether each file of a part has the size that it was written with."""
    files = ((folder / entry['part'] / name, size) for name, (size, _) in entry['files'].items())
    return all(file.is_file() and file.stat().st_size == size for file, size in files)


def _write(path: Path, files: Files) -> None:
    with atomic_output(path) as part:
        for file, content in files.items():
            (part / file).parent.mkdir(parents=True, exist_ok=True)
            (part / file).write_bytes(content)
        if path.is_dir():  # one that no line of the manifest speaks of
            shutil.rmtree(path)


def read_windows(folder: Path | str, split: str | None = None) -> Table:
    """The windows of a data set as arrays by column, of one split or of all.

    Args:
        folder: Of the data set, in Parquet, HDF5 or Zarr.
        split: As `train` or `test`.

    Raises:
        DatasetError: If there are none.
    """
    found = map(_read_part, sorted(Path(folder).glob(f'{split or "*"}/part-*.*')))
    tables = [table for table in found if len(table['machine'])]
    if not tables:
        raise DatasetError(f'{folder} holds no windows{f" of {split}" if split else ""}.')
    return {name: np.concatenate([table[name] for table in tables]) for name in tables[0]}


def _files_of(plan: Plan, table: Table, runs: list[DrawnRun]) -> Files:
    """A part in the form of the plan.

    Raises:
        MissingPackageError: If a library is missing that the form needs.
    """
    with TemporaryDirectory() as name:
        part = Path(name) / f'part{ENDINGS[plan.form]}'
        if plan.form is Form.PARQUET:
            _write_parquet(part, table)
        elif plan.form is Form.MCAP:
            _write_runs(part, table, runs, plan.duration)
        else:
            with warnings.catch_warnings(), _arrays(part, 'w') as arrays:
                warnings.simplefilter('ignore')  # Zarr 3 has not settled on bytes yet
                for column, values in table.items():  # words as bytes, as both hold them
                    arrays[column] = values.astype('S') if values.dtype.kind == 'U' else values
                    arrays[column].attrs['units'] = unit_of(column)
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
    fields = [arrow.field(n, c.type, metadata={'unit': unit_of(n)}) for n, c in columns.items()]
    rows = arrow.table(columns, schema=arrow.schema(fields))
    # Noise does not compress: that would take as long as all else and save a hundredth.
    plain = {'compression': 'none', 'use_dictionary': False, 'write_statistics': False}
    optional('pyarrow.parquet', 'Parquet').write_table(rows, path, **plain)


def _write_runs(folder: Path, table: Table, runs: list[DrawnRun], duration: float) -> None:
    """Whole runs, as `lathe-chatter simulate` leaves them, and the truth of their windows."""
    from lathe_chatter.scenario import Scenario, Step
    from lathe_chatter.scenario.simulation import simulate

    for run in runs:
        rate = run.config.setup.sample_rate
        steps = [
            Step(dict(vars(after).items() - vars(before).items()), at=sample / rate)
            for (_, before), (sample, after) in itertools.pairwise(run.cuts.items())
        ]
        name = f'machine_{run.machine:06}_run_{run.number:04}'
        scenario = Scenario(name, name, duration, run.config.parameters(), tuple(steps))
        knocks = [Knock(sample / rate, impulse) for sample, impulse in run.knocks.items()]
        simulate(scenario, folder / name, knocks=knocks, monitor=False)
    facts = {name: values.tolist() for name, values in table.items() if values.ndim == 1}
    rows = (dict(zip(facts, row, strict=True)) for row in zip(*facts.values(), strict=True))
    _write(folder / 'truth.jsonl', {'.': b''.join(map(json_line, rows))})


def _read_part(path: Path) -> Table:
    """The windows of a part in Parquet, HDF5 or Zarr."""
    if path.suffix == ENDINGS[Form.PARQUET]:
        rows = optional('pyarrow.parquet', 'Parquet').read_table(path)
        return {name: np.array([*rows[name].to_numpy()]) for name in rows.column_names}
    with _arrays(path, 'r') as arrays:
        table = {name: arrays[name][...] for name in arrays}
    return {n: v.astype('U') if v.dtype.kind == 'S' else v for n, v in table.items()}


def _arrays(path: Path, mode: str) -> Any:
    """The arrays of HDF5 or Zarr by name, which are read and written alike."""
    if path.suffix == ENDINGS[Form.ZARR]:
        return nullcontext(optional('zarr', 'Zarr').open_group(str(path), mode=mode))
    return optional('h5py', 'HDF5').File(path, mode)
