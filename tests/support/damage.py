"""Damage to a recorded run, and whether what comes of it is right, refused or told."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lathe_chatter.errors import LatheChatterError
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.lathe.change_and_knock_sentences import BEGINNING, change_sentence
from lathe_chatter.model.lathe_parameter_table import parameters_of
from lathe_chatter.recording import LatheRun, Run, read_run, recover, verify
from lathe_chatter.recording.recorded_cuts import recorded_cuts

_TICKS, _PER_COMMIT = 60, 5


def record(folder: Path) -> None:
    """A short run in two files of six chunks, with parameters and a change of the depth."""
    lathe = VirtualLathe()
    with LatheRun(folder, parameters_of(lathe)) as run:
        run.log(BEGINNING)
        for k in range(_TICKS):
            if k == _TICKS // 2:
                cut = lathe.cut.with_changes(depth_of_cut=7e-4)
                run.log(change_sentence(lathe.time, lathe.cut, cut))
                lathe.retune(cut)
                run.writer.split()
            run.write(lathe.advance(20))
            if k % _PER_COMMIT == _PER_COMMIT - 1:
                run.writer.commit()


class Held(NamedTuple):
    """What a run holds, as far as it is handed out: values that can be compared."""

    samples: list[bytes]
    parameters: list[str]
    notes: list[str]
    messages: list[tuple[str, str, int, bytes]]


def _samples(run: Run) -> list[bytes]:
    columns = run.samples().columns
    return [row.tobytes() for row in np.column_stack([*columns.values()])]


def _parameters(run: Run) -> list[str]:
    sessions = recorded_cuts(run, '/lathe').log.sessions
    return [f'{name}={value!r}' for each in sessions for name, value in each.parameters.items()]


def _notes(run: Run) -> list[str]:
    return [repr(note) for note in run.notes()]


def _messages(run: Run) -> list[tuple[str, str, int, bytes]]:
    return [(raw.topic, raw.type, raw.log_time, raw.data) for raw in run.raw_messages()]


def held_by(run: Run) -> Held:
    """All that a run holds, where it is read without an error."""
    return Held(_samples(run), _parameters(run), _notes(run), _messages(run))


_KINDS: dict[str, Callable[[Run], list[Any]]] = {
    'samples': _samples,
    'parameters': _parameters,
    'notes': _notes,
    'messages': _messages,
}


def faults(path: Path, whole: Held, place: Path) -> Iterator[str]:
    """What is wrong with what comes of a damaged run.

    Args:
        path: Of the run.
        whole: What it held before.
        place: A folder to work in.
    """
    same = True
    for kind, read in _KINDS.items():
        expected = getattr(whole, kind)
        found = _attempt(lambda read=read: read(read_run(path)))
        if isinstance(found, str):
            yield f'{kind}: {found}'
        elif found is not None and found != expected:
            yield f'{kind} are handed out that are not those that were recorded'
        same = same and found == expected
        rest = _attempt(lambda read=read: read(read_run(path, damaged=True)))
        if isinstance(rest, str):
            yield f'{kind} of the rest: {rest}'
        elif rest is not None and not set(rest) <= set(expected):
            yield f'{kind} of the rest are handed out that never were'
    verified = _attempt(lambda: verify(path))
    if isinstance(verified, str):
        yield f'verify: {verified}'
    elif verified is not None and verified.complete and not same:
        yield 'verify says complete'
    shutil.rmtree(place / 'saved', ignore_errors=True)
    saved = _attempt(lambda: _samples(recover(path, place / 'saved').run))
    if isinstance(saved, str):
        yield f'recover: {saved}'
    elif saved is not None and not set(saved) <= set(whole.samples):
        yield 'recover saves samples that never were'


def noticed(path: Path) -> bool:
    """Whether `verify` says that something is wrong with a run."""
    try:
        return not verify(path).complete
    except LatheChatterError:
        return True


def _attempt(work: Callable[[], Any]) -> Any:
    """What comes of some work: None where it is refused in a sentence, a text of a traceback."""
    try:
        return work()
    except LatheChatterError:
        return None
    except Exception as error:  # noqa: BLE001 -- this is what is looked for
        return f'{type(error).__name__}: {error}'


def flipped(folder: Path, copy: Path, generator: np.random.Generator) -> str:
    """A copy of a run with one bit flipped; where."""
    _copied(folder, copy)
    file = _files(copy)[generator.choice(3, p=[0.4, 0.35, 0.25])]
    data = bytearray(file.read_bytes())
    place = int(generator.integers(len(data)))
    bit = int(generator.integers(8))
    data[place] ^= 1 << bit
    file.write_bytes(data)
    return f'bit {bit} of byte {place} of {file.name}'


def truncated(folder: Path, copy: Path, generator: np.random.Generator) -> str:
    """A copy of a run with the end of a file cut off; where."""
    _copied(folder, copy)
    file = _files(copy)[generator.choice(3, p=[0.45, 0.45, 0.1])]
    data = file.read_bytes()
    kept = int(generator.integers(len(data)))
    file.write_bytes(data[:kept])
    return f'{file.name} after {kept} of {len(data)} bytes'


def _files(folder: Path) -> list[Path]:
    """Both MCAP files and metadata.yaml."""
    return [*sorted(folder.glob('*.mcap')), folder / 'metadata.yaml']


def _copied(folder: Path, copy: Path) -> None:
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(folder, copy)
