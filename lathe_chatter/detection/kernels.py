"""The smooth kernels that turn thinned samples into band-passed signals and forces.

A measured signal is never differentiated: integrated by parts, the machine's equation falls on
the kernel, which is a cosine window of the fourth power on a complex carrier. Its second
derivative has no jump, so the sums over samples equal the integrals to 1e-5.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lathe_chatter.model import Array, Machine

Complex = NDArray[np.complex128]

BELOW, ABOVE = 0.78, 1.75
"""The band reaches from this times the lowest to this times the highest natural frequency."""
_HALF_WIDTHS = 2.62
"""Length times width, to half of the height, of the window's spectrum."""


class Band(NamedTuple):
    """Where chatter is looked for, Hz."""

    low: float
    high: float


class Kernels(NamedTuple):
    """What the thinned samples are multiplied by, the newest last (taps,) each.

    Attributes:
        band: The band pass; a vibration A cos gives |A| / 2 at the middle of the band.
        force: -(m_t s^2 + c_t s + k_t) of it: from the tool's displacement to the force, N.
        inertia: m_wp s^2 + c_wp s of it: from the workpiece's displacement, N.
    """

    band: Complex
    force: Complex
    inertia: Complex


def band_of(machine: Machine) -> Band:
    """The band that holds the chatter of a machine, open or seated."""
    seated = machine.workpiece_stiffness(seated=True) / machine.workpiece.mass
    tool, workpiece = machine.tool.natural_frequency, machine.workpiece.natural_frequency
    lowest, highest = min(tool, workpiece), max(tool, workpiece, math.sqrt(seated))
    return Band(BELOW * lowest / (2.0 * math.pi), ABOVE * highest / (2.0 * math.pi))


def design(band: Band, rate: float, machine: Machine | None) -> Kernels:
    """The kernels for thinned samples at `rate` Hz; without a machine the force is zero."""
    taps = max(8, math.ceil(_HALF_WIDTHS / (band.high - band.low) * rate))
    time = (np.arange(taps) + 0.5 - 0.5 * taps) / rate
    pi_by_length = math.pi * rate / taps
    omega = math.pi * (band.low + band.high)
    cos, sin = np.cos(pi_by_length * time), np.sin(pi_by_length * time)
    window = cos**4
    slope = -4.0 * pi_by_length * cos**3 * sin
    curvature = -4.0 * pi_by_length**2 * (cos**4 - 3.0 * cos**2 * sin**2)
    carrier = np.exp(-1j * omega * time) / window.sum()
    zeroth = window * carrier
    first = -(slope - 1j * omega * window) * carrier
    second = (curvature - 2j * omega * slope - omega**2 * window) * carrier
    if machine is None:
        return Kernels(zeroth, np.zeros_like(zeroth), np.zeros_like(zeroth))
    tool, workpiece = machine.tool, machine.workpiece
    return Kernels(
        zeroth,
        -(tool.mass * second + tool.damping * first + tool.stiffness * zeroth),
        workpiece.mass * second + workpiece.damping * first,
    )


def gain(band: Band, rate: float, taps: int, frequency: float) -> float:
    """What the band pass leaves of a vibration of a frequency, 1 at the middle of the band."""
    window: Array = np.cos(math.pi * (np.arange(taps) + 0.5 - 0.5 * taps) / taps) ** 4
    time = (np.arange(taps) + 0.5 - 0.5 * taps) / rate
    off = 2.0 * math.pi * (frequency - 0.5 * (band.low + band.high))
    return float(window @ np.cos(off * time) / window.sum())
