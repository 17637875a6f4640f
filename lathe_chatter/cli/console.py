"""Everything that the verbs print: sentences, tables, bars of progress, and JSON.

Text is shown as it is. What a user wrote (a path, the title of a scenario) is nowhere taken for
the markup of the library that draws the tables.
"""

from __future__ import annotations

import json
import math
import os
import shutil
import sys
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import asdict, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.cells import cell_len
from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table
from rich.text import Text

from lathe_chatter.errors import OutputError, reason_of

INTERRUPTED = 130
"""The exit code after Ctrl-C."""
_ANY = 10_000
"""Columns that no table needs."""
_NARROW = 60
"""Columns of a terminal below which a bar of progress shows no times."""


class Screen:
    """Where a verb prints: sentences and tables for people, JSON for programs.

    With JSON, standard output is the JSON alone, and all else goes to standard error.
    """

    def __init__(self, *, json: bool = False) -> None:
        """Print JSON, or leave it out."""
        self._json = json
        self._console = Console(stderr=json, markup=False, emoji=False, highlight=False)
        self._draws = self._console.is_terminal and not self._console.is_dumb_terminal
        if not (self._console.is_terminal or os.environ.get('COLUMNS')):
            self._console.width = _ANY  # a pipe has no width, unless the user says one
        elif not self._draws:  # of which the library believes that it has 80
            self._console.size = shutil.get_terminal_size()

    def say(self, text: str, style: str = '') -> None:
        """Print text: on a terminal broken between words, in a pipe one line as it is."""
        # Not by the library, which would break a path that is longer than a line.
        lines = [
            textwrap.fill(
                line, max(self._console.width, 1), break_long_words=False, break_on_hyphens=False,
                subsequent_indent=' ' * (len(line) - len(line.lstrip())),
            )
            for line in text.split('\n')
        ]  # fmt: skip
        text = '\n'.join(lines)
        self._console.print(Text(text, style=style), soft_wrap=True)

    def name_file(self, label: str, path: Path) -> None:
        """Print where a file is, unbroken, so that it can be copied."""
        self._console.print(Text(f'{label:8} {path}'), soft_wrap=True)

    def table(
        self,
        titles: Mapping[str, str],
        rows: Sequence[Sequence[str]],
        heading: str = '',
    ) -> None:
        """Print a table, or where it is too wide for the terminal each row as some lines.

        Args:
            titles: Of the columns, each with `left`, `right`, or `text` for words that may be
                broken between lines.
            rows: A text for each column.
            heading: Above the table.
        """
        table = Table(box=SIMPLE_HEAD, pad_edge=False, show_edge=False)
        for title, kind in titles.items():
            table.add_column(
                Text(title), justify='right' if kind == 'right' else 'left',
                no_wrap=kind != 'text', overflow='fold',
            )  # fmt: skip
        for row in rows:
            table.add_row(*map(Text, row))
        if heading:
            self.say(heading)
        options = self._console.options.update(width=_ANY)
        least = self._console.measure(table, options=options).maximum - sum(
            _width([title, *cells], whole=True) - _width([title, *cells], whole=kind != 'text')
            for (title, kind), cells in zip(titles.items(), zip(*rows, strict=True), strict=False)
        )
        if least <= self._console.width:
            self._console.print(table)
        else:
            self._list(list(titles), rows)

    def _list(self, titles: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
        """A table as a line for the first two cells of a row and one for each other."""
        for row in rows:
            self.say('  '.join(text for text in row[:2] if text))
            for title, text in zip(titles[2:], row[2:], strict=True):
                if text:
                    self.say(f'    {title}: {text}')

    def json(self, figures: Any) -> None:
        """Print figures as one line of JSON, where it is wanted; see `plain`."""
        if self._json:
            sys.stdout.write(json.dumps(plain(figures), allow_nan=False) + '\n')

    @contextmanager
    def working(self, text: str) -> Iterator[None]:
        """Show that something is going on; only on a terminal."""
        if self._draws:
            with self._console.status(Text(text)):
                yield
        else:
            yield

    def compile(self) -> None:
        """Compile the inner loops, or load what is compiled."""
        from lathe_chatter.precompile import precompile  # with all that can be compiled

        precompile(say=self.say)

    @contextmanager
    def progress(self, what: str, total: float | None = None, unit: str = '') -> Iterator[Bar]:
        """Show a bar of progress while the context lasts; only on a terminal.

        Args:
            what: Is done.
            total: When all is done; None where nobody knows yet.
            unit: Of the total, empty for a count of things.
        """
        shown = self._draws
        columns: list[ProgressColumn] = [
            TextColumn('{task.description}', markup=False),
            BarColumn(bar_width=None),
            _Done(unit),
        ]
        if self._console.width >= _NARROW:
            columns += [TimeElapsedColumn(), TimeRemainingColumn()]
        progress = Progress(*columns, console=self._console, transient=True, disable=not shown)
        # The library ends a bar with an empty line even where it has shown none, as on a terminal
        # that is dumb.
        with progress if shown else nullcontext():
            yield Bar(progress, what, total)


class Bar:
    """A bar of progress."""

    def __init__(self, progress: Progress, what: str, total: float | None) -> None:
        """Begin at nothing."""
        self._progress = progress
        self._task = progress.add_task(what, total=total)

    def advance(self, count: float = 1) -> None:
        """So much more is done."""
        self._progress.advance(self._task, count)

    def show(
        self, done: float | None = None, total: float | None = None, what: str | None = None
    ) -> None:
        """Show how much is done, of how much, and what is being done."""
        self._progress.update(self._task, completed=done, total=total, description=what)


def _width(cells: Iterable[str], *, whole: bool) -> int:
    """How wide a column is: as its longest cell, or as its longest word."""
    return max(cell_len(part) for cell in cells for part in ([cell] if whole else cell.split(' ')))


class _Done(ProgressColumn):
    """How much of the total is done, in its unit."""

    def __init__(self, unit: str) -> None:
        super().__init__()
        self._unit = f' {unit}' if unit else ''

    def render(self, task: Task) -> Text:
        """The share as numbers."""
        done = f'{task.completed:.2f}' if self._unit else f'{task.completed:.0f}'
        return Text(f'{done} of {task.total:g}{self._unit}' if task.total is not None else done)


def plain(value: Any) -> Any:
    """A value as JSON holds it: a number that is not finite is null, an array a list."""
    if isinstance(value, Enum):
        value = value.value
    elif isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    elif hasattr(value, '_asdict'):
        value = value._asdict()
    elif is_dataclass(value) and not isinstance(value, type):
        value = asdict(value)
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(entry) for entry in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return str(value) if isinstance(value, Path) else value


def keep_existing(*paths: Path, force: bool) -> None:
    """Refuse to overwrite files, unless that is wanted.

    Raises:
        OutputError: If one exists.
    """
    for path in paths:
        if path.is_file() and not force:
            raise OutputError(f'{path} exists already: name another, or give --force.')


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn what the system refuses while a file or folder is written into a sentence.

    Raises:
        OutputError: If it cannot be written.
    """
    try:
        yield
    except OSError as error:
        # A full disk does not say which file it refuses.
        place = error.filename or path
        raise OutputError(f'{place} cannot be written: {reason_of(error)}.') from None


def counted(count: int, word: str) -> str:
    """A number of things, in words."""
    return f'{count} {word}' if count == 1 else f'{count} {word}s'
