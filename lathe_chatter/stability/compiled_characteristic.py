"""The characteristic equation of one cut at one point, compiled.

A section is one mode of the receptance, (alpha s + beta) / (s^2 + c s + k). What is searched for
are the zeros of

    D(s) = A(s) F(s),   A = product of s^2 + c_j s + k_j,   F = 1 + [K (1 - e^(-s tau)) + R s] G,

with K = C w and R the process damping. D has no poles; its logarithmic slope, from which a Newton
step follows, is A'/A + F'/F, and needs no polynomial of a degree that grows with the modes.
"""

from __future__ import annotations

import cmath

from lathe_chatter.array_types import Array
from lathe_chatter.compiled import compiled

ALPHA, BETA, DAMPING, STIFFNESS = range(4)
SECTION_SIZE = 4


@compiled(inline=True, borrows=True, inner=True)
def inverse(z: complex) -> complex:
    """1/z without a check for 0, which gives infinity."""
    size = z.real * z.real + z.imag * z.imag
    return complex(z.real / size, -z.imag / size)


@compiled(inline=True, borrows=True, inner=True)
def newton_step(
    sections: Array, modes: int, stiffness: float, damping: float, delay: float, s: complex
) -> complex:
    """D/D' at a point: what Newton's method goes back by."""
    total, slope, poles = 0j, 0j, 0j
    for j in range(modes):
        c = sections[j, DAMPING]
        per = inverse((s + c) * s + sections[j, STIFFNESS])
        steep = (2.0 * s + c) * per
        part = (sections[j, ALPHA] * s + sections[j, BETA]) * per
        total += part
        slope += sections[j, ALPHA] * per - part * steep
        poles += steep
    echo = stiffness * cmath.exp(-delay * s)
    force = stiffness - echo + damping * s
    value = 1.0 + force * total
    rise = (delay * echo + damping) * total + force * slope
    return value * inverse(poles * value + rise)


@compiled(inline=True, borrows=True, inner=True)
def receptance_at(sections: Array, modes: int, s: complex) -> complex:
    """G(s)."""
    total = 0j
    for j in range(modes):
        denominator = (s + sections[j, DAMPING]) * s + sections[j, STIFFNESS]
        total += (sections[j, ALPHA] * s + sections[j, BETA]) * inverse(denominator)
    return total
