"""Eight lanes as machine code against the same in NumPy, which rounds a b + c twice."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numba
import numpy as np
import pytest

from lathe_chatter.array_types import Array
from lathe_chatter.lathe.integrator import simd_vectors
from lathe_chatter.lathe.integrator import simd_vectors_in_python as plain
from lathe_chatter.lathe.integrator.simd_vectors import LANES


def _made_of(own: Any) -> Callable[[Array, Array], tuple[int, int, float, float, float]]:
    """A function that uses all of simd_vectors.py, or of its double."""

    def everything(given: Array, out: Array) -> tuple[int, int, float, float, float]:
        x, y = own.lanes_at(given, 0, 1), own.lanes_at(given, 1, 2)
        z = own.fma(2.0, x, y) - 1.0 / y
        own.put(out, 0, 3, -z)
        own.put(out, 1, 0, own.after(9.0, z))
        own.put(out, 2, 8, own.before(z))
        xs, ys = own.turned_on(0.9, 0.1, -0.1, 0.8, x, y, 1.0, 2.0)
        rows = (
            x, y, own.counted(3.0), own.smaller(x, y), own.larger(x, 0.5), xs, ys,
            own.powers(0.7),
        )  # fmt: skip
        own.put_samples(out, 4, rows)
        own.put(out, 3, 8, own.six(1.0, 2.0, 3.0, 4.0, 5.0, given[0, 0]))
        own.put(out, 1, 8, own.gathered(given, 1, own.floored(8.0 * x)))
        own.put(out, 0, 0, own.chosen(x < 0.5, own.chosen(x > y, x, 4.0), own.floored(-3.0 * y)))
        happens = ((x < 0.2) & (z > 0.0)) | (y == 5.0) | (y <= 0.01)
        return (
            own.first_of(happens), own.first_of(x > own.spread(2.0)), own.lane(z, 3),
            own.total(x * y) + own.floored(-9.0 * given[0, 0]),
            own.chosen(given[0, 0] < given[0, 1], 3.0, given[1, 1]),
        )  # fmt: skip

    return everything


_compiled, _all_of_it = numba.njit(_made_of(simd_vectors)), _made_of(plain)


@pytest.mark.parametrize('seed', range(20))
def test_machine_code_and_numpy_agree(seed: int) -> None:
    given = np.random.default_rng(seed).random((2, 20))
    one, other = np.zeros((12, 16)), np.zeros((12, 16))
    found, expected = _compiled(given, one), _all_of_it(given, other)
    assert found[:2] == expected[:2]
    assert found[1] == LANES
    assert found[2:] == pytest.approx(expected[2:], rel=1e-14)
    assert one == pytest.approx(other, rel=1e-13, abs=1e-15)


@numba.njit  # type: ignore[untyped-decorator]  # Numba
def _fused(a: float, b: float, c: float, out: Array) -> float:
    simd_vectors.put(out, 0, 0, simd_vectors.fma(a, simd_vectors.spread(b), c))
    return simd_vectors.fma(a, b, c)


@pytest.mark.parametrize('seed', range(50))
def test_a_product_and_a_sum_are_rounded_once(seed: int) -> None:
    """Against rational numbers, in a lane as by itself: of a sum only the rounding is left."""
    a, b = np.random.default_rng(seed).normal(size=2).tolist()
    c, out = -a * b, np.zeros((1, LANES))
    exact = float(Fraction(a) * Fraction(b) + Fraction(c))
    assert _fused(a, b, c, out) == exact
    assert (out == exact).all()
