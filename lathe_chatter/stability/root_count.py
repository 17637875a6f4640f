"""How many characteristic roots lie to the right of a vertical line: a proof, not a search.

The argument principle: along the line Re s = sigma the function F turns about 0 once for each of
its zeros to the right, less its poles there, which are known. The line is cut into pieces on each
of which a bound on the second derivative keeps F inside a convex set that excludes 0, so that the
angle between its ends is the whole change. Only rounding is left out of the proof.
"""

from __future__ import annotations

import cmath
import math

import numpy as np

from lathe_chatter.array_types import Array, Integers
from lathe_chatter.compiled import compiled
from lathe_chatter.model import Machine
from lathe_chatter.stability.characteristic import NO_DAMPING, Cuts, ProcessDamping
from lathe_chatter.stability.compiled_characteristic import (
    ALPHA,
    BETA,
    DAMPING,
    STIFFNESS,
    inverse,
)

UNDECIDED = -1
"""The count where the line passes through a root, within rounding."""
_PIECE = 1.2
"""Length of a first piece in radians of the delayed phase omega tau."""
_GROWTH, _SHRINKAGE = 1.7, 0.45
"""Of the next piece after one on which 0 is excluded, and after one on which it is not."""
_MOST_DOUBLINGS = 60
_SMALLEST = 1e-16
"""Piece, relative to the frequency, that still means something."""


def count_roots_right_of(
    machine: Machine,
    spindle_speed_rpm: float,
    depth_of_cut: float,
    real_part: float,
    *,
    seated: bool,
    process: ProcessDamping = NO_DAMPING,
) -> int:
    """How many roots have a real part above `real_part`: 0 at 0 proves that a cut is stable.

    Args:
        machine: Tool, workpiece, bearing and material.
        spindle_speed_rpm: Spindle speed, rev/min.
        depth_of_cut: w, m.
        real_part: Real part of the line, 1/s.
        seated: Whether the workpiece rests on its bearing.
        process: Process damping.

    Returns:
        The number with multiplicity, conjugates included; -1 where a root lies on the line
        within rounding.

    Raises:
        ParameterError: If speed or depth is not allowed.
    """
    cuts = Cuts.of(machine, spindle_speed_rpm, depth_of_cut, seated=seated, process=process)
    line = np.array([float(real_part)])
    return int(count_right_of(cuts, line)[0])


def count_right_of(cuts: Cuts, real_part: Array) -> Integers:
    """The number of roots of each cut, with multiplicity, whose real part exceeds `real_part`.

    Args:
        cuts: n of them.
        real_part: sigma of each line (n,), 1/s.

    Returns:
        Counts (n,); `UNDECIDED` where a root lies on the line within rounding.
    """
    found = np.empty(cuts.delay.size, np.int64)
    _count_all(
        cuts.sections, cuts.modes, cuts.machine, cuts.stiffness, cuts.damping, cuts.delay,
        real_part, found,
    )  # fmt: skip
    return found


@compiled(nogil=True)
def _count_all(
    sections: Array, modes: Integers, machine: Integers, stiffness: Array, damping: Array,
    delay: Array, real_part: Array, found: Integers,
) -> None:  # fmt: skip
    """`count_to_the_right` of many cuts."""
    for cut in range(len(delay)):
        which = machine[cut]
        found[cut] = count_to_the_right(
            sections[which], modes[which], stiffness[cut], damping[cut], delay[cut],
            real_part[cut],
        )  # fmt: skip


@compiled(borrows=True, inner=True)
def count_to_the_right(
    sections: Array, modes: int, stiffness: float, damping: float, delay: float, sigma: float
) -> int:
    """The number of zeros of D with Re s > sigma."""
    count = _poles_to_the_right(sections, modes, sigma)
    if stiffness == 0.0 and damping == 0.0:
        return count
    far = _last_frequency(sections, modes, stiffness, damping, delay, sigma)
    if far < 0.0:
        return UNDECIDED
    echo = stiffness * math.exp(-delay * sigma)
    omega, length, turned = 0.0, _PIECE / delay, 0.0
    here = _value(sections, modes, stiffness, damping, delay, sigma, omega, echo)
    while omega < far:
        length = min(length, far - omega)
        if length <= _SMALLEST * (omega + abs(sigma)):
            return UNDECIDED
        half = 0.5 * length
        if not _excludes_zero(
            sections, modes, stiffness, damping, delay, sigma, omega + half, echo, half
        ):
            length *= _SHRINKAGE
            continue
        omega = far if length == far - omega else omega + length
        there = _value(sections, modes, stiffness, damping, delay, sigma, omega, echo)
        turned += cmath.phase(there * here.conjugate())
        here = there
        length *= _GROWTH
    # Beyond, F stays within 1 of its limit, which is 1.
    return count - round((turned - cmath.phase(here)) / math.pi)


@compiled(inline=True, borrows=True, inner=True)
def _value(
    sections: Array, modes: int, stiffness: float, damping: float, delay: float, sigma: float,
    omega: float, echo: float,
) -> complex:  # fmt: skip
    """F(sigma + i omega), with K e^(-sigma tau) known. Real numbers: half the time of complex."""
    real, imaginary = 0.0, 0.0
    square = sigma * sigma - omega * omega
    for j in range(modes):
        c, alpha = sections[j, DAMPING], sections[j, ALPHA]
        x = square + c * sigma + sections[j, STIFFNESS]
        y = (2.0 * sigma + c) * omega
        per = 1.0 / (x * x + y * y)
        u, v = alpha * sigma + sections[j, BETA], alpha * omega
        real += (u * x + v * y) * per
        imaginary += (v * x - u * y) * per
    phase = omega * delay
    a = stiffness - echo * math.cos(phase) + damping * sigma
    b = echo * math.sin(phase) + damping * omega
    return complex(1.0 + a * real - b * imaginary, a * imaginary + b * real)


@compiled(borrows=True, inner=True)
def _poles_to_the_right(sections: Array, modes: int, sigma: float) -> int:
    """The number of zeros of A with Re s > sigma."""
    count = 0
    for j in range(modes):
        half = 0.5 * sections[j, DAMPING]
        rest = half * half - sections[j, STIFFNESS]
        apart = math.sqrt(rest) if rest > 0.0 else 0.0
        count += int(-half + apart > sigma) + int(-half - apart > sigma)
    return count


@compiled(borrows=True, inner=True)
def _last_frequency(
    sections: Array, modes: int, stiffness: float, damping: float, delay: float, sigma: float
) -> float:
    """Where |F - 1| < 1 from here up; negative where there is no such place.

    With |s| >= 2 |pole| a denominator is at least |s|^2 / 4. The alphas add up to nothing, so
    only what follows their leading term counts.
    """
    highest, height, steep, left = 0.0, 0.0, 0.0, 0.0
    for j in range(modes):
        c, k = sections[j, DAMPING], sections[j, STIFFNESS]
        highest = max(highest, 0.5 * c + math.sqrt(abs(0.25 * c * c - k)), math.sqrt(k))
        height += abs(sections[j, BETA]) + abs(sections[j, ALPHA]) * c
        steep += abs(sections[j, ALPHA]) * k
        left += sections[j, ALPHA]
    strongest = stiffness * (1.0 + math.exp(-delay * sigma))
    far = 2.0 * highest
    for _ in range(_MOST_DOUBLINGS):
        distance = math.hypot(far, sigma)
        receptance = 4.0 * (height + steep / distance) / (distance * distance)
        receptance += abs(left) / distance
        if (strongest + damping * distance) * receptance < 0.9:
            return far
        far *= 1.3
    return -1.0


@compiled(inline=True, borrows=True, inner=True)
def _excludes_zero(
    sections: Array, modes: int, stiffness: float, damping: float, delay: float, sigma: float,
    omega: float, echo: float, half: float,
) -> bool:  # fmt: skip
    """Whether F is not 0 anywhere on sigma + i (omega - half ... omega + half).

    The tangent at the middle misses F by less than half^2 / 2 times the largest second
    derivative; where even |F - 1| < 1 nothing more is to be asked.
    """
    real, imaginary, slope, slope_i = 0.0, 0.0, 0.0, 0.0
    most, steepest, bend = 0.0, 0.0, 0.0
    square, rise_i = sigma * sigma - omega * omega, 2.0 * omega
    for j in range(modes):
        c, alpha = sections[j, DAMPING], sections[j, ALPHA]
        x = square + c * sigma + sections[j, STIFFNESS]
        rise = 2.0 * sigma + c
        y = rise * omega
        square_size = x * x + y * y
        size = math.sqrt(square_size)
        climb = math.sqrt(rise * rise + rise_i * rise_i)
        least = size - half * (climb + half)
        if least <= 0.1 * size:
            return False
        per = 1.0 / square_size
        u, v = alpha * sigma + sections[j, BETA], alpha * omega
        part, part_i = (u * x + v * y) * per, (v * x - u * y) * per
        # G_j' = (alpha - G_j d') / d
        top = alpha - part * rise + part_i * rise_i
        top_i = -part * rise_i - part_i * rise
        real += part
        imaginary += part_i
        slope += (top * x + top_i * y) * per
        slope_i += (top_i * x - top * y) * per
        # The largest part, slope and bend of this section on the piece.
        least, climb, alpha = 1.0 / least, climb + 2.0 * half, abs(alpha)
        up = (math.sqrt(u * u + v * v) + alpha * half) * least
        most += up
        steepest += (alpha + up * climb) * least
        bend += 2.0 * (alpha * climb * least + up * (1.0 + climb * climb * least)) * least
    phase = omega * delay
    cosine, sine = echo * math.cos(phase), echo * math.sin(phase)
    a = stiffness - cosine + damping * sigma
    b = sine + damping * omega
    push = delay * echo + damping
    pushed = math.sqrt(a * a + b * b) + half * push
    if pushed * most < 0.95:
        return True
    value = complex(1.0 + a * real - b * imaginary, a * imaginary + b * real)
    rising = complex(delay * cosine + damping, -delay * sine)
    steep = rising * complex(real, imaginary) + complex(a, b) * complex(slope, slope_i)
    miss = pushed * bend + 2.0 * push * steepest + delay * delay * echo * most
    miss *= 0.5 * half * half
    # The distance of 0 from the tangent's piece {F + i y F'}.
    size_of_slope = abs(steep)
    if size_of_slope == 0.0:
        return abs(value) > miss
    nearest = -1j * value * inverse(steep)
    beyond = max(abs(nearest.real) - half, 0.0)
    return size_of_slope * math.sqrt(nearest.imag**2 + beyond * beyond) > miss
