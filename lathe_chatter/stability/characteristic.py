"""The characteristic equation of turning, for many cuts of one machine at once.

With the receptance G = 1 / (m s^2 + c s + k) of each mode, equations (2) and (8) have solutions
e^st where

    1 + C w (G_t + G_wp) (1 - e^(-s tau)) = 0.

Multiplied by both denominators this is a function without poles,

    D(s) = a(s) + C w p(s) (1 - e^(-s tau)),    a = 1 / (G_t G_wp),    p = 1/G_t + 1/G_wp,

whose zeros are searched and counted. Its real part decides: chatter grows like e^(Re s t).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lathe_chatter.arrays import Array
from lathe_chatter.model import Cut, Machine
from lathe_chatter.model.quantities import quantity_of

Complex: TypeAlias = NDArray[np.complexfloating[Any, Any]]

Coefficients: TypeAlias = tuple[float, ...]
"""Of a polynomial, leading first; plain floats, which NumPy multiplies by fastest."""

_ROUNDING = 4.0 * float(np.finfo(float).eps)


def polynomial(coefficients: Coefficients, s: Any) -> Any:
    """Horner's rule, leading coefficient first."""
    value = coefficients[0] * s + coefficients[1]
    for coefficient in coefficients[2:]:
        value *= s
        value += coefficient
    return value


def _derivative(coefficients: Coefficients) -> Coefficients:
    degree = len(coefficients) - 1
    return tuple((degree - k) * c for k, c in enumerate(coefficients[:-1]))


@dataclass(frozen=True)
class CharacteristicEquation:
    """D(s) of one machine in one contact regime; depth and speed are arguments.

    Attributes:
        uncoupled: Coefficients of a(s), leading first (5,).
        flexible: Coefficients of p(s), leading first (3,).
    """

    uncoupled: Coefficients
    flexible: Coefficients

    @cached_property
    def uncoupled_derivatives(self) -> tuple[Coefficients, Coefficients, Coefficients]:
        """Coefficients of a', a'' and a'''."""
        first = _derivative(self.uncoupled)
        second = _derivative(first)
        return first, second, _derivative(second)

    @cached_property
    def flexible_slope(self) -> Coefficients:
        """Coefficients of p'."""
        return _derivative(self.flexible)

    @classmethod
    def of(
        cls, machine: Machine, *, seated: bool, least_damping: float = 0.0
    ) -> CharacteristicEquation:
        """The equation of a machine whose bearing carries (seated) or does not.

        With `least_damping` no mode has a smaller damping ratio than that.
        """
        stiffnesses = (machine.tool.stiffness, machine.workpiece_stiffness(seated=seated))
        of_tool, of_workpiece = (
            np.array([m.mass, max(m.damping, 2.0 * least_damping * math.sqrt(k * m.mass)), k])
            for m, k in zip((machine.tool, machine.workpiece), stiffnesses, strict=True)
        )
        return cls(
            tuple(np.convolve(of_tool, of_workpiece).tolist()),
            tuple((of_tool + of_workpiece).tolist()),
        )

    def receptance(self, frequency: Any) -> Complex:
        """(G_t + G_wp)(i omega), m/N, for angular frequencies of any shape."""
        s = 1j * frequency
        ratio: Complex = polynomial(self.flexible, s) / polynomial(self.uncoupled, s)
        return ratio

    def receptance_log_slope(self, s: Complex) -> Complex:
        """G'(s) / G(s), s; at i omega its real part is d arg G / d omega."""
        ratio: Complex = polynomial(self.flexible_slope, s) / polynomial(self.flexible, s)
        ratio -= polynomial(self.uncoupled_derivatives[0], s) / polynomial(self.uncoupled, s)
        return ratio

    def value_and_slope(self, s: Complex, cutting_stiffness: Array, delay: Array) -> Newton:
        """D and dD/ds; the three arguments have one shape or broadcast."""
        a = polynomial(self.uncoupled, s)
        p = polynomial(self.flexible, s)
        kp = cutting_stiffness * p
        echo = np.exp(-delay * s)
        rest = 1.0 - echo
        slope = polynomial(self.uncoupled_derivatives[0], s)
        slope += cutting_stiffness * polynomial(self.flexible_slope, s) * rest
        slope += kp * delay * echo
        distance = np.abs(s)
        size = polynomial(self.flexible, distance)
        size *= cutting_stiffness * (1.0 + np.abs(echo))
        size += polynomial(self.uncoupled, distance)
        return Newton(a + kp * rest, slope, size)

    def delay_free_roots(self, cutting_stiffness: Array) -> Complex:
        """The zeros (n, 4) of a(s) + C w p(s): the machine with a cut that leaves no trace."""
        coefficients = np.tile(self.uncoupled, (cutting_stiffness.size, 1))
        coefficients[:, 2:] += np.outer(cutting_stiffness, self.flexible)
        companion = np.zeros((cutting_stiffness.size, 4, 4))
        companion[:, 1:, :3] = np.eye(3)
        # Scaled to a unit frequency: the powers of s differ by 1e12 otherwise.
        scale = (coefficients[:, 4] / coefficients[:, 0]) ** 0.25
        powers = scale[:, None] ** -np.arange(1.0, 5.0)
        companion[:, 0, :] = -coefficients[:, 1:] / coefficients[:, :1] * powers
        roots: Complex = np.linalg.eigvals(companion) * scale[:, None]
        return roots.astype(np.complex128)


@dataclass(frozen=True)
class Newton:
    """D, dD/ds and the sum of the magnitudes of D's monomials at some points."""

    value: Complex
    slope: Complex
    size: Array

    @property
    def residual(self) -> Array:
        """|D| over the magnitude of its terms: 1e-16 is a root to rounding."""
        ratio: Array = np.abs(self.value) / self.size
        return ratio


def residual_tolerance(s: Complex, delay: Array) -> Array:
    """What `Newton.residual` can reach: a phase s tau of many turns is itself rounded."""
    return np.maximum(1e-13, _ROUNDING * np.abs(s) * delay)


def checked(name: str, values: ArrayLike) -> Array:
    """Values of a field of `Cut` as an array, each within the limits of that field.

    Raises:
        ParameterError: For the first that is not allowed.
    """
    limits = quantity_of(Cut.__dataclass_fields__[name])
    assert limits is not None  # noqa: S101 -- a name within this package
    try:
        numbers = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        return np.asarray(limits.check(name, values))
    wrong = ~((numbers >= limits.low) & (numbers <= limits.high))
    if wrong.any():
        limits.check(name, float(numbers[wrong][0]))
    return numbers
