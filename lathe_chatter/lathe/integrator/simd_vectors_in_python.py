"""What simd_vectors.py does, for NumPy arrays (8,): for a debugger, with Numba switched off."""

from __future__ import annotations

from typing import Any

import numpy as np

from lathe_chatter.array_types import Array

LANES = 8
"""Steps of a block."""


def lanes_at(rows: Array, row: int, column: int) -> Any:
    """The eight numbers of a row that begin at a column."""
    return rows[row, column : column + LANES].copy()


def put(rows: Array, row: int, column: int, lanes: Any) -> None:
    """Write them there."""
    rows[row, column : column + LANES] = lanes


def put_samples(rows: Array, row: int, values: Any) -> None:
    """Write eight quantities (a tuple of lanes) as eight rows, from row `row` on."""
    rows[row : row + LANES, :LANES] = np.array(values).T


def counted(first: float) -> Any:
    """`first`, one more, two more ..."""
    return first + np.arange(float(LANES))


def spread(value: float) -> Any:
    """The same number in all lanes."""
    return np.full(LANES, value)


def six(*values: float) -> Any:
    """Six numbers, and then zeros."""
    return np.array([*values, 0.0, 0.0])


def after(first: float, lanes: Any) -> Any:
    """`first`, and then all lanes but the last: what each step begins with."""
    return np.append(first, lanes[:-1])


def before(lanes: Any) -> Any:
    """All lanes but the first, and then the last once more."""
    return np.append(lanes[1:], lanes[-1])


def lane(lanes: Any, k: int) -> float:
    """The number in lane `k`."""
    return float(lanes[k])


def fma(a: Any, b: Any, c: Any) -> Any:
    """a b + c, rounded once (in plain Python twice); lanes or numbers."""
    return a * b + c


def floored(value: Any) -> Any:
    """The next whole number below; of lanes or a number."""
    return np.floor(value)


def chosen(which: Any, a: Any, b: Any) -> Any:
    """`a` where something is so, else `b`; lanes or numbers."""
    return np.where(which, a, b)[()]


def gathered(rows: Array, row: int, columns: Any) -> Any:
    """Of a row the numbers in these eight columns."""
    return rows[row, columns.astype(int)]


def smaller(a: Any, b: Any) -> Any:
    """The smaller of two, lane by lane."""
    return np.minimum(a, b)


def larger(a: Any, b: Any) -> Any:
    """The larger of two, lane by lane."""
    return np.maximum(a, b)


def first_of(mask: Any) -> int:
    """The first lane in which something is so, or `LANES`."""
    return int(np.argmax(np.append(mask, True)))


def total(lanes: Any) -> float:
    """The sum of all lanes: halves, then quarters, then the last two."""
    half = lanes[:4] + lanes[4:]
    quarter = half[:2] + half[2:]
    return float(quarter[0] + quarter[1])


def powers(x: float) -> Any:
    """x, its square, ... its eighth power."""
    low = np.array([x, x * x, x * x * x, (x * x) * (x * x)])
    return np.append(low, low * low[3])


def turned_on(
    own: float, partner: float, back: float, own_of_partner: float, pushes: Any, others: Any,
    x: float, y: float,
) -> tuple[Any, Any]:  # fmt: skip
    """x and y after each of eight steps.

    x' = own x + partner y + push, y' = back x + own_of_partner y + other.
    """
    xs, ys = np.empty(LANES), np.empty(LANES)
    for k in range(LANES):
        x, y = (
            fma(partner, y, fma(own, x, pushes[k])),
            fma(back, x, fma(own_of_partner, y, others[k])),
        )
        xs[k], ys[k] = x, y
    return xs, ys
