"""How many characteristic roots lie to the right of a vertical line: a proof, not a search.

The argument principle counts the zeros of D(s) by the turns that D makes along the line
Re s = sigma. The line is cut into pieces on each of which a bound on the second derivative
keeps D inside a convex set that excludes 0, so the angle between its ends is the whole change;
a piece where the bound does not hold is halved. Only rounding is left out of the proof.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lathe_chatter.arrays import Array, Integers
from lathe_chatter.model import Machine
from lathe_chatter.stability.characteristic import (
    CharacteristicEquation,
    Complex,
    checked,
    polynomial,
)

UNDECIDED = -1
"""The count where the line passes through a root, within rounding."""
_HALVINGS = 60
_GRADING = np.array([0.5, 0.25, 0.125, 0.0625])
_PIECE = 1.2
"""Length of a first piece in radians of the delayed phase omega tau."""


def count_roots_right_of(
    machine: Machine,
    spindle_speed_rpm: float,
    depth_of_cut: float,
    real_part: float,
    *,
    seated: bool,
) -> int:
    """How many roots have a real part above `real_part`: 0 at 0 proves that a cut is stable.

    Args:
        machine: Tool, workpiece, bearing and material.
        spindle_speed_rpm: Spindle speed, rev/min.
        depth_of_cut: w, m.
        real_part: Real part of the line, 1/s.
        seated: Whether the workpiece rests on its bearing.

    Returns:
        The number with multiplicity, conjugates included; -1 where a root lies on the line
        within rounding.

    Raises:
        ParameterError: If speed or depth is not allowed.
    """
    equation = CharacteristicEquation.of(machine, seated=seated)
    delay = 60.0 / np.atleast_1d(checked('spindle_speed_rpm', spindle_speed_rpm))
    depth = np.atleast_1d(checked('depth_of_cut', depth_of_cut))
    line = np.array([float(real_part)])
    return int(count_right_of(equation, machine.cutting_coefficient * depth, delay, line)[0])


def count_right_of(
    equation: CharacteristicEquation,
    cutting_stiffness: Array,
    delay: Array,
    real_part: Array,
    near: tuple[Array, Array] | None = None,
) -> Integers:
    """The number of roots, with multiplicity, whose real part exceeds `real_part`.

    Args:
        equation: Machine and contact regime.
        cutting_stiffness: C w (n,), N/m.
        delay: tau (n,), s.
        real_part: sigma of the line (n,), 1/s.
        near: The frequency (n,), rad/s, of a root that is known to lie close to the line, and
            its distance from it (n,), 1/s. Only for speed.

    Returns:
        Counts (n,); `UNDECIDED` where a root lies on the line within rounding.
    """
    count = cutting_stiffness.size
    far = _enclosing_radius(equation, cutting_stiffness, delay, real_part)
    owner, low, high = _first_pieces(delay, far, *(near or (np.zeros(count), far)))

    def value(which: Integers, frequency: Array) -> Complex:
        s = real_part[which] + 1j * frequency
        return equation.value_and_slope(s, cutting_stiffness[which], delay[which]).value

    at_low, at_high = value(owner, low), value(owner, high)
    turned = np.zeros(count)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        at_middle, excluded = _piece(
            equation,
            cutting_stiffness[owner],
            delay[owner],
            real_part[owner] + 1j * middle,
            0.5 * (high - low),
        )
        angle = np.angle(at_high[excluded] * np.conj(at_low[excluded]))
        turned += np.bincount(owner[excluded], angle, count)
        split = ~excluded
        if not split.any():
            break
        owner = np.tile(owner[split], 2)
        low, high = (
            np.concatenate((low[split], middle[split])),
            np.concatenate((middle[split], high[split])),
        )
        at_low, at_high = (
            np.concatenate((at_low[split], at_middle[split])),
            np.concatenate((at_middle[split], at_high[split])),
        )
    end = real_part + 1j * far
    leading = equation.uncoupled[0]
    at_end = value(np.arange(count), far)
    arc = 4.0 * np.angle(end) + np.angle(at_end / (leading * end**4))
    found: Integers = np.rint((arc - turned) / np.pi).astype(np.int64)
    if split.any():
        found[owner] = UNDECIDED
    return found


def _enclosing_radius(
    equation: CharacteristicEquation, cutting_stiffness: Array, delay: Array, real_part: Array
) -> Array:
    """A circle that holds every root right of the line (Fujiwara's bound)."""
    leading = equation.uncoupled[0]
    both = cutting_stiffness * (1.0 + np.exp(-delay * real_part)) / leading
    bound = np.tile(np.array(equation.uncoupled[1:]) / leading, (delay.size, 1))
    bound[:, 1:] += np.outer(both, equation.flexible)
    radius: Array = 2.0 * np.max(bound ** (1.0 / np.arange(1.0, 5.0)), axis=1)
    return radius


def _first_pieces(
    delay: Array, far: Array, near: Array, distance: Array
) -> tuple[Integers, Array, Array]:
    """Pieces of 0..far: the number of the cut that each belongs to, its lower and upper end.

    A piece at height y above a root may be about sqrt(y / tau) long, which grades the pieces on
    both sides of it.
    """
    count = delay.size
    # The outer half of the line holds no surprise: it may start as one piece.
    pieces = np.maximum(np.ceil(far * delay / (2.0 * _PIECE)), 1.0).astype(np.int64)
    even_owner = np.repeat(np.arange(count), pieces)
    place = np.arange(even_owner.size) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    even = place * _PIECE / delay[even_owner]
    powers = (distance * delay)[:, None] ** _GRADING / delay[:, None]
    graded = (near[:, None] + np.hstack((-powers, powers))).ravel()
    graded_owner = np.repeat(np.arange(count), 2 * _GRADING.size)
    inside = (graded > 0.0) & (graded < far[graded_owner])
    owner = np.concatenate((even_owner, graded_owner[inside]))
    low = np.concatenate((even, graded[inside]))
    order = np.lexsort((low, owner))
    owner, low = owner[order], low[order]
    last = np.append(owner[1:] != owner[:-1], True)
    return owner, low, np.where(last, far[owner], np.roll(low, -1))


def _piece(
    equation: CharacteristicEquation, stiffness: Array, delay: Array, s: Complex, half: Array
) -> tuple[Complex, NDArray[np.bool_]]:
    """D in the middle of pieces, and whether 0 is excluded from each whole piece.

    With e^(-i y tau) = 1 - i y tau + rho, |rho| <= (y tau)^2 / 2, the tangent D + i y D' misses D
    by less than `miss` on |y| <= half.
    """
    a, p = equation.uncoupled, equation.flexible
    a1, a2, a3 = equation.uncoupled_derivatives
    p1 = equation.flexible_slope
    kp = stiffness * polynomial(p, s)
    kp1 = stiffness * polynomial(p1, s)
    kp2 = stiffness * 2.0 * p[0]
    echo = np.exp(-delay * s)
    strength = np.abs(echo)
    value = polynomial(a, s) + kp * (1.0 - echo)
    slope = polynomial(a1, s) + kp1 * (1.0 - echo) + kp * delay * echo
    cubic = np.abs(polynomial(a3, s)) / 3.0 + half * 24.0 * a[0] / 12.0
    smooth = np.abs(polynomial(a2, s)) + kp2 + half * cubic
    delayed = np.abs(kp) * delay**2 + 2.0 * np.abs(kp1) * delay + kp2
    miss = 0.5 * half**2 * (smooth + strength * delayed)
    # The distance of 0 from the tangent's piece {D + i y D'}.
    size = np.abs(slope)
    nearest = value / np.where(size > 0.0, 1j * slope, 1.0)
    beyond = np.maximum(np.abs(nearest.real) - half, 0.0)
    distance = np.where(size > 0.0, size * np.hypot(nearest.imag, beyond), np.abs(value))
    return value, distance > miss
