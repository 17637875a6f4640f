"""The arrays that the whole package speaks of."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


class ShortRepr:
    """Lets a dataclass, made with `repr=False`, show its arrays by shape and range."""

    def __repr__(self) -> str:
        """Its fields, on one line."""
        of: Any = self
        parts = (f'{each.name}={_short(getattr(self, each.name))}' for each in fields(of))
        return f'{type(self).__name__}({", ".join(parts)})'


def _short(value: object) -> str:
    if not isinstance(value, np.ndarray) or value.size < 2:
        return repr(value)
    shape = ' x '.join(map(str, value.shape))
    if value.dtype == bool:
        return f'<{shape}, {np.count_nonzero(value)} of {value.size} true>'
    known = value[np.isfinite(value)]
    span = f'{known.min():.6g} to {known.max():.6g}' if known.size else 'none finite'
    return f'<{shape}, {span}>'
