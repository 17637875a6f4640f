"""Stability under a periodic spindle speed: the dominant Floquet multiplier.

Two laws are in use. In a lathe whose speed swings, n (1 + A sin(2 pi f t)), the delay is the time
since the spindle was one turn back; the literature often lets the delay itself swing,
tau (1 + A sin(2 pi f t)). Either way the machine is periodic with T = 1/f. Its state, with
r = x_t - x_wp over the longest delay, is carried over a period; chatter grows where the largest
eigenvalue mu of that map lies outside the unit circle, at the rate ln|mu| / T.

The period is cut into equal elements. On each the modes are solved by Chebyshev collocation for
the cutting force at its nodes, which follows from the surface that was left one turn back. The map
is never written out: Arnoldi's method asks only for what it does to a vector, so memory is that of
one turn. Growth is measured from a rate near the expected one, so nothing overflows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lathe_chatter.array_types import Array
from lathe_chatter.model import Cut, Machine
from lathe_chatter.stability.characteristic import Complex, checked
from lathe_chatter.stability.matrix_free_eigenvalue import dominant_eigenvalue
from lathe_chatter.stability.periodic_map import (
    Element,
    Elements,
    SpeedLaw,
    carry,
    divide,
    element_of,
)

_WARM_UP = 3
_FAR_OFF = 300.0
"""|ln mu| from which on the rate that growth is measured from is corrected."""


@dataclass(frozen=True)
class Floquet:
    """How a disturbance grows from one period of the speed variation to the next.

    Attributes:
        growth_rate: ln|mu| / T, 1/s: with a constant speed the real part of the rightmost root.
        angle: Of the multiplier mu, 0 to pi, rad.
        period: T, s.
    """

    growth_rate: float
    angle: float
    period: float

    @property
    def multiplier(self) -> complex:
        """The eigenvalue mu of largest magnitude of the map over one period."""
        exponent = self.growth_rate * self.period
        size = math.exp(exponent) if exponent < 700.0 else math.inf
        return complex(size * math.cos(self.angle), size * math.sin(self.angle))


def floquet(
    machine: Machine,
    cut: Cut,
    *,
    seated: bool,
    law: SpeedLaw | str = SpeedLaw.SPEED,
    refinement: int = 1,
) -> Floquet:
    """The dominant multiplier of a cut whose spindle speed varies.

    Args:
        machine: Tool, workpiece, bearing and material.
        cut: Mean speed, depth, amplitude and frequency of the variation.
        seated: Whether the workpiece rests on its bearing.
        law: What swings, `SpeedLaw` or its value, 'speed' or 'delay'.
        refinement: Divides the elements, to check a result.

    Returns:
        The multiplier over one period of the variation.

    Raises:
        ParameterError: If the variation is so slow, or the machine so fast, that the answer
            would take minutes; if the law is none.
    """
    elements = divide(machine, cut, cut.depth_of_cut, law, refinement, seated=seated)
    return _multiplier(machine, cut, elements, seated=seated)


def varied_growth_rates(  # noqa: PLR0913 -- a chart and its law
    machine: Machine,
    cut: Cut,
    spindle_speed_rpm: ArrayLike,
    depth_of_cut: ArrayLike,
    *,
    seated: bool,
    law: SpeedLaw | str = SpeedLaw.SPEED,
) -> Array:
    """A stability chart under speed variation.

    Args:
        machine: Tool, workpiece, bearing and material.
        cut: Amplitude and frequency of the variation; its speed and depth are not used.
        spindle_speed_rpm: Mean spindle speeds (n,), rev/min.
        depth_of_cut: Depths w (m,), m.
        seated: Whether the workpiece rests on its bearing.
        law: What swings, `SpeedLaw` or its value, 'speed' or 'delay'.

    Returns:
        Growth rates (m, n), 1/s.

    Raises:
        ParameterError: If a speed or depth is not allowed, or the answer would take minutes.
    """
    speeds = np.atleast_1d(checked('spindle_speed_rpm', spindle_speed_rpm))
    depths = np.atleast_1d(checked('depth_of_cut', depth_of_cut))
    rates = np.empty((depths.size, speeds.size))
    for column, rpm in enumerate(speeds.tolist()):
        at_speed = cut.with_changes(spindle_speed_rpm=rpm)
        elements = divide(machine, at_speed, float(depths.max()), law, 1, seated=seated)
        for row, depth in enumerate(depths.tolist()):
            here = at_speed.with_changes(depth_of_cut=depth)
            rates[row, column] = _multiplier(machine, here, elements, seated=seated).growth_rate
    return rates


def _multiplier(machine: Machine, cut: Cut, elements: Elements, *, seated: bool) -> Floquet:
    """The dominant multiplier of a cut whose period is divided."""
    period = 1.0 / cut.speed_variation_frequency
    periods = elements.total // elements.period
    span = periods * period
    element = element_of(machine, cut, elements, 0.0, seated=seated)
    vector = np.random.default_rng(0).standard_normal(elements.size(element))
    for _ in range(_WARM_UP):
        vector, log = carry(vector, elements, element, elements.total, rescaled=True)
    rate = log / span
    for _ in range(_WARM_UP):
        element = element_of(machine, cut, elements, rate, seated=seated)
        found, mode = _dominant(elements, element, vector)
        exponent = math.log(abs(found)) if found else -math.inf
        if not _FAR_OFF < abs(exponent) < math.inf:
            break
        rate += exponent / span
    angle = np.angle(found)
    if periods > 1:  # of the multiplier of one period only a power is known so far
        real, imaginary = (
            carry(np.asarray(part, float), elements, element, elements.period)[0]
            for part in (mode.real, mode.imag)
        )
        angle = np.angle(np.vdot(mode, real + 1j * imaginary))
    return Floquet(rate + exponent / span, abs(float(angle)), period)


def _dominant(elements: Elements, element: Element, start: Array) -> tuple[complex, Complex]:
    """The dominant eigenvalue and its vector."""

    def carried(vector: Array) -> Array:
        return carry(vector, elements, element, elements.total)[0]

    return dominant_eigenvalue(carried, start)
