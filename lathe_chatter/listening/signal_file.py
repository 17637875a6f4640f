"""Recordings of sensors as shops keep them: WAV, CSV, MAT, Parquet, and recorded runs."""

from __future__ import annotations

import csv
import math
import re
import subprocess
import tempfile
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.errors import (
    LatheChatterError,
    ParameterError,
    SignalFileError,
    optional,
    reason_of,
)
from lathe_chatter.executors import python_command
from lathe_chatter.model.values_with_units import number_in, units_of
from lathe_chatter.recording import read_run
from lathe_chatter.samples.columns import UNITS

Read = Sequence[tuple[str, Array]]
"""What a file holds: columns in order, each with its name, perhaps with a unit behind it."""

_NAME = re.compile(r'^(.*?)\s*(?:\[(.*)\]|\((.*)\))?$', re.DOTALL)
"""`name`, `name [unit]` or `name (unit)`."""
_TIME = 'time'
_OWN_TIMES = 1e-3
"""By how much times may differ from a rate that is given with them, relative."""

# In a process of its own: one wrong bit in such a file can end that in which SciPy reads it.
_MAT_TO_NPZ = """
import sys, numpy as np
from scipy.io import loadmat
try:
    found = {n: np.asarray(v) for n, v in loadmat(sys.argv[1]).items() if not n.startswith('__')}
except Exception as error:
    sys.exit(str(error) or type(error).__name__)
numbers = {n: v.astype(float).ravel() for n, v in found.items() if v.dtype.kind in 'biuf'}
np.savez(sys.argv[2], **numbers)
"""


@dataclass(frozen=True)
class Signals:
    """What sensors measured.

    Attributes:
        columns: Labels, `time` the first of them.
        samples: In the units of `samples.columns.UNITS`, sound in any (n, columns).
        source: The file, for people.
        remark: What is wrong with it though it could be read, a sentence; else empty.
    """

    columns: tuple[str, ...]
    samples: Array = field(repr=False)
    source: str = ''
    remark: str = ''

    @property
    def rate(self) -> float:
        """Samples a second, Hz."""
        return float(1.0 / np.median(np.diff(self.samples[:, 0])))


def read_signals(
    path: Path | str,
    *,
    columns: Sequence[str] | None = None,
    rate: float | None = None,
    topic: str | None = None,
) -> Signals:
    """Read a recording.

    Args:
        path: A WAV, CSV (names in its first line), MAT or Parquet file, or a recorded run. A unit
            behind a name, as `tool_displacement [um]`, is converted.
        columns: What its columns or channels are, in order; by default what they are called,
            and `sound` for the first channel of a WAV.
        rate: Samples a second, Hz, where it has no times.
        topic: Of the samples, where it is a run that has several lathes.

    Raises:
        SignalFileError: If it cannot be read, has no times, or others; the sentence says why.
    """
    path = Path(path)
    readers = {'.wav': _wav, '.csv': _csv, '.mat': _mat, '.parquet': _parquet}
    is_run = path.is_dir() or path.suffix.lower() == '.mcap'
    reader = partial(_run, topic=topic) if is_run else readers.get(path.suffix.lower())
    if topic is not None and not is_run:
        raise ParameterError('--topic', topic, '', 'left out where the recording is no run')
    if reader is None:
        raise SignalFileError(
            f'{path} is none of {", ".join(readers)}, .mcap or the folder of a run.'
        )
    try:
        path.stat()  # SciPy says nothing of a file that is not there
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter('always')
            signals = reader(path)
    except LatheChatterError:
        raise
    except Exception as error:  # noqa: BLE001 -- a library raises whatever a broken file makes it
        reason = (reason_of(error) or type(error).__name__).rstrip('.')
        raise SignalFileError(f'{path} cannot be read: {reason}.') from None
    found = _labelled(path, signals, columns, rate)
    if any('EOF' in str(each.message) for each in told):
        return replace(found, remark=f'{path} ends before its head says that it does.')
    return found


def _named(path: Path, read: Read, columns: Sequence[str] | None) -> dict[str, Array]:
    """Signals by name, in the units of the samples."""
    heads = [_NAME.findall(head.strip())[0] for head, _ in read]
    names = [name for name, _, _ in heads]
    if columns is not None:
        measured = [k for k, name in enumerate(names) if name != _TIME or _TIME in columns]
        if len(columns) != len(measured):
            raise SignalFileError(
                f'{path} has {len(measured)} columns ({", ".join(names[k] for k in measured)}), '
                f'and {len(columns)} names were given.'
            )
        for k, name in zip(measured, columns, strict=True):
            names[k] = name
    for name in names:
        if names.count(name) > 1:
            raise SignalFileError(
                f'{path} has {names.count(name)} columns {name}: give each a name of its own.'
            )
    units = [bracketed or in_parentheses for _, bracketed, in_parentheses in heads]
    return {
        name: values if name not in UNITS else values * _factor(path, name, unit)
        for name, unit, (_, values) in zip(names, units, read, strict=True)
    }


def _labelled(
    path: Path, read: Read, columns: Sequence[str] | None, rate: float | None
) -> Signals:
    signals = _named(path, read, columns)
    sizes = {len(values) for values in signals.values()}
    if len(sizes) != 1 or sizes.pop() < 2:
        raise SignalFileError(f'{path} does not hold columns of one length, of 2 samples or more.')
    if _TIME not in signals:
        if rate is None:
            raise SignalFileError(f'{path} has no column time: give its sample rate, in Hz.')
        count = len(next(iter(signals.values())))
        signals = {_TIME: np.arange(count) / rate, **signals}
    ordered = [_TIME, *(name for name in signals if name != _TIME)]
    samples = np.column_stack([np.asarray(signals[name], np.float64) for name in ordered])
    if not np.isfinite(samples[:, 0]).all():
        raise SignalFileError(f'{path} has times that are no finite numbers.')
    found = Signals(tuple(ordered), samples, str(path))
    if rate is not None and not math.isclose(found.rate, rate, rel_tol=_OWN_TIMES):
        raise SignalFileError(
            f'{path} has times of its own, {found.rate:g} samples a second: a rate of {rate:g} Hz '
            'is for recordings without.'
        )
    return found


def _factor(path: Path, name: str, unit: str) -> float:
    """What makes the unit of a file that of the samples."""
    factor = number_in(f'1 {unit}', UNITS[name])
    if factor is None:
        raise SignalFileError(
            f'{path} has {name} in {unit}: it must be in {units_of(UNITS[name])}.'
        )
    return factor


def _wav(path: Path) -> Read:
    from scipy.io import wavfile

    rate, data = wavfile.read(path)
    middle = 128.0 if data.dtype == np.uint8 else 0.0  # that of 8 bits alone is not 0
    scale = np.iinfo(data.dtype).max - middle if data.dtype.kind in 'iu' else 1.0
    channels = (np.asarray(data, np.float64).reshape(len(data), -1) - middle) / scale
    names = ['sound', *(f'channel_{k + 1}' for k in range(1, channels.shape[1]))]
    return [(_TIME, np.arange(len(data)) / rate), *zip(names, channels.T, strict=True)]


def _csv(path: Path) -> Read:
    with path.open(encoding='utf-8-sig') as stream:
        names = next(csv.reader(stream), [])
        if not names:
            raise SignalFileError(f'{path} has no first line with the names of its columns.')
        table = np.loadtxt(stream, delimiter=',', ndmin=2)
    table = table if table.size else table.reshape(0, len(names))
    if len(names) != table.shape[1]:
        raise SignalFileError(
            f'{path} has {len(names)} names in its first line, and {table.shape[1]} columns.'
        )
    return [*zip(names, table.T, strict=True)]


def _mat(path: Path) -> Read:
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / 'numbers.npz'
        done = subprocess.run(  # noqa: S603 -- ourselves
            python_command(_MAT_TO_NPZ, str(path), str(copy)),
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        if done.returncode:
            lines = done.stderr.strip().splitlines()
            said = lines[-1] if lines and done.returncode > 0 else 'it is damaged'
            raise SignalFileError(f'{path} cannot be read: {said.rstrip(".")}.')
        with np.load(copy) as arrays:
            return [(n, v) for n, v in arrays.items() if v.size > 1]


def _parquet(path: Path) -> Read:
    parquet: Any = optional('pyarrow.parquet', 'pyarrow')
    table = parquet.read_table(path)
    units = [(field.metadata or {}).get(b'unit', b'').decode() for field in table.schema]
    names = [f'{n} [{u}]' if u else n for n, u in zip(table.column_names, units, strict=True)]
    return [(n, np.asarray(v, np.float64)) for n, v in zip(names, table.columns, strict=True)]


def _run(path: Path, topic: str | None) -> Read:
    return [*read_run(path).samples(topic).columns.items()]
