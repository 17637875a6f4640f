from __future__ import annotations

import numpy as np
import pytest

from lathe_chatter.array_types import Array
from lathe_chatter.stability.matrix_free_eigenvalue import dominant_eigenvalue


def start_of(size: int) -> Array:
    return np.random.default_rng(0).standard_normal(size)


def _random_matrix(size: int, seed: int) -> Array:
    matrix: Array = np.random.default_rng(seed).standard_normal((size, size))
    return matrix


@pytest.mark.parametrize('size', [1, 2, 7, 60])
def test_the_dominant_eigenvalue_is_that_of_lapack(size: int) -> None:
    matrix = _random_matrix(size, size)
    found, vector = dominant_eigenvalue(lambda v: matrix @ v, start_of(size))
    values = np.linalg.eigvals(matrix)
    assert abs(found) == pytest.approx(np.abs(values).max(), rel=1e-10)
    assert np.abs(values - found).min() < 1e-10 * abs(found)
    assert matrix @ vector == pytest.approx(found * vector, abs=1e-9 * abs(found))


def test_an_invariant_subspace_ends_the_search() -> None:
    matrix = np.zeros((50, 50))
    matrix[0, 1], matrix[1, 0] = -2.0, 2.0
    assert dominant_eigenvalue(lambda v: matrix @ v, start_of(50))[0] == pytest.approx(2j)
