"""The cut identified in windows of several lengths, and the growth rate that follows from it.

Two least squares of one unknown each: C w from F_u = C w q, and the stiffness k that carries
the workpiece from F_u - m_wp u'' - c_wp u' = k u, both in the band and free of everything
periodic. The rightmost root of the characteristic equation with these two numbers is the growth
rate; its derivatives carry their standard errors over. Windows end now and differ in length:
after a change of the cut the short ones know the new values at once.
"""

from __future__ import annotations

import math

import numpy as np

from lathe_chatter.compiled import compiled
from lathe_chatter.detection.signals import (
    CHIP_CHIP,
    FORCE_CHIP,
    FORCE_FORCE,
    OUTPUTS,
    PRODUCTS_SIZE,
    PULL_PULL,
    PULL_WORKPIECE,
    RELATIVE_POWER,
    TOOL_POWER,
    WORKPIECE_WORKPIECE,
)
from lathe_chatter.model import Array, Integers, Machine

# What is known from one window.
(
    CUTTING,
    CUTTING_ERROR,
    STIFFNESS,
    STIFFNESS_ERROR,
    GROWTH,
    GROWTH_ERROR,
    ANGULAR_FREQUENCY,
    WINDOW_RELATIVE_POWER,
    WINDOW_TOOL_POWER,
    WINDOW_OUTPUTS,
    WINDOW_SIZE,
) = range(11)

# The numbers of a machine that the compiled functions take.
(
    TOOL_MASS,
    TOOL_DAMPING,
    TOOL_STIFFNESS,
    WORKPIECE_MASS,
    WORKPIECE_DAMPING,
    SOFTEST,
    STIFFEST,
    LOW,
    HIGH,
    MECHANICS_SIZE,
) = range(11 - 1)

_MOST_SEEDS = 32
_STEP_LIMIT = 60.0
"""Largest Newton step, 1/s: no leap into another lobe."""


def mechanics_of(machine: Machine, low: float, high: float) -> Array:
    """A machine as numbers; the stiffness of the workpiece may be 20 % off (MECHANICS_SIZE,)."""
    tool, workpiece = machine.tool, machine.workpiece
    numbers = np.empty(MECHANICS_SIZE)
    numbers[:5] = tool.mass, tool.damping, tool.stiffness, workpiece.mass, workpiece.damping
    numbers[SOFTEST] = 0.8 * machine.workpiece_stiffness(seated=False)
    numbers[STIFFEST] = 1.2 * machine.workpiece_stiffness(seated=True)
    numbers[LOW], numbers[HIGH] = 2.0 * math.pi * low, 2.0 * math.pi * high
    return numbers


@compiled()
def characteristic(
    mechanics: Array, cutting: float, stiffness: float, delay: float, s: complex
) -> tuple[complex, complex, complex, complex]:
    """D(s) = T W + C w (1 - e^(-s tau)) (T + W) and its derivatives by s, C w and k."""
    tool = (mechanics[TOOL_MASS] * s + mechanics[TOOL_DAMPING]) * s + mechanics[TOOL_STIFFNESS]
    workpiece = (mechanics[WORKPIECE_MASS] * s + mechanics[WORKPIECE_DAMPING]) * s + stiffness
    tool_slope = 2.0 * mechanics[TOOL_MASS] * s + mechanics[TOOL_DAMPING]
    workpiece_slope = 2.0 * mechanics[WORKPIECE_MASS] * s + mechanics[WORKPIECE_DAMPING]
    echo = np.exp(-s * delay)
    both = tool + workpiece
    slope = tool_slope * workpiece + tool * workpiece_slope
    slope += cutting * ((1.0 - echo) * (tool_slope + workpiece_slope) + delay * echo * both)
    value = tool * workpiece + cutting * (1.0 - echo) * both
    return value, slope, (1.0 - echo) * both, tool + cutting * (1.0 - echo)


@compiled()
def root_near(
    mechanics: Array, cutting: float, stiffness: float, delay: float, guess: complex
) -> complex:
    """Newton's method from a guess; nan where it does not converge or leaves the band."""
    s = guess
    for _ in range(12):
        value, slope, _, _ = characteristic(mechanics, cutting, stiffness, delay, s)
        step = value / slope
        length = abs(step)
        if length > _STEP_LIMIT:
            step *= _STEP_LIMIT / length
        s -= step
        if length < 1e-6 * abs(s):
            if 0.5 * mechanics[LOW] < s.imag < 2.0 * mechanics[HIGH]:
                return s
            break
    return complex(np.nan, np.nan)


@compiled()
def rightmost_in_band(
    mechanics: Array, cutting: float, stiffness: float, delay: float, guess: complex
) -> complex:
    """The rightmost root that the guess and seeds all over the band lead to; the guess if none.

    The roots of a delay stand 1/tau apart along the imaginary axis; at speeds so low that
    more would be needed their real parts differ little from one to the next.
    """
    low, high = mechanics[LOW], mechanics[HIGH]
    count = min(_MOST_SEEDS, max(4, int(delay * (high - low) / math.pi) + 2))
    best = root_near(mechanics, cutting, stiffness, delay, guess)
    for i in range(count):
        seed = complex(0.0, low + (high - low) * i / (count - 1))
        s = root_near(mechanics, cutting, stiffness, delay, seed)
        if s.real > best.real or (best.real != best.real and s.real == s.real):
            best = s
    return best if best.real == best.real else guess


@compiled()
def identify(
    products: Array, newest: int, lengths: Integers, mechanics: Array, figures: Array,
    guess: complex, windows: Array,
) -> None:  # fmt: skip
    """What every window says.

    Args:
        products: Of the last hops (hops, PRODUCTS_SIZE), as a ring.
        newest: Where the newest stands.
        lengths: Of the windows, hops, rising (windows,).
        mechanics: From `mechanics_of`.
        figures: Delay, s; independent real numbers in an output; smallest mean square of the
            errors of force and pull, N2 (4,).
        guess: The rightmost root for a similar cut, 1/s.
        windows: Written (windows, WINDOW_SIZE); nan where unknown.
    """
    delay, independent = figures[0], figures[1]
    total = np.zeros(PRODUCTS_SIZE)
    done = 0
    for number in range(lengths.size):
        while done < lengths[number]:
            total += products[(newest - done) % products.shape[0]]
            done += 1
        known = windows[number]
        known[:] = np.nan
        count = total[OUTPUTS]
        known[WINDOW_OUTPUTS] = count
        if count < 2.0:
            continue
        known[WINDOW_RELATIVE_POWER] = total[RELATIVE_POWER] / count
        known[WINDOW_TOOL_POWER] = total[TOOL_POWER] / count
        if total[CHIP_CHIP] <= 0.0 or total[WORKPIECE_WORKPIECE] <= 0.0:
            continue
        cutting = total[FORCE_CHIP] / total[CHIP_CHIP]
        stiffness = total[PULL_WORKPIECE] / total[WORKPIECE_WORKPIECE]
        misfit = (total[FORCE_FORCE] - cutting * total[FORCE_CHIP]) / count
        cutting_variance = max(misfit, figures[2]) / (independent * total[CHIP_CHIP])
        misfit = (total[PULL_PULL] - stiffness * total[PULL_WORKPIECE]) / count
        stiffness_variance = max(misfit, figures[3]) / (independent * total[WORKPIECE_WORKPIECE])
        known[CUTTING], known[CUTTING_ERROR] = cutting, math.sqrt(cutting_variance)
        known[STIFFNESS], known[STIFFNESS_ERROR] = stiffness, math.sqrt(stiffness_variance)
        cutting = max(cutting, 0.0)
        stiffness = min(max(stiffness, mechanics[SOFTEST]), mechanics[STIFFEST])
        s = root_near(mechanics, cutting, stiffness, delay, guess)
        _, slope, by_cutting, by_stiffness = characteristic(
            mechanics, cutting, stiffness, delay, s
        )
        variance = cutting_variance * (by_cutting / slope).real ** 2
        variance += stiffness_variance * (by_stiffness / slope).real ** 2
        known[GROWTH], known[GROWTH_ERROR] = s.real, math.sqrt(variance)
        known[ANGULAR_FREQUENCY] = s.imag
