"""The eigenvalue of largest magnitude of a map that is known only by what it does."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lathe_chatter.array_types import Array
from lathe_chatter.errors import UnprovenError

_CHECKED = 4
"""Steps after which it is looked whether the eigenvalue has settled."""
_TOLERANCE = 1e-12
_MOST_STEPS = 400


def dominant_eigenvalue(
    carried: Callable[[Array], Array], start: Array
) -> tuple[complex, NDArray[np.complexfloating[Any, Any]]]:
    """Arnoldi's method with full orthogonalisation.

    `einsum` keeps to this thread: the library behind `@` may hand so small a product to others
    and wait for them.

    Args:
        carried: The map of a vector (size,).
        start: A vector that has something of the wanted one (size,).

    Returns:
        The eigenvalue, with imaginary part >= 0, and its eigenvector (size,).

    Raises:
        UnprovenError: If it does not settle.
    """
    size = len(start)
    most = min(size, _MOST_STEPS)
    basis: Array = np.zeros((min(most, 32) + 1, size))
    projected = np.zeros((most + 1, most))
    basis[0] = start / math.sqrt(_square(start))
    for k in range(most):
        image = carried(basis[k])
        length = math.sqrt(_square(image))
        for _ in range(2):
            along = np.einsum('kj,j->k', basis[: k + 1], image)
            image -= np.einsum('kj,k->j', basis[: k + 1], along)
            projected[: k + 1, k] += along
        rest = math.sqrt(_square(image))
        exhausted = k + 1 == size or rest <= 1e-15 * length
        if exhausted or (k + 1) % _CHECKED == 0:
            values, vectors = np.linalg.eig(projected[: k + 1, : k + 1])
            first = int(np.argmax(np.abs(values)))
            settled = rest * abs(vectors[k, first]) <= _TOLERANCE * abs(values[first])
            if exhausted or settled:
                vector = np.einsum('kj,k->j', basis[: k + 1], vectors[:, first])
                value = complex(values[first])
                return (value, vector) if value.imag >= 0.0 else (value.conjugate(), vector.conj())
        if k + 2 > len(basis):
            basis = np.concatenate((basis, np.zeros_like(basis)))
        projected[k + 1, k] = rest
        basis[k + 1] = image / rest
    raise UnprovenError('The dominant multiplier of the varied speed')


def _square(vector: Array) -> float:
    """Its length squared."""
    return float(np.einsum('j,j->', vector, vector))
