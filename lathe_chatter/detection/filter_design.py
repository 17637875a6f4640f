"""The smooth kernels that turn thinned samples into band-passed signals and forces.

A measured signal is never differentiated: integrated by parts, the machine's equation falls on
the kernel, which is a cosine window of the fourth power on a complex carrier. Its second
derivative has no jump, so the sums over samples equal the integrals to 1e-5. The band is wide:
where a kernel is as narrow as the resonance, the random force and the vibration that follows
from it are correlated within it, and C w comes out up to 40 % wrong in a quiet cut.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lathe_chatter.array_types import Array
from lathe_chatter.model import Machine

Complex = NDArray[np.complex128]

BELOW, ABOVE = 0.78, 1.75
"""Chatter is looked for from this times the lowest to this times the highest frequency."""
_WIDE_BELOW, _WIDE_ABOVE = 0.25, 2.2
"""The same for the band in which force and chip are compared."""
_HALF_WIDTHS = 2.62
"""Length times width, to half of the height, of the window's spectrum."""
_BIN_SPACING = 0.05
"""Distance of the resonators, as a fraction of the middle of their band."""
_RATES_PER_WIDTH = 9.0


class Band(NamedTuple):
    """A range of frequencies, Hz."""

    low: float
    high: float

    @property
    def middle(self) -> float:
        """Hz."""
        return 0.5 * (self.low + self.high)


UNKNOWN_MACHINE = Band(20.0, 5000.0)
"""Where chatter is looked for on a machine of which nothing is known."""
HIGHEST_SEEN = 0.45
"""Of the sample rate: no vibration above is told from one below."""
_WIDEST = 5.0
"""Highest over lowest frequency of a band that is judged by itself."""
_USUAL_MIDDLE, _SLOWEST, _FASTEST = 170.0, 4.0, 0.125
"""Middle of a band, Hz, in which the usual times hold, and how much longer and shorter they may
become elsewhere: what chatters at ten times the frequency grows ten times as fast."""


class Kernels(NamedTuple):
    """What the thinned samples are multiplied by, the newest last (taps,) each.

    Attributes:
        band: The band pass, without response to a constant; a vibration A cos gives |A| / 2 at
            the middle of the band.
        slope: Its first derivative, 1/s.
        force: -(m_t s^2 + c_t s + k_t) of it: from the tool's displacement to the force, N.
        inertia: m_wp s^2 + c_wp s of it: from the workpiece's displacement, N.
        spill: What white noise of unit variance in the thinned samples adds to the sums:
            correlations of the kernels at lags -taps..taps (SPILLS, 2 taps + 1).
        poles: Of the resonators, per thinned sample (bins,).
    """

    band: Complex
    slope: Complex
    force: Complex
    inertia: Complex
    spill: Array
    poles: Complex


# Rows of `Kernels.spill`.
BAND_BAND, FORCE_BAND, FORCE_FORCE, INERTIA_BAND, SPILLS = range(5)


def pace_of(band: Band) -> float:
    """How many times as long as usual everything takes in a band, a power of two."""
    octaves = round(math.log2(_USUAL_MIDDLE / band.middle))
    return min(max(2.0**octaves, _FASTEST), _SLOWEST)


def bands_of(whole: Band) -> list[Band]:
    """The bands into which a wide one is divided, each with its own pace; one if it is narrow."""
    ratio = whole.high / whole.low
    count = max(1, math.ceil(math.log(ratio) / math.log(_WIDEST)))
    edges = [whole.low * ratio ** (k / count) for k in range(count + 1)]
    return [Band(low, high) for low, high in itertools.pairwise(edges)]


def band_of(machine: Machine) -> Band:
    """The band that holds the chatter of a machine, open or seated."""
    lowest, highest = _frequencies(machine)
    return Band(BELOW * lowest, ABOVE * highest)


def _frequencies(machine: Machine) -> tuple[float, float]:
    """Lowest and highest natural frequency, open or seated, Hz."""
    seated = machine.workpiece_stiffness(seated=True) / machine.workpiece.mass
    tool, workpiece = machine.tool.natural_frequency, machine.workpiece.natural_frequency
    turn = 2.0 * math.pi
    return min(tool, workpiece) / turn, max(tool, workpiece, math.sqrt(seated)) / turn


def design(machine: Machine | None, rate: float, decay: float, chatter: Band) -> Kernels:
    """The kernels for thinned samples at `rate` Hz; without a machine the force is zero.

    Args:
        machine: Tool, workpiece and bearing, or None.
        rate: Of the thinned samples, Hz.
        decay: Of the resonators, 1/s.
        chatter: Where chatter is looked for.
    """
    wide = chatter
    if machine is not None:
        lowest, highest = _frequencies(machine)
        wide = Band(_WIDE_BELOW * lowest, _WIDE_ABOVE * highest)
    taps = max(8, math.ceil(_HALF_WIDTHS / (wide.high - wide.low) * rate))
    time = (np.arange(taps) + 0.5 - 0.5 * taps) / rate
    pi_by_length = math.pi * rate / taps
    omega = 2.0 * math.pi * wide.middle
    cos, sin = np.cos(pi_by_length * time), np.sin(pi_by_length * time)
    window = cos**4
    slope = -4.0 * pi_by_length * cos**3 * sin
    curvature = -4.0 * pi_by_length**2 * (cos**4 - 3.0 * cos**2 * sin**2)
    wave = np.exp(-1j * omega * time)
    constant = (window @ wave) / window.sum()
    scale = 1.0 / window.sum()
    zeroth = scale * window * (wave - constant)
    first = -scale * (slope * (wave - constant) - 1j * omega * window * wave)
    second = scale * (
        curvature * (wave - constant) - (2j * omega * slope + omega**2 * window) * wave
    )
    force = inertia = np.zeros_like(zeroth)
    if machine is not None:
        tool, workpiece = machine.tool, machine.workpiece
        force = -(tool.mass * second + tool.damping * first + tool.stiffness * zeroth)
        inertia = workpiece.mass * second + workpiece.damping * first
    spill = np.array(
        [
            _correlation(one, other)
            for one, other in (
                (zeroth, zeroth),
                (force, zeroth),
                (force, force),
                (inertia, zeroth),
            )
        ]
    )
    count = 1 + math.ceil((chatter.high - chatter.low) / (_BIN_SPACING * chatter.middle))
    bins = np.linspace(chatter.low, chatter.high, count)
    return Kernels(
        zeroth, first, force, inertia, spill, np.exp((-decay + 2j * np.pi * bins) / rate)
    )


def thinning_of(band: Band, rate: float) -> tuple[int, int]:
    """Samples in a thinned sample, and thinned samples in an output, at a sample rate, Hz."""
    thinning = max(1, int(rate / (_RATES_PER_WIDTH * band.high)))
    return thinning, max(1, round(rate / thinning / (2.25 * band.high)))


def _correlation(one: Complex, other: Complex) -> Array:
    """Re sum one[i + lag] other*[i] for lags -taps..taps."""
    full = np.zeros(2 * one.size + 1)
    full[1:-1] = np.correlate(one, other, 'full').real
    return full


def gain(kernels: Kernels, rate: float, frequency: float) -> float:
    """What the band pass leaves of a vibration of a frequency, 1 in the middle of the band."""
    time = np.arange(kernels.band.size) / rate
    return float(abs(kernels.band @ np.exp(2j * np.pi * frequency * time)))
