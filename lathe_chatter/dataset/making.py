"""Makes a data set, or what is missing of it: parts that are there whole or not at all."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable
from concurrent.futures import Executor
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lathe_chatter.code_identity import code_identity
from lathe_chatter.dataset.card import data_card
from lathe_chatter.dataset.drawing import drawn_machine
from lathe_chatter.dataset.forms import ENDINGS, Files, files_of, read_part
from lathe_chatter.dataset.plan import Form, Plan
from lathe_chatter.dataset.windows import Table, windows_of
from lathe_chatter.errors import DatasetError, reason_of
from lathe_chatter.executors import run_batches
from lathe_chatter.result_file import ResultFile

MANIFEST, CARD = 'manifest.jsonl', 'README.md'
_KIND = 'lathe_chatter data set 1'
_PART_SIZE = 8e6
"""Bytes of a part, where one machine has not more: some seconds of work, and little to lose."""


class Part(NamedTuple):
    """A part: its path in the folder, and its machines."""

    name: str
    machines: range


def parts_of(plan: Plan) -> list[Part]:
    """The parts of a plan, each of one split: the same however often they are made."""
    windows = len(plan.starts) * plan.length * len(plan.columns) * 4
    size = 80 * plan.samples if plan.form is Form.MCAP else windows
    step = max(1, round(_PART_SIZE / (plan.runs * size)))
    return [
        Part(f'{split}/part-{number:05}{ENDINGS[plan.form]}', machines[first : first + step])
        for split, machines in plan.machines_of().items()
        for number, first in enumerate(range(0, len(machines), step))
    ]


def make_part(plan: Plan, part: Part) -> tuple[Files, dict[str, Any]]:
    """The bytes of a part, and what the manifest says of it."""
    machines = [drawn_machine(plan, number) for number in part.machines]
    table, runs = windows_of(plan, machines)
    files = files_of(plan.form, table, runs, plan.duration)
    digest, count = hashlib.sha256(), len(table['machine'])
    for values in table.values():
        digest.update(np.ascontiguousarray(values).data)
    return files, {
        'part': part.name,
        'windows': count,
        'stable': int(table['stable'].sum()),
        'ended_early': len(runs) * len(plan.starts) - count,
        'windows_sha256': digest.hexdigest(),
        'files': {n: [len(b), hashlib.sha256(b).hexdigest()] for n, b in files.items()},
        'machines': {each.number: json.loads(each.described.text()) for each in machines},
    }


def make_dataset(
    plan: Plan,
    folder: Path,
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
        WorkerError: If workers are lost, or have another version.
        MissingPackageError: If a library is missing that the form needs.
    """
    header: dict[str, Any] = {
        'kind': _KIND, 'plan': plan.identity, 'code': code_identity(), 'form': plan.form.value,
        'plan_text': plan.text, 'machine_files': plan.files,
    }  # fmt: skip
    manifest = folder / MANIFEST
    try:
        _check(folder, header)
        for left in folder.glob('*/.*.partial'):  # by a process that was killed
            _remove(left)
        with closing(ResultFile(manifest, header)) as file:
            entries = _made(plan, folder, file, executor, progress)
        (folder / CARD).write_text(data_card(plan, header['code'], entries), encoding='utf-8')
        sorted_ = folder / f'.{MANIFEST}.partial'
        lines = [json.dumps(line) for line in (header, *entries)]
        sorted_.write_text('\n'.join([*lines, '']), encoding='utf-8')
        sorted_.replace(manifest)
    except OSError as error:
        place = error.filename or folder
        raise DatasetError(
            f'{place} cannot be written: {reason_of(error)}; what is there is whole, and the '
            'same call goes on from it.'
        ) from None
    return entries


def _check(folder: Path, header: dict[str, Any]) -> None:
    """Refuse a folder in which something would be mixed."""
    manifest = folder / MANIFEST
    line = manifest.read_bytes().partition(b'\n') if manifest.exists() else (b'', b'', b'')
    if not line[1]:  # it was not begun, or in its first line
        if folder.exists() and {*folder.iterdir()} - {manifest}:
            raise DatasetError(f'{folder} holds other files: give another folder.')
        return
    try:
        found = json.loads(line[0])
        kind, plan, code = found['kind'], found['plan'], found['code']
    except (ValueError, KeyError, TypeError):
        raise DatasetError(f'{manifest} is not the manifest of a data set.') from None
    if (kind, plan) != (header['kind'], header['plan']):
        raise DatasetError(f'{folder} holds the data of another plan: give another folder.')
    if code != header['code']:
        raise DatasetError(
            f'{folder} was begun with {code}, and this is {header["code"]}: go on with that '
            'version, or give another folder.'
        )


def _made(
    plan: Plan, folder: Path, file: ResultFile, executor: Executor | None,
    progress: Callable[[int, int], object],
) -> list[dict[str, Any]]:  # fmt: skip
    """Make what is missing; what the manifest says of each part."""
    parts = parts_of(plan)
    entries = {entry['part']: entry for entry in file.entries if _is_there(folder, entry)}
    missing = [part for part in parts if part.name not in entries]

    def tell() -> None:
        progress(sum(entry['windows'] for entry in entries.values()), plan.windows)

    tell()
    batches = [[part] for part in missing]
    for done in run_batches(partial(make_part, plan), batches, executor=executor):
        ((files, entry),) = done.results
        _write(folder / entry['part'], files)
        entry['processor'] = done.processor
        file.add(entry)
        entries[entry['part']] = entry
        tell()
    return [entries[part.name] for part in parts]


def _is_there(folder: Path, entry: dict[str, Any]) -> bool:
    """Whether each file of a part has the size that it was written with."""
    part = folder / entry['part']
    files = [(part / name if name else part, size) for name, (size, _) in entry['files'].items()]
    return all(file.is_file() and file.stat().st_size == size for file, size in files)


def _write(path: Path, files: Files) -> None:
    """Write a part under another name, and rename it when it is whole."""
    partial_path = path.with_name(f'.{path.name}.partial')
    try:
        for name, content in files.items():
            file = partial_path / name if name else partial_path
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(content)
        _remove(path)  # one that no line of the manifest speaks of
        partial_path.replace(path)
    except OSError:
        _remove(partial_path)
        raise


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def read_windows(folder: Path, split: str | None = None) -> Table:
    """The windows of a data set as arrays by column, of one split or of all.

    Args:
        folder: Of the data set, in Parquet, HDF5 or Zarr.
        split: As `train` or `test`.

    Raises:
        DatasetError: If there are none.
    """
    parts = sorted(
        path
        for ending in ENDINGS.values()
        if ending != ENDINGS[Form.MCAP]
        for path in folder.glob(f'{split or "*"}/part-*{ending}')
    )
    if not parts:
        raise DatasetError(f'{folder} holds no windows{f" of {split}" if split else ""}.')
    tables = [read_part(path) for path in parts]
    return {name: np.concatenate([table[name] for table in tables]) for name in tables[0]}
