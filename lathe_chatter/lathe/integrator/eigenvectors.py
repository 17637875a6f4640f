"""Real eigenvectors of a small matrix, by the same operations on every processor.

A library for linear algebra picks other kernels on another processor, and with them other last
bits; a run could then not be computed again elsewhere. Hence this: reduction to Hessenberg form by
rotations, QR steps with Wilkinson's shift, back substitution (Golub and Van Loan, Matrix
Computations, 7.4-7.6), for matrices of up to 32 rows and in strict IEEE arithmetic.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.compiled import compiled

_MOST_STEPS = 100
"""QR steps for an eigenvalue; ten are many."""
_TINY = 1e-15
WORST_CONDITION = 1e4
"""Of a basis; beyond it, near a double eigenvalue, the coordinates stay coupled."""


class Basis(NamedTuple):
    """Coordinates z of y = vectors z.

    Attributes:
        vectors: (2n, 2n).
        inverse: Of it (2n, 2n).
        generator: inverse A vectors (2n, 2n): z' = generator z.
        in_pairs: Whether the generator couples coordinate i with n + i only.
        rate: The largest |eigenvalue|.
    """

    vectors: Array
    inverse: Array
    generator: Array
    in_pairs: bool
    rate: float


def product(a: Array, b: Array) -> Array:
    """The matrix product, summed in order."""
    result = np.zeros((a.shape[0], b.shape[1]))
    _add_product(np.ascontiguousarray(a), np.ascontiguousarray(b), result)
    return result


@compiled(borrows=True)
def _add_product(a: Array, b: Array, result: Array) -> None:
    """Add the matrix product to `result`."""
    for i in range(a.shape[0]):
        for k in range(a.shape[1]):
            for j in range(b.shape[1]):
                result[i, j] += a[i, k] * b[k, j]


def inverse_of(matrix: Array) -> tuple[Array, bool]:
    """The inverse, and whether there is one."""
    result = np.eye(len(matrix))
    regular = _invert(np.array(matrix, order='C'), result)
    return result, regular


@compiled(borrows=True)
def _invert(a: Array, result: Array) -> bool:
    """Gauss and Jordan with pivots: `a` becomes the unit matrix, which `result` is before."""
    n = a.shape[0]
    for column in range(n):
        pivot = column
        for row in range(column + 1, n):
            if abs(a[row, column]) > abs(a[pivot, column]):
                pivot = row
        if not abs(a[pivot, column]) > 0.0:
            return False
        for k in range(n):
            a[column, k], a[pivot, k] = a[pivot, k], a[column, k]
            result[column, k], result[pivot, k] = result[pivot, k], result[column, k]
        scale = 1.0 / a[column, column]
        for k in range(n):
            a[column, k] *= scale
            result[column, k] *= scale
        for row in range(n):
            factor = a[row, column]
            if row != column and factor != 0.0:
                for k in range(n):
                    a[row, k] -= factor * a[column, k]
                    result[row, k] -= factor * result[column, k]
    return True


@compiled(borrows=True, inner=True)
def _rotate(t: Any, q: Any, i: int, j: int, c: float, s: complex) -> None:
    """T -> G T G*, Q -> Q G* for the rotation that mixes rows i and j."""
    n = t.shape[0]
    for k in range(n):
        x, y = t[i, k], t[j, k]
        t[i, k], t[j, k] = c * x + s * y, c * y - s.conjugate() * x
    for k in range(n):
        x, y = t[k, i], t[k, j]
        t[k, i], t[k, j] = c * x + s.conjugate() * y, c * y - s * x
        x, y = q[k, i], q[k, j]
        q[k, i], q[k, j] = c * x + s.conjugate() * y, c * y - s * x


@compiled(borrows=True, inner=True)
def _rotation(x: complex, y: complex) -> tuple[float, complex]:
    """c and s of the rotation that takes (x, y) to (r, 0)."""
    size_x, size_y = abs(x), abs(y)
    if size_y == 0.0:
        return 1.0, 0.0j
    length = np.sqrt(size_x * size_x + size_y * size_y)
    if size_x == 0.0:
        return 0.0, y.conjugate() / size_y
    return size_x / length, (x / size_x) * y.conjugate() / length


@compiled(borrows=True, inner=True)
def _schur(t: Any, q: Any, cosines: Array, sines: Any) -> bool:
    """Make T and Q of A = Q T Q*, T upper triangular, of A and 1; whether it has converged."""
    n = t.shape[0]
    for k in range(n - 2):
        for i in range(k + 2, n):
            if t[i, k] != 0.0:
                c, s = _rotation(t[k + 1, k], t[i, k])
                _rotate(t, q, k + 1, i, c, s)
                t[i, k] = 0.0
    high, steps = n - 1, 0
    while high > 0:
        low = high
        while low > 0:
            size = abs(t[low, low]) + abs(t[low - 1, low - 1])
            if abs(t[low, low - 1]) <= 1e-17 * size:
                t[low, low - 1] = 0.0
                break
            low -= 1
        if low == high:
            high, steps = high - 1, 0
            continue
        steps += 1
        if steps > _MOST_STEPS:
            return False
        a, b = t[high - 1, high - 1], t[high - 1, high]
        c2, d = t[high, high - 1], t[high, high]
        half = 0.5 * (a - d)
        root = np.sqrt(half * half + b * c2)
        first, second = d - root + half, d + root + half
        shift = first if abs(first - d) < abs(second - d) else second
        if steps % 11 == 0:  # out of a cycle
            shift = d + abs(c2)
        for k in range(n):
            t[k, k] -= shift
        for k in range(low, high):  # H - shift = Q R ...
            c, s = _rotation(t[k, k], t[k + 1, k])
            cosines[k], sines[k] = c, s
            for j in range(k, n):
                x, y = t[k, j], t[k + 1, j]
                t[k, j], t[k + 1, j] = c * x + s * y, c * y - s.conjugate() * x
            t[k + 1, k] = 0.0
        for k in range(low, high):  # ... and R Q + shift
            c, s = cosines[k], sines[k]
            for i in range(min(k + 2, high + 1)):
                x, y = t[i, k], t[i, k + 1]
                t[i, k], t[i, k + 1] = c * x + s.conjugate() * y, c * y - s * x
            for i in range(n):
                x, y = q[i, k], q[i, k + 1]
                q[i, k], q[i, k + 1] = c * x + s.conjugate() * y, c * y - s * x
        for k in range(n):
            t[k, k] += shift
    return True


def eigenvectors(matrix: Array) -> tuple[Any, Any, bool]:
    """Eigenvalues (n,) and eigenvectors (n, n) of a real matrix, and whether they were found."""
    n = len(matrix)
    values, vectors, room = np.empty(n, complex), np.empty((n, n), complex), np.empty(n, complex)
    t, q = matrix.astype(complex, order='C'), np.eye(n, dtype=complex)
    return values, vectors, _find(t, q, values, vectors, np.empty(n), room)


@compiled(borrows=True)
def _find(t: Any, q: Any, values: Any, vectors: Any, cosines: Array, x: Any) -> bool:
    """Write eigenvalues and eigenvectors of the matrix `t`; whether they were found."""
    n = t.shape[0]
    found = _schur(t, q, cosines, x)
    size = 0.0
    for k in range(n):
        values[k] = t[k, k]
        size = max(size, abs(t[k, k]))
    for k in range(n):
        x[k] = 1.0
        for i in range(k - 1, -1, -1):
            total = t[i, k] + 0.0j
            for j in range(i + 1, k):
                total += t[i, j] * x[j]
            gap = t[k, k] - t[i, i]
            if abs(gap) < _TINY * size:
                gap = _TINY * size + 0.0j
            x[i] = total / gap
        for i in range(n):
            total = 0.0j
            for j in range(k + 1):
                total += q[i, j] * x[j]
            vectors[i, k] = total
    return found


def basis_of(matrix: Array, scale: Array) -> Basis:
    """Coordinates in which the motion y' = matrix y is as simple as can be.

    A pair p +- i q of eigenvalues has two coordinates that turn into each other, (p, -q; q, p);
    real eigenvalues go in pairs as they come. Where two are nearly one, as at critical damping,
    the eigenvectors nearly agree: then the coordinates are y / `scale`, all coupled.

    Args:
        matrix: (2n, 2n).
        scale: Sizes of y that belong together (2n,).
    """
    n = len(matrix) // 2
    balanced = matrix * scale / scale[:, None]
    values, vectors, found = eigenvectors(balanced)
    rate = float(np.abs(values).max())
    paired = _paired(values, vectors, n) if found and np.isfinite(vectors).all() else None
    if paired is not None:
        real, pairs = paired
        inverse, regular = inverse_of(real)
        condition = float(np.sqrt((real**2).sum() * (inverse**2).sum())) / (2 * n)
        if regular and condition <= WORST_CONDITION:
            left = product(balanced, real) - product(real, pairs)
            if np.abs(left).max() <= 1e-13 * max(rate, 1e-300):
                return Basis(
                    real * scale[:, None], inverse / scale, pairs, in_pairs=True, rate=rate
                )
    return Basis(np.diag(scale), np.diag(1.0 / scale), balanced, in_pairs=False, rate=rate)


def _paired(values: Any, vectors: Any, n: int) -> tuple[Array, Array] | None:
    """A real basis (columns re..., im...) and its generator; None where they make no pairs."""
    size = np.abs(values).max()
    order = sorted(range(2 * n), key=lambda i: (values[i].imag, values[i].real))
    turning = [i for i in order if values[i].imag > 1e-9 * size]
    real = [i for i in order if abs(values[i].imag) <= 1e-9 * size]
    if 2 * len(turning) + len(real) != 2 * n:
        return None
    basis, generator = np.empty((2 * n, 2 * n)), np.zeros((2 * n, 2 * n))
    for k, i in enumerate(turning):
        vector = _normal(vectors[:, i])
        basis[:, k], basis[:, n + k] = vector.real, -vector.imag
        generator[k, k] = generator[n + k, n + k] = values[i].real
        generator[k, n + k], generator[n + k, k] = -values[i].imag, values[i].imag
    for k, (i, j) in enumerate(zip(real[::2], real[1::2], strict=True), len(turning)):
        for column, which in ((k, i), (n + k, j)):
            basis[:, column] = _normal(vectors[:, which]).real
            generator[column, column] = values[which].real
    return basis, generator


def _normal(vector: Any) -> Any:
    """An eigenvector of size 1 whose largest part is real and positive."""
    size = np.abs(vector)
    largest = vector[int(size.argmax())]
    total = 0.0
    for part in size.tolist():
        total += part * part
    return vector * (np.conj(largest) / np.abs(largest)) / np.sqrt(total)
