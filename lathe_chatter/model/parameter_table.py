"""Rows of parameters, and what is made of them: nothing here knows who has which.

A number is coerced only where nothing is lost: a whole number is accepted where a double belongs
(`depth_of_cut:=0`, `spindle_speed_rpm:=6000`), at the start and at run time. A text that is a
number is one where it was written as text: in a file or on a command line (`Row.parsed`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from typing import Any, TypeGuard

from lathe_chatter.errors import ParameterError, nearest_name, shortened
from lathe_chatter.html_table import html_table
from lathe_chatter.model.quantity_fields import Quantity, check_choice, quantity_of
from lathe_chatter.model.values_with_units import number_in, units_of

Value = bool | int | float | str | list[str]
Values = Mapping[str, Value]
Resolved = Mapping[str, Value | None]
"""What follows from given values: None for a row that has no value then."""

_LARGEST_EXACT_INTEGER = 2**53


@dataclass(frozen=True)
class Row:
    """One parameter.

    Attributes:
        name: As `ros2 param` writes it, with dots where it belongs to a part of the machine.
        default: The value without an override; its type is the parameter's type.
        meaning: One phrase.
        limits: Unit and closed limits of a number; None for anything else.
        choices: The words that a text may be; None where any will do.
        run_time: Whether it may change while the node runs.
        node_only: Whether it means something to a node alone, and nothing without ROS.
        of_samples: Whether what is no number changes samples, and no limit of a cut.
    """

    name: str
    default: Value
    meaning: str
    limits: Quantity | None = None
    choices: type[Enum] | None = None
    run_time: bool = False
    node_only: bool = False
    of_samples: bool = False

    @property
    def only_samples(self) -> bool:
        """Whether it changes samples, and no limit of a cut: no chart depends on it."""
        return self.of_samples or bool(self.limits and self.limits.only_samples)

    @property
    def unit(self) -> str:
        """SI unit, or rev/min; empty where there is none."""
        return self.limits.unit if self.limits else ''

    @property
    def allowed(self) -> str:
        """What is accepted, as the end of a sentence."""
        if self.choices is not None:
            return 'one of ' + ', '.join(str(choice.value) for choice in self.choices)
        if isinstance(self.default, bool):
            return 'true or false'
        if self.limits is not None and isinstance(self.default, int):
            return f'a whole number from {self.limits.low:.0f} to {self.limits.high:.0f}'
        if self.limits is not None:
            return self.limits.allowed
        return 'a text' if isinstance(self.default, str) else 'a list of texts'

    def check(self, value: object) -> Value:
        """The value as the parameter holds it.

        Raises:
            ParameterError: If it has the wrong type or lies outside what is allowed.
        """
        if self.choices is not None:
            if not isinstance(value, str):
                raise self._refused(value)
            return str(check_choice(self.name, value, self.choices).value)
        if isinstance(self.default, (list, tuple)):
            if isinstance(value, (list, tuple)) and all(isinstance(v, str) for v in value):
                return list(value)
        elif isinstance(self.default, (bool, str)):
            if isinstance(value, type(self.default)):
                return value
        elif self.limits is not None and _fits(value, self.default):
            if isinstance(self.default, float):
                return self.limits.check(self.name, value)
            if self.limits.low <= value <= self.limits.high:
                return value
        raise self._refused(value)

    def _refused(self, value: object) -> ParameterError:
        if self.unit and isinstance(value, str):  # it brought a unit, or tried to
            return ParameterError(
                self.name, value, '', f'{self.allowed}, in {units_of(self.unit)}'
            )
        return ParameterError(self.name, value, self.unit, self.allowed)

    def parsed(self, value: object) -> object:
        """The number that a text is, alone or with a unit (YAML takes `5.0e6` for a text)."""
        if not isinstance(value, str) or self.limits is None:
            return value
        with suppress(ValueError):
            return int(value)
        number = number_in(value, self.unit)
        return value if number is None else number


def _fits(value: object, default: Value) -> TypeGuard[int]:
    """Whether a number can become one of the default's type with nothing lost."""
    if isinstance(value, bool):
        return False
    if isinstance(value, int):
        return abs(value) <= _LARGEST_EXACT_INTEGER
    return isinstance(value, float) and isinstance(default, float)


class ParameterTable:
    """The rows of one node by name.

    Args:
        rows: In the order in which they are declared.
        derive: What follows from what was given, as a function of the given values; for instance
            the bearing's stiffness as half of the workpiece's. May raise ParameterError where
            given values contradict each other.
    """

    def __init__(
        self, rows: Iterable[Row], derive: Callable[[Values], Resolved] = lambda _given: {}
    ) -> None:
        """Index the rows."""
        self._rows = {row.name: row for row in rows}
        self._derive = derive

    def __iter__(self) -> Iterator[Row]:
        return iter(self._rows.values())

    def __contains__(self, name: object) -> bool:
        return name in self._rows

    def __getitem__(self, name: str) -> Row:
        return self._rows[name]

    def complete(self, given: Mapping[str, object]) -> dict[str, Value]:
        """The value of every row at the start: what was given or follows from it, else defaults.

        A row that has no value beside what was given is left out.

        Raises:
            ParameterError: For the first given value, in order of the rows, that is not allowed,
                or for values that contradict each other.
        """
        checked = {row.name: row.check(given[row.name]) for row in self if row.name in given}
        defaults = {row.name: row.default for row in self}
        found = {**defaults, **checked, **self._derive(checked)}
        return {name: value for name, value in found.items() if value is not None}

    def markdown(self) -> str:
        """The rows as the table of a README."""
        head = '| parameter | default | allowed | when | meaning |\n|---|---|---|---|---|'
        lines = (
            f'| `{row.name}` | {_shown(row.default)} '
            f'| {row.allowed.replace("a finite number ", "")} '
            f'| {"run time" if row.run_time else "start"} | {row.meaning} |'
            for row in self
        )
        return '\n'.join((head, *lines))

    def usage(self, node: str) -> str:
        """What `--help` of a node prints: how to give parameters, and which there are."""
        example = next(row for row in self if row.default and not isinstance(row.default, list))
        head = (
            f'usage: {node} [--ros-args -p {example.name}:={_shown(example.default).strip("`")} '
            '...]\n\nparameters:'
        )
        lines = (
            f'  {row.name}: {row.meaning.rstrip(".")}; {row.allowed} '
            f'(default: {_shown(row.default).replace("`", "")})'
            for row in self
        )
        return '\n'.join((head, *lines))

    def unknown(self, name: str) -> str:
        """A sentence about a name that is no parameter, with the nearest that is."""
        near = self.nearest(name)
        hint = f': did you mean {near}?' if near else '.'
        return f'There is no parameter {shortened(repr(name))}{hint}'

    def nearest(self, name: str) -> str | None:
        """The parameter that may have been meant by a name that is none."""
        return nearest_name(name, self._rows)


def rows_of(instance: Any, *, prefix: str = '', run_time: bool = False) -> Iterator[Row]:
    """The rows of a frozen value of the model, with its values as defaults.

    Args:
        instance: A dataclass whose fields are quantities, choices, such dataclasses, or tuples of
            them, which are numbered.
        prefix: Put before each name, with its dot.
        run_time: Whether they may change while the node runs.
    """
    for entry in fields(instance):
        value = getattr(instance, entry.name)
        name = prefix + entry.name
        limits = quantity_of(entry)
        if is_dataclass(value):
            yield from rows_of(value, prefix=f'{name}.', run_time=run_time)
        elif isinstance(value, Enum):
            meaning = (type(value).__doc__ or '').partition('.')[0].partition(' (')[0]
            yield Row(name, value.value, meaning, choices=type(value), run_time=run_time)
        elif isinstance(value, tuple):
            for number, part in enumerate(value, 1):
                yield from rows_of(part, prefix=f'{name}.{number}.', run_time=run_time)
        elif limits is not None:
            yield Row(name, value, limits.meaning, limits, run_time=run_time)


def html_of(instance: Any) -> str:
    """A frozen value of the model as the table that a notebook shows."""
    rows = ((row.name, row.default, row.unit) for row in rows_of(instance))
    return html_table(type(instance).__name__, rows)


def _shown(value: Value) -> str:
    """A default as one would write it after `:=`."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return ', '.join(f'`{entry}`' for entry in value) or 'none'
    if isinstance(value, str):
        return f'`{value}`' if value else 'empty'
    return f'{value}'
