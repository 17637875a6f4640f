"""Which samples are wanted: what a caller asks for, checked before anything is read."""

from __future__ import annotations

import math
from collections.abc import Iterable
from numbers import Real

from lathe_chatter.errors import ParameterError


def chosen_columns(columns: object) -> tuple[str, ...] | None:
    """Names of columns; None for all.

    Raises:
        ParameterError: If they are no list of names.
    """
    if columns is None:
        return None
    names = tuple(columns) if isinstance(columns, Iterable) else ()
    if isinstance(columns, str) or not names or not all(isinstance(n, str) for n in names):
        raise ParameterError('columns', columns, '', 'a list of names of columns')
    return names


def chosen_range(start: object, end: object) -> tuple[float, float]:
    """A range of simulated time, s.

    Raises:
        ParameterError: If an end is no number, or the range is empty.
    """
    for name, value in (('start', start), ('end', end)):
        if not isinstance(value, Real) or isinstance(value, bool) or math.isnan(value):
            raise ParameterError(name, value, 's', 'a number')
    first, last = float(start), float(end)  # type: ignore[arg-type]  # checked above
    if first > last:
        raise ParameterError('start', first, 's', f'at most the end, {last:g} s')
    return first, last
