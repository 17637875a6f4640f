"""Which files of a folder make a run: by their names, and by metadata.yaml."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from lathe_chatter.errors import RunReadError
from lathe_chatter.recording.metadata_yaml import FILE_NAME

_NUMBERED = re.compile(r'^(?P<run>.*)_(?P<number>\d+)$')
_OTHER_FORMATS = {
    b'SQLite format 3\0': 'a bag in SQLite',
    b'#ROSBAG V': 'a bag of ROS 1',
}
"""What files begin with that hold recorded messages in another way."""
_COMPRESSED = {
    b'\x28\xb5\x2f\xfd': ('zstd', 'zstd -d {} -o {}'),
    b'\x04\x22\x4d\x18': ('lz4', 'lz4 -d {} {}'),
    b'\x1f\x8b': ('gzip', 'gzip -dc {} > {}'),
}
"""What compressed files begin with, how they are compressed, and what undoes it."""
_UNREADABLE = (OSError, yaml.YAMLError, KeyError, TypeError, ValueError, RecursionError)
"""What reading a metadata.yaml raises that is not there, or is no such thing."""


class RunFolder(NamedTuple):
    """The files of a run.

    Attributes:
        files: Those that are there, in order.
        missing: Names of those that are not, though others tell of them.
        strangers: Names of MCAP files in the folder that are of no file's run.
        metadata: What metadata.yaml says of the run; None where it is missing or damaged.
    """

    files: tuple[Path, ...]
    missing: tuple[str, ...]
    strangers: tuple[str, ...]
    metadata: dict[str, Any] | None


def run_folder(folder: Path) -> RunFolder:
    """Look for a run.

    metadata.yaml has the last word on which files are of the run; one more that continues their
    numbers may have been begun a moment before its writer was killed.

    Raises:
        RunReadError: If there is no run, or there are several and nothing says which is meant.
    """
    if not folder.is_dir():
        wrong = 'is neither a file nor a folder' if folder.exists() else 'does not exist'
        raise RunReadError(f'{folder} {wrong}.')
    metadata, listed = _described(folder)
    _refuse_compressed(metadata, folder, folder)
    there = sorted((file for file in folder.glob('*.mcap') if file.is_file()), key=_split)
    if not there:
        for file in sorted(folder.iterdir()):
            refuse_other_format(file, folder)
        raise RunReadError(f'{folder} holds no recorded run.')
    runs = {_split(Path(name))[0] for name in listed} or {_split(file)[0] for file in there}
    if not listed and len(runs) > 1:
        names = ', '.join(sorted(runs))
        raise RunReadError(f'{folder} holds files of several runs, {names}: name a file.')
    files = [file for file in there if file.name in listed or _split(file)[0] in runs]
    places = {name: place for place, name in enumerate(listed)}
    files.sort(key=lambda file: places.get(file.name, len(places)))  # others keep their order
    if not files:
        raise RunReadError(f'{folder} holds none of the files that {FILE_NAME} names.')
    strangers = tuple(file.name for file in there if file not in files)
    return RunFolder(tuple(files), _missing(files, listed), strangers, metadata)


def refuse_other_format(file: Path, asked: Path | None = None) -> None:
    """Refuse a bag that is no MCAP by the name of its format.

    Args:
        file: Which.
        asked: The folder that was asked for, if it was not the file.

    Raises:
        RunReadError: If it is such a bag; the text says what makes an MCAP of it.
    """
    if not file.is_file():
        return
    metadata, listed = _described(file.parent)
    if asked is None and file.name in listed:
        _refuse_compressed(metadata, file, file.parent)
    with file.open('rb') as stream:
        begin = stream.read(16)
    for magic, (name, command) in _COMPRESSED.items():
        if begin.startswith(magic):
            end = '-plain.mcap' if file.suffix == '.mcap' else ''
            target = f'{file.with_suffix("")}{end}'
            made = command.format(shlex.quote(str(file)), shlex.quote(target))
            raise RunReadError(_refusal(asked or file, f'a file compressed by {name}', made))
    for magic, name in _OTHER_FORMATS.items():
        if begin.startswith(magic):
            alone = magic.startswith(b'#ROSBAG') or file.name not in listed
            source = file if alone else file.parent
            raise RunReadError(_refusal(asked or file, name, _conversion(source)))


def _refuse_compressed(metadata: dict[str, Any] | None, asked: Path, bag: Path) -> None:
    """Refuse a bag whose messages or files are compressed each by itself."""
    mode = str((metadata or {}).get('compression_mode') or 'none').lower()
    if mode != 'none':
        what = f'{"" if asked == bag else "of "}a bag compressed by {mode}'
        raise RunReadError(_refusal(asked, what, _conversion(bag)))


def _conversion(source: Path) -> str:
    target = f'{source.resolve().with_suffix("")}-mcap'
    words = ['rosbags-convert', '--src', str(source), '--dst', target, '--dst-storage', 'mcap']
    return shlex.join(words)


def _refusal(path: Path, what: str, command: str) -> str:
    """One sentence: what it is, and what makes of it what can be read."""
    return f'{path} is {what}, and only plain MCAP is read: `{command}` makes one of it.'


def _described(folder: Path) -> tuple[dict[str, Any] | None, list[str]]:
    """What metadata.yaml says, and the names of files among it."""
    try:
        text = (folder / FILE_NAME).read_text(encoding='utf-8')
        found = yaml.safe_load(text)['rosbag2_bagfile_information']
        return dict(found), [Path(name).name for name in found['relative_file_paths']]
    except _UNREADABLE:
        return None, []


def _missing(files: Sequence[Path], listed: Sequence[str]) -> tuple[str, ...]:
    """Names that metadata.yaml has, and numbers that are left out."""
    names = {file.name for file in files}
    missing = {name for name in listed if name not in names}
    numbered = [_split(Path(name)) for name in (*names, *listed) if _NUMBERED.match(name[:-5])]
    first = min((number for _, number in numbered), default=0) if listed else 0
    for run, last in numbered:
        missing |= {f'{run}_{k}.mcap' for k in range(first, last)} - names
    return tuple(sorted(missing, key=lambda name: _split(Path(name))))


def _split(file: Path) -> tuple[str, int]:
    """The name of the run of a file, and its place among the pieces."""
    match = _NUMBERED.match(file.stem)
    return (match['run'], int(match['number'])) if match else (file.stem, 0)
