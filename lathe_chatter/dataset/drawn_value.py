"""What a plan says of a value: the value itself, or how it is drawn."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import yaml

from lathe_chatter.model.parameter_table import Row
from lathe_chatter.model.quantity_fields import Quantity
from lathe_chatter.model.yaml_section import Section

FIXED, UNIFORM, LOG_UNIFORM, NORMAL, CHOICE = 'fixed', 'uniform', 'log_uniform', 'normal', 'choice'
OF_LIMIT = 'of_limit'
_PAIRS = (UNIFORM, LOG_UNIFORM, NORMAL)
FACTOR = Row(OF_LIMIT, 1.0, '', Quantity('multiple of the safe depth', high=100.0))
_SPREADS = 6.0
"""Standard deviations that a normal value may lie off its mean before it is drawn again."""


@dataclass(frozen=True)
class Distribution:
    """How a value is drawn.

    Attributes:
        kind: One of the above.
        values: The value; lowest and highest; mean and standard deviation; or the choices.
        low: What a normal value may not fall below.
        high: Nor exceed.
        of_limit: Whether the value is a multiple of the safe depth of the cut.
    """

    kind: str
    values: tuple[Any, ...]
    low: float = -math.inf
    high: float = math.inf
    of_limit: bool = False

    def draw(self, rng: np.random.Generator) -> Any:
        """A value."""
        first, last = self.values[0], self.values[-1]
        if self.kind == FIXED:
            return first
        if self.kind == CHOICE:
            return self.values[int(rng.integers(len(self.values)))]
        if self.kind == UNIFORM:
            return first + (last - first) * rng.random()
        if self.kind == LOG_UNIFORM:
            return min(max(first * math.exp(math.log(last / first) * rng.random()), first), last)
        while True:
            value = first + last * rng.standard_normal()
            if self.low <= value <= self.high and abs(value - first) <= _SPREADS * last:
                return value


def distributions(section: Section, rows: dict[str, Row]) -> dict[str, Distribution]:
    """What a section says of its parameters.

    Raises:
        MachineFileError: With file, line, field, value and what is allowed.
    """
    section.only(*rows)
    return {n: distribution(section, n, row) for n, row in rows.items() if n in section.nodes}


def values_of(section: Section, rows: Iterable[Row], *others: str) -> dict[str, Any]:
    """The values of a section that are not drawn, defaults for the rest.

    Args:
        section: Where they stand.
        rows: What they are.
        others: What else the section may have.

    Raises:
        MachineFileError: With file, line, field, value and what is allowed.
    """
    named = {row.name: row for row in rows}
    return {n: row.default for n, row in named.items()} | section.values(named, *others)


def distribution(section: Section, name: str, row: Row, *, of_limit: bool = False) -> Distribution:
    """What a section says of one parameter.

    Raises:
        MachineFileError: With file, line, field, value and what is allowed.
    """
    node = section.nodes[name]
    if not isinstance(node, yaml.MappingNode):
        return Distribution(FIXED, (section.value(name, node, row),), of_limit=of_limit)
    inner = section.inner(name)
    limited = name == 'depth_of_cut' and not of_limit
    inner.only(*_PAIRS, CHOICE, *([OF_LIMIT] if limited else []))
    if len(inner.nodes) != 1:
        raise inner.refused('it must have one way in which it is drawn')
    ((kind, given),) = inner.nodes.items()
    if kind == OF_LIMIT:
        return distribution(inner, OF_LIMIT, FACTOR, of_limit=True)
    if not isinstance(given, yaml.SequenceNode) or not given.value:
        raise inner.refused(f'{kind} must be a list of values', given)
    values = tuple(inner.value(kind, entry, row) for entry in given.value)
    limits = row.limits
    if kind in _PAIRS:
        wrong = len(values) != 2 or limits is None or values[-1] <= 0.0
        if wrong or (kind != NORMAL and not values[0] < values[1]):
            meaning = 'mean and standard deviation' if kind == NORMAL else 'lowest and highest'
            raise inner.refused(f'{kind} must be two numbers, {meaning}', given)
        if kind == LOG_UNIFORM and values[0] <= 0.0:
            raise inner.refused('log_uniform must begin above 0', given)
    low, high = (limits.low, limits.high) if limits else (-math.inf, math.inf)
    return Distribution(kind, values, low, high, of_limit)
