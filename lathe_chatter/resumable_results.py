"""Results that are kept in a file as they are found, so that what was interrupted goes on.

The file is text, a JSON object in each line: first what the results are of, then one for each
as it is found. An interruption loses what was in progress and nothing else.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import closing, nullcontext, suppress
from functools import partial
from pathlib import Path
from typing import Any, Generic, TypeVar

from lathe_chatter.code_identity import code_identity
from lathe_chatter.errors import ResultFileError, reason_of
from lathe_chatter.executors import Item, Result, spread_out

Entry = TypeVar('Entry')


class ResultFile(Generic[Entry]):
    """A file that is begun or continued; what it is written is in it at once.

    Args:
        path: Of the file.
        header: What the results are of; a file that begins otherwise is refused, and left as it
            is.
        read: What a line holds; it raises a ValueError, KeyError, TypeError or AttributeError of
            a line that is no result.

    Attributes:
        entries: What it held already.

    Raises:
        ResultFileError: If it holds something else, or cannot be written.
    """

    def __init__(
        self, path: Path, header: Mapping[str, Any], read: Callable[[dict[str, Any]], Entry]
    ) -> None:
        """See the class."""
        self._path = path
        self.entries: list[Entry] = []
        first = json_line(header)
        try:
            if path.exists() and not path.is_file():  # a device may be read without end
                raise ResultFileError(f'{path} is no file: name another.')
            found = path.read_bytes() if path.exists() else b''
            whole = found[: found.rfind(b'\n') + 1]
            # Only of a file that is ours a last line that was cut off may go.
            if not first.startswith(found):
                self.entries = self._known(whole, json.loads(first), read)
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = path.open('r+b' if path.exists() else 'wb')
            self._file.truncate(len(whole))
            self._file.seek(len(whole))
            if not whole:
                self._file.write(first)
                self._file.flush()
        except OSError as error:
            raise self._not_written(error) from None

    def _known(
        self, whole: bytes, header: Mapping[str, Any], read: Callable[[dict[str, Any]], Entry]
    ) -> list[Entry]:
        begun, *lines = whole.splitlines() or [b'']
        try:
            found = json.loads(begun)
            other = [name for name, value in header.items() if found.get(name) != value]
        except (ValueError, AttributeError):
            found, other = {}, ['kind']
        if other == ['code'] and 'code' in found:
            reason = f'was begun with {found["code"]}, and this is {header["code"]}'
            raise ResultFileError(f'{self._path} {reason}: go on with that, or name another.')
        if other:
            reason = f'holds other results, not of the same {other[0]}'
            raise ResultFileError(f'{self._path} {reason}: name another, or remove it.')
        entries = list[Entry]()
        try:
            for line in lines:
                entries.append(read(json.loads(line)))
        except (ValueError, KeyError, TypeError, AttributeError):
            reason = f'line {len(entries) + 2} of {self._path} is no result as the others are'
            raise ResultFileError(f'{reason}: remove that line, or name another.') from None
        return entries

    def add(self, entry: Mapping[str, Any]) -> None:
        """Keep one more.

        Raises:
            ResultFileError: If it cannot be written.
        """
        try:
            self._file.write(json_line(entry))
            self._file.flush()
        except OSError as error:
            raise self._not_written(error) from None

    def close(self) -> None:
        """Let go of the file."""
        with suppress(OSError):  # it tries again to write what `add` could not
            self._file.close()

    def _not_written(self, error: OSError) -> ResultFileError:
        return ResultFileError(f'{self._path} cannot be written: {reason_of(error)}.')


def spread_into(  # noqa: PLR0913 -- what is done, where, and where it is kept
    path: Path | str | None,
    header: Mapping[str, Any],
    function: Callable[[Item], Result],
    items: Sequence[Item],
    *,
    executor: Executor | None = None,
    progress: Callable[[int], object] = lambda _count: None,
) -> list[Result]:
    """`executors.spread`, of results that JSON can hold, kept in a file and continued from it.

    Args:
        path: Of the file; None keeps nothing.
        header: What the results are of; the version of the code is added.
        function: Of one item.
        items: What it is called with.
        executor: Where.
        progress: Is told, now and then, how many more are done.

    Raises:
        ResultFileError: If the file is of something else, or cannot be written.
        WorkerError: If workers are lost, or have another version.
    """
    known = {**header, 'code': code_identity()}
    file = ResultFile(Path(path), known, partial(_result, len(items))) if path else None
    with closing(file) if file else nullcontext():
        found = dict(file.entries if file else ())
        if found:
            progress(len(found))
        missing = [k for k in range(len(items)) if k not in found]
        wanted = [items[k] for k in missing]
        for batch in spread_out(function, wanted, executor=executor):
            for k, result in batch:
                found[missing[k]] = result
                if file:
                    file.add({'place': missing[k], 'result': result})
            progress(len(batch))
    return [found[k] for k in range(len(items))]


def _result(count: int, entry: dict[str, Any]) -> tuple[int, Any]:
    """The place of a result among so many, and the result."""
    return range(count).index(entry['place']), entry['result']


def json_line(values: Mapping[str, Any]) -> bytes:
    """An object as a line of such a file."""
    return json.dumps(values).encode() + b'\n'
