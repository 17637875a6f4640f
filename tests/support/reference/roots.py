"""The first root of a polynomial on an interval, with none missed."""

from __future__ import annotations

from collections.abc import Sequence

_FINEST = 1e-8
"""Half the shortest interval looked at: its square, by which a graze misses, is rounding."""


def first_root(coefficients: Sequence[float], length: float) -> float | None:
    """The first root in (0, length] of a polynomial that starts positive.

    The interval is halved until a Lipschitz bound excludes a root, or excludes a turning point,
    so that two roots close together are not missed.

    Args:
        coefficients: Ascending powers; the constant is not negative.
        length: At most 1.

    Returns:
        The root, or None.

    Raises:
        ArithmeticError: If the polynomial grazes zero within rounding.
    """
    magnitude = [abs(c) * length**k for k, c in enumerate(coefficients)]
    if magnitude[0] > sum(magnitude[1:]):
        return None
    slope = [k * c for k, c in enumerate(coefficients)][1:]
    bend = [k * c for k, c in enumerate(slope)][1:]
    most_bent = sum(abs(c) * length**k for k, c in enumerate(bend))
    pending = [(0.0, length)]
    while pending:
        a, b = pending.pop()
        middle, half = 0.5 * (a + b), 0.5 * (b - a)
        inclination = abs(horner(slope, middle))
        if horner(coefficients, middle) > half * (inclination + half * most_bent):
            continue
        if inclination > half * most_bent:
            if horner(coefficients, b) <= 0.0:
                return _bisect(coefficients, a, b)
            continue
        if half < _FINEST * length:
            raise ArithmeticError('a signal grazes its limit too closely to be judged')
        pending += [(middle, b), (a, middle)]
    return None


def horner(coefficients: Sequence[float], x: float) -> float:
    """The polynomial at x."""
    result = 0.0
    for c in reversed(coefficients):
        result = result * x + c
    return result


def _bisect(coefficients: Sequence[float], a: float, b: float) -> float:
    """The root of a falling polynomial between a and b, to rounding."""
    while True:
        middle = 0.5 * (a + b)
        if middle in (a, b):
            return b
        if horner(coefficients, middle) > 0.0:
            a = middle
        else:
            b = middle
