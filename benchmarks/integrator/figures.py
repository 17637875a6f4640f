"""What a figure is, how it is printed, and the machine that it holds for."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table

CHECKOUT = Path(__file__).parents[2]
Item = TypeVar('Item')


@dataclass(frozen=True)
class Figure:
    """One line of the table.

    Attributes:
        name: What was measured.
        value: Its value.
        unit: Of the value, empty for a ratio or a count.
        goal: What it should reach, or None where there is no goal.
        at_least: Whether the value should be at least the goal, not at most.
        note: What else there is to say.
    """

    name: str
    value: float
    unit: str = ''
    goal: float | None = None
    at_least: bool = False
    note: str = ''

    @property
    def met(self) -> bool | None:
        """Whether the goal is reached; None without one."""
        if self.goal is None:
            return None
        return self.value >= self.goal if self.at_least else self.value <= self.goal


@dataclass(frozen=True)
class Missing:
    """A figure that could not be measured, and why."""

    name: str
    reason: str


Line = Figure | Missing


def show(title: str, lines: Sequence[Line]) -> None:
    """Print the figures of one part."""
    table = Table(title=title, box=SIMPLE_HEAD, title_justify='left')
    table.add_column('figure')
    for name in ('value', 'unit', 'goal', ''):
        table.add_column(name, justify='right' if name in {'value', 'goal'} else 'left')
    table.add_column('note')
    for line in lines:
        if isinstance(line, Missing):
            table.add_row(line.name, '-', '', '', 'not measured', line.reason)
            continue
        goal = ''
        if line.goal is not None:
            goal = f'{">=" if line.at_least else "<="} {line.goal:g}'
        met = {None: '', True: 'met', False: 'MISSED'}[line.met]
        table.add_row(line.name, f'{line.value:.4g}', line.unit, goal, met, line.note)
    # A table that is piped into a file is not cut to the 80 columns that a pipe has.
    width = None if sys.stdout.isatty() else 150
    Console(width=width, highlight=False).print(table)


def progress() -> Progress:
    """A display of how far things are, on standard error and gone at the end."""
    return Progress(
        TextColumn('{task.description}'),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
    )


def tracked(items: Sequence[Item], description: str) -> Iterable[Item]:
    """The items, and on standard error how many are done."""
    with progress() as display:
        yield from display.track(items, description=description)
