"""How the spindle turns: steps, ramps and sinusoidal variation of speed by one law.

    Omega(t) = n(t) (1 + A sin(2 pi psi)),   n' = slope,   psi' = variation frequency

In any units of angle and time; the inner loop has steps for both. The turned angle is its closed
integral, without cancellation for slow variation, so the regenerative delay is exact:
phi(t) - phi(t - tau) = 1 rev.
"""

from __future__ import annotations

import math
from typing import Any

from lathe_chatter.compiled import compiled
from lathe_chatter.lathe.integrator.simd_vectors import chosen, floored, fma

_NEWTON_STEPS = 20
_NEARLY = 1e-8
"""A miss after which one more step of Newton's method leaves nothing."""
_S1, _S2, _S3, _S4, _S5, _S6, _S7 = (1.0 / math.factorial(2 * k + 1) for k in range(1, 8))
_C2, _C3, _C4, _C5, _C6, _C7, _C8 = (1.0 / math.factorial(2 * k) for k in range(2, 9))


@compiled(inline=True, borrows=True, inner=True)
def sine_and_cosine(turns: Any) -> tuple[Any, Any]:
    """Of an angle in turns, or of eight: by their series about the next quarter turn, to rounding.

    A library's functions have other last bits on another processor.
    """
    rest = turns - floored(turns + 0.5)
    quarter = floored(4.0 * rest + 0.5)
    x = 2.0 * math.pi * (rest - 0.25 * quarter)
    y = x * x
    sine = fma(y, fma(y, fma(y, fma(y, fma(y, fma(y, -_S7, _S6), -_S5), _S4), -_S3), _S2), -_S1)
    sine = fma(x * y, sine, x)
    cosine = fma(y, fma(y, fma(y, fma(y, fma(y, fma(y, _C8, -_C7), _C6), -_C5), _C4), -_C3), _C2)
    cosine = fma(y, fma(y, cosine, -0.5), 1.0)
    ahead, behind = quarter == 1.0, quarter == -1.0
    half, across = quarter * quarter == 4.0, ahead | behind
    sine, cosine = chosen(across, cosine, sine), chosen(across, sine, cosine)
    return chosen(half | behind, -sine, sine), chosen(half | ahead, -cosine, cosine)


@compiled(borrows=True, inner=True)
def speed_and_slope(
    base: float, slope: float, amplitude: float, phase: float, frequency: float
) -> tuple[float, float]:
    """Omega and dOmega/dt at phase `phase` (cycles) of the variation."""
    sine, cosine = sine_and_cosine(phase)
    factor = 1.0 + amplitude * sine
    swing = amplitude * 2.0 * math.pi * frequency * cosine
    return base * factor, slope * factor + base * swing


@compiled(borrows=True, inner=True)
def turned(
    time: float, base: float, slope: float, amplitude: float, phase: float, frequency: float
) -> float:
    """The angle turned in `time`.

    The variation is integrated about the middle of the interval: with z = omega time / 2,
    integral of sin = 2 sin(middle) sin(z) / omega, and the ramp adds
    slope cos(middle) 2 (sin z - z cos z) / omega^2, by its series.
    """
    even = base * time + 0.5 * slope * time * time
    if amplitude == 0.0:
        return even
    z = math.pi * frequency * time
    sine, cosine = sine_and_cosine(phase + 0.5 * frequency * time)
    z2 = z * z
    sine_z = cosine_z = 0.0
    sinc = 1.0 - z2 / 6.0 * (
        1.0 - z2 / 20.0 * (1.0 - z2 / 42.0 * (1.0 - z2 / 72.0 * (1.0 - z2 / 110.0)))
    )
    if z > 0.3:
        sine_z, cosine_z = sine_and_cosine(0.5 * frequency * time)
        sinc = sine_z / z
    lever = 1.0 - z2 / 10.0 * (1.0 - z2 / 28.0 * (1.0 - z2 / 54.0 * (1.0 - z2 / 88.0)))
    if z > 0.3:
        lever = 3.0 * (sine_z - z * cosine_z) / (z2 * z)
    mean = base + 0.5 * slope * time
    swing: float = mean * sine * sinc * time
    swing += slope * cosine * lever * z * time * time / 6.0
    return even + amplitude * swing


@compiled(borrows=True, inner=True)
def time_to_turn(
    angle: float, base: float, slope: float, amplitude: float, phase: float, frequency: float
) -> float:
    """Time in which the spindle turns `angle`, by Newton: `turned` is increasing."""
    speed, gain = speed_and_slope(base, slope, amplitude, phase, frequency)
    time = angle / (speed + 0.5 * gain * (angle / speed))
    for _ in range(_NEWTON_STEPS):
        miss = turned(time, base, slope, amplitude, phase, frequency) - angle
        speed, _ = speed_and_slope(
            base + slope * time, slope, amplitude, phase + frequency * time, frequency
        )
        time -= miss / speed
        if abs(miss) <= _NEARLY * angle:
            break
    return time


@compiled(borrows=True, inner=True)
def speed_curvature(
    base: float, slope: float, amplitude: float, phase: float, frequency: float
) -> float:
    """The second derivative of Omega by time at phase `phase` (cycles) of the variation."""
    rate = 2.0 * math.pi * frequency
    sine, cosine = sine_and_cosine(phase)
    swing: float = 2.0 * slope * cosine - base * rate * sine
    return amplitude * rate * swing
