"""Makes a data set, or what is missing of it: parts that are there whole or not at all."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable
from concurrent.futures import Executor
from contextlib import closing
from dataclasses import replace
from functools import partial
from importlib.resources import files as package_files
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import StrictUndefined, Template

from lathe_chatter.code_identity import code_identity
from lathe_chatter.dataset.file_formats import ENDINGS, Files, files_of, read_part
from lathe_chatter.dataset.plan import Form, Plan
from lathe_chatter.dataset.windows import Table, drawn_machine, unit_of, windows_of
from lathe_chatter.errors import DatasetError, reason_of
from lathe_chatter.executors import run_batches
from lathe_chatter.model.lathe_parameter_table import LATHE
from lathe_chatter.model.machine_file import MachineDescription
from lathe_chatter.resumable_results import ResultFile

MANIFEST, CARD = 'manifest.jsonl', 'README.md'
_PART_SIZE = 8e6
"""Bytes of a part, where one machine has not more: some seconds of work, and little to lose."""


def parts_of(plan: Plan) -> dict[str, range]:
    """The machines of each part by its path, of one split each: always the same."""
    size = 4 * len(plan.columns) * len(plan.starts) * plan.length
    size = 80 * plan.samples if plan.form is Form.MCAP else size
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
    files = files_of(plan.form, table, runs, plan.duration)
    count, digest = len(table['machine']), hashlib.sha256()
    for values in table.values():
        digest.update(np.ascontiguousarray(values).data)
    described = {
        number: replace(config.described or MachineDescription(), machine=config.machine)
        for number, config in machines.items()
    }
    return files, {
        'part': part[0],
        'windows': count,
        'stable': int(table['stable'].sum()),
        'ended_early': len(runs) * len(plan.starts) - count,
        'windows_sha256': digest.hexdigest(),
        'files': {n: [len(b), hashlib.sha256(b).hexdigest()] for n, b in files.items()},
        'machines': {number: machine.sections() for number, machine in described.items()},
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
    folder = Path(folder)
    manifest = folder / MANIFEST
    try:
        if folder.is_dir() and not manifest.exists() and any(folder.iterdir()):
            raise DatasetError(f'{folder} holds other files: give another folder.')
        with closing(ResultFile(manifest, header)) as file:
            for left in folder.glob('*/.*.partial'):  # by a process that was killed
                _remove(left)
            there = {entry['part']: entry for entry in file.entries if _is_there(folder, entry)}
            missing = [[part] for part in parts_of(plan).items() if part[0] not in there]
            progress(sum(entry['windows'] for entry in there.values()), plan.windows)
            for done in run_batches(partial(make_part, plan), missing, executor=executor):
                ((files, entry),) = done.results
                _write(folder / entry['part'], files)
                there[entry['part']] = {**entry, 'processor': done.processor}
                file.add(there[entry['part']])
                progress(sum(entry['windows'] for entry in there.values()), plan.windows)
        entries = [there[name] for name in parts_of(plan)]
        template = package_files(__package__).joinpath('card.md.j2').read_text(encoding='utf-8')
        card = Template(template, undefined=StrictUndefined)
        text = card.render(plan=plan, header=header, parts=entries, unit_of=unit_of, table=LATHE)
        (folder / CARD).write_text(text, encoding='utf-8')
        in_order = [json.dumps(line) + '\n' for line in (header, *entries)]
        _write(manifest, {'.': ''.join(in_order).encode()})
    except OSError as error:
        raise DatasetError(
            f'{error.filename or folder} cannot be written: {reason_of(error)}; what is there is '
            'whole, and the same call goes on from it.'
        ) from None
    return entries


def _is_there(folder: Path, entry: dict[str, Any]) -> bool:
    """Whether each file of a part has the size that it was written with."""
    sizes = {folder / entry['part'] / n: size for n, (size, _) in entry['files'].items()}
    return all(file.is_file() and file.stat().st_size == size for file, size in sizes.items())


def _write(path: Path, files: Files) -> None:
    """Write files under another name, and rename that when they are whole."""
    unfinished = path.with_name(f'.{path.name}.partial')
    try:
        for name, content in files.items():
            (unfinished / name).parent.mkdir(parents=True, exist_ok=True)
            (unfinished / name).write_bytes(content)
        if path.is_dir():  # one that no line of the manifest speaks of
            _remove(path)
        unfinished.replace(path)
    except OSError:
        _remove(unfinished)
        raise


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def read_windows(folder: Path | str, split: str | None = None) -> Table:
    """The windows of a data set as arrays by column, of one split or of all.

    Args:
        folder: Of the data set, in Parquet, HDF5 or Zarr.
        split: As `train` or `test`.

    Raises:
        DatasetError: If there are none.
    """
    found = sorted(Path(folder).glob(f'{split or "*"}/part-*.*'))
    if not found:
        raise DatasetError(f'{folder} holds no windows{f" of {split}" if split else ""}.')
    tables = [read_part(path) for path in found]
    return {name: np.concatenate([table[name] for table in tables]) for name in tables[0]}
