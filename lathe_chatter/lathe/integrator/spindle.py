"""How the spindle turns: steps, ramps and sinusoidal variation of speed by one law.

    Omega(t) = n(t) (1 + A sin(2 pi psi)),   n' = slope,   psi' = variation frequency

In any units of angle and time; the inner loop has steps for both. The turned angle is its closed
integral, without cancellation for slow variation, so the regenerative delay is exact:
phi(t) - phi(t - tau) = 1 rev.
"""

from __future__ import annotations

import math

from lathe_chatter.compiled import compiled

_NEWTON_STEPS = 20


@compiled(borrows=True)
def speed_and_slope(
    base: float, slope: float, amplitude: float, phase: float, frequency: float
) -> tuple[float, float]:
    """Omega and dOmega/dt at phase `phase` (cycles) of the variation."""
    turn = 2.0 * math.pi * phase
    factor = 1.0 + amplitude * math.sin(turn)
    swing = amplitude * 2.0 * math.pi * frequency * math.cos(turn)
    return base * factor, slope * factor + base * swing


@compiled(borrows=True)
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
    middle = 2.0 * math.pi * phase + z
    z2 = z * z
    sinc = 1.0 - z2 / 6.0 * (
        1.0 - z2 / 20.0 * (1.0 - z2 / 42.0 * (1.0 - z2 / 72.0 * (1.0 - z2 / 110.0)))
    )
    if z > 0.3:
        sinc = math.sin(z) / z
    lever = 1.0 - z2 / 10.0 * (1.0 - z2 / 28.0 * (1.0 - z2 / 54.0 * (1.0 - z2 / 88.0)))
    if z > 0.3:
        lever = 3.0 * (math.sin(z) - z * math.cos(z)) / (z2 * z)
    mean = base + 0.5 * slope * time
    swing = mean * math.sin(middle) * sinc * time
    swing += slope * math.cos(middle) * lever * z * time * time / 6.0
    return even + amplitude * swing


@compiled(borrows=True)
def time_to_turn(
    angle: float, base: float, slope: float, amplitude: float, phase: float, frequency: float
) -> float:
    """Time in which the spindle turns `angle`, by Newton: `turned` is increasing."""
    start, _ = speed_and_slope(base, slope, amplitude, phase, frequency)
    time = angle / start
    for _ in range(_NEWTON_STEPS):
        miss = turned(time, base, slope, amplitude, phase, frequency) - angle
        speed, _ = speed_and_slope(
            base + slope * time, slope, amplitude, phase + frequency * time, frequency
        )
        time -= miss / speed
        if abs(miss) <= 1e-16 + 4e-16 * angle:
            break
    return time


@compiled(borrows=True)
def speed_curvature(
    base: float, slope: float, amplitude: float, phase: float, frequency: float
) -> float:
    """The second derivative of Omega by time at phase `phase` (cycles) of the variation."""
    turn, rate = 2.0 * math.pi * phase, 2.0 * math.pi * frequency
    return amplitude * rate * (2.0 * slope * math.cos(turn) - base * rate * math.sin(turn))
