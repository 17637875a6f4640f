"""Records of named numbers that compiled code reads and writes: NumPy's structured arrays.

They are handed on as arrays of one record: so Numba takes them five times as fast as records.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Records = NDArray[Any]


def record_type(floats: str = '', integers: str = '', complexes: str = '') -> np.dtype[Any]:
    """A record with fields of the names given, separated by spaces."""
    kinds = ((floats, float), (integers, np.int64), (complexes, complex))
    fields = [(name, kind) for names, kind in kinds for name in names.split()]
    return np.dtype((np.record, fields))


def record(kind: np.dtype[Any], value: float = 0.0, **values: object) -> Records:
    """One record (1,): fields as given, other floating-point fields as `value`, the rest 0."""
    one = np.zeros(1, kind)
    for name in kind.names or ():
        if name in values or kind[name].kind == 'f':
            one[name] = values.get(name, value)
    return one


def values_of(one: Records) -> dict[str, Any]:
    """The fields of one record (1,) by name, as plain numbers."""
    return dict(zip(one.dtype.names or (), one.item(), strict=True))
