"""What a field of the model may hold: unit, range and meaning, stated once beside the field.

Validation in the core, the parameter descriptors of the nodes and the tables of the documentation
are all made from these.
"""

from __future__ import annotations

import math
import operator
from dataclasses import MISSING, Field, dataclass, field, fields
from enum import Enum
from typing import Any

import numpy as np

from lathe_chatter.errors import ParameterError

_KEY = 'quantity'


@dataclass(frozen=True)
class Quantity:
    """A finite number with a unit and closed limits.

    Attributes:
        meaning: One phrase, for descriptors and tables.
        unit: SI unit (or rev/min); empty for a pure number.
        low: Smallest allowed value.
        high: Largest allowed value.
        exclusive: Whether `low` itself is refused (a mass of zero, for instance).
        or_zero: Whether 0 is allowed though it lies below `low`.
        only_samples: Whether it changes samples, and no limit of a cut.
    """

    meaning: str
    unit: str = ''
    low: float = 0.0
    high: float = math.inf
    exclusive: bool = False
    or_zero: bool = False
    only_samples: bool = False

    @property
    def allowed(self) -> str:
        """The limits as the end of a sentence."""
        unit = self.unit and ' ' + self.unit
        zero = '0 or ' if self.or_zero else ''
        if math.isinf(self.high):
            relation = 'greater than' if self.exclusive else 'at least'
            return f'{zero}a finite number {relation} {self.low:g}{unit}'
        if self.exclusive:
            return f'{zero}a finite number above {self.low:g} and up to {self.high:g}{unit}'
        return f'{zero}a finite number from {self.low:g} to {self.high:g}{unit}'

    def check(self, name: str, value: object) -> float:
        """Return `value` as a float.

        Raises:
            ParameterError: If it is no finite number within the limits.
        """
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            try:
                number = float(value.item())  # type: ignore[attr-defined]  # a NumPy scalar
            except (AttributeError, TypeError, ValueError):
                raise ParameterError(name, value, self.unit, self.allowed) from None
        else:
            number = float(value)
        inside = self.low <= number <= self.high or (self.or_zero and number == 0.0)
        if not math.isfinite(number) or not inside or (self.exclusive and number == self.low):
            raise ParameterError(name, value, self.unit, self.allowed)
        return number


def quantity(  # noqa: PLR0913 -- one keyword for each fact about a field
    meaning: str,
    unit: str = '',
    *,
    default: Any = MISSING,
    low: float = 0.0,
    high: float = math.inf,
    exclusive: bool = False,
    or_zero: bool = False,
    only_samples: bool = False,
) -> Any:
    """A dataclass field that carries its `Quantity`."""
    limits = Quantity(meaning, unit, low, high, exclusive, or_zero, only_samples)
    if default is MISSING:
        return field(metadata={_KEY: limits})
    return field(default=default, metadata={_KEY: limits})


def quantity_of(entry: Field[Any]) -> Quantity | None:
    """The `Quantity` that a dataclass field carries, if any."""
    return entry.metadata.get(_KEY)


def limits_of(model: type, name: str) -> Quantity:
    """The `Quantity` of a dataclass's field `name`."""
    limits: Quantity = model.__dataclass_fields__[name].metadata[_KEY]  # type: ignore[attr-defined]  # a dataclass
    return limits


def check_fields(instance: Any, prefix: str = '') -> None:
    """Validate every quantity field of a frozen dataclass and store it as a float.

    Raises:
        ParameterError: For the first field, in order of declaration, that is not allowed.
    """
    for entry in fields(instance):
        limits = quantity_of(entry)
        if limits is not None:
            number = limits.check(prefix + entry.name, getattr(instance, entry.name))
            object.__setattr__(instance, entry.name, number)


def check_choice(name: str, value: object, choices: type[Enum]) -> Any:
    """The member of `choices` that `value` (a member or its value) names.

    Raises:
        ParameterError: If it names none.
    """
    try:
        return choices(value)
    except ValueError:
        allowed = ', '.join(str(choice.value) for choice in choices)
        raise ParameterError(name, value, '', f'one of {allowed}') from None


def check_flag(name: str, value: object) -> bool:
    """A truth, Python's or NumPy's: a text is none, 'no' would be taken as yes.

    Raises:
        ParameterError: If it is something else.
    """
    if not isinstance(value, (bool, np.bool_)):
        raise ParameterError(name, value, '', 'True or False')
    return bool(value)


def count_of(name: str, value: object, *, least: int = 0) -> int:
    """A whole number of things.

    Raises:
        ParameterError: If it is no whole number, or below `least`.
    """
    try:
        count = -1 if isinstance(value, bool) else operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        count = -1
    if count < least:
        raise ParameterError(name, value, '', f'a whole number of {least} or more')
    return count
