"""The cut identified in windows of several lengths, and the growth rate that follows from it.

Two least squares of one unknown each: C w from F = C w h, and the stiffness k that carries the
workpiece from F_u - m_wp u'' - c_wp u' = k u, both in the band, what the noise of the sensors
adds to the sums taken off. The rightmost root of the characteristic equation with these two
numbers is the growth rate; its derivatives carry their standard errors over. Windows end now
and differ in length: after a change of the cut the short ones know the new values at once.
"""

from __future__ import annotations

import math

import numpy as np

from lathe_chatter.arrays import Array, Integers
from lathe_chatter.compiled import compiled
from lathe_chatter.detection.kernels import BAND_BAND, FORCE_BAND, INERTIA_BAND
from lathe_chatter.detection.kernels import FORCE_FORCE as SPILL_FORCE
from lathe_chatter.detection.signals import (
    CHIP_CHIP,
    FORCE_CHIP,
    FORCE_FORCE,
    OUTPUTS,
    PRODUCTS_SIZE,
    PULL_PULL,
    PULL_WORKPIECE,
    TOOL_POWER,
    WORKPIECE_WORKPIECE,
)
from lathe_chatter.model import Machine

# What is known from one window.
(
    CUTTING,
    CUTTING_ERROR,
    STIFFNESS,
    STIFFNESS_ERROR,
    GROWTH,
    GROWTH_ERROR,
    ANGULAR_FREQUENCY,
    CLEARNESS,
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
) = range(10)

# What the noise of the sensors adds to the sums of one output.
(
    NOISE_FORCE,
    NOISE_FORCE_CHIP,
    NOISE_CHIP,
    NOISE_PULL_WORKPIECE,
    NOISE_WORKPIECE,
    NOISE_SIZE,
) = range(6)

_MOST_SEEDS = 32
_STEP_LIMIT = 60.0
"""Largest Newton step, 1/s: no leap into another lobe."""
_LIKELY = 2.0
"""Standard errors within which C w may well be."""
_CORRELATION = 1.2
"""Variance of a sum over outputs that overlap, over what independent ones would have; checked
by `python benchmarks/detection check`."""
_USUAL = 50.0
"""Outputs that the usual misfit counts for beside a window's own."""
_LEAST = 0.1
"""Part of a sum that the noise of the sensors leaves at least."""
_MODEL_ERROR = 1e-3
"""Misfit of a machine that is known to three digits, as a part of the force."""
_REFERENCE = 2
_AGREEMENT = 4.0
"""Standard errors within which a longer window tells the same stiffness."""


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
def _at(row: Array, lag: float) -> float:
    """A correlation at a lag between samples."""
    middle = row.size // 2
    if abs(lag) >= middle - 1:
        return 0.0
    place = int(np.floor(lag + middle))
    x = lag + middle - place
    value: float = (1.0 - x) * row[place] + x * row[place + 1]
    return value


@compiled()
def noise_sums(spill: Array, tool: float, workpiece: float, turn: float, noise: Array) -> None:
    """What white noise of the thinned samples adds to the sums of one output.

    Args:
        spill: From `kernels.Kernels`.
        tool: Variance of the noise of the tool's thinned samples, m2.
        workpiece: The same of the workpiece.
        turn: Thinned samples a turn.
        noise: Written (NOISE_SIZE,).
    """
    change = 2.0 * (_at(spill[BAND_BAND], 0.0) - _at(spill[BAND_BAND], turn))
    noise[NOISE_FORCE] = tool * _at(spill[SPILL_FORCE], 0.0)
    noise[NOISE_FORCE_CHIP] = tool * (_at(spill[FORCE_BAND], 0.0) - _at(spill[FORCE_BAND], -turn))
    noise[NOISE_CHIP] = (tool + workpiece) * change
    noise[NOISE_WORKPIECE] = workpiece * change
    row = spill[INERTIA_BAND]
    change = 2.0 * _at(row, 0.0) - _at(row, turn) - _at(row, -turn)
    noise[NOISE_PULL_WORKPIECE] = -workpiece * change


@compiled()
def _fit(
    cross: float, square: float, target: float, noise_cross: float, noise_square: float,
    count: float, usual: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Slope, its standard error and what part of the square is no noise, by least squares.

    Args:
        cross: Sum of products.
        square: Sum of squares of what is known.
        target: Sum of squares of what is fitted.
        noise_cross: What noise adds to `cross`.
        noise_square: What noise adds to `square`.
        count: Outputs.
        usual: Mean square misfit in quiet cutting, nan where unknown.
    """
    clear = max(square - noise_square, _LEAST * square)
    slope = (cross - noise_cross) / clear
    misfit = max(target - 2.0 * slope * cross + slope * slope * square, 0.0)
    if usual == usual:
        misfit = (misfit + _USUAL * usual) / (count + _USUAL)
    else:
        misfit /= max(count - 4.0, 1.0)
    misfit += _MODEL_ERROR * target / count / math.sqrt(count)
    error = math.sqrt(_CORRELATION * misfit * square) / clear
    return slope, error, clear / square


@compiled()
def identify(
    products: Array, newest: int, lengths: Integers, mechanics: Array, noise: Array,
    figures: Array, guess: complex, deeper: complex, windows: Array,
) -> None:  # fmt: skip
    """What every window says.

    Args:
        products: Of the last hops (hops, PRODUCTS_SIZE), as a ring.
        newest: Where the newest stands.
        lengths: Of the windows, hops, rising (windows,).
        mechanics: From `mechanics_of`.
        noise: From `noise_sums`.
        figures: Delay, s; mean square misfit of the force in quiet cutting, N2, or nan; and of
            a similar cut C w and k, N/m (4,).
        guess: The rightmost root for the similar cut, 1/s.
        deeper: That of a deeper one, which may be of another mode: both are followed.
        windows: Written (windows, WINDOW_SIZE); nan where unknown.
    """
    delay, usual = figures[0], figures[1]
    _, slope, by_cutting, by_stiffness = characteristic(
        mechanics, figures[2], figures[3], delay, guess
    )
    usual_slopes = abs((by_cutting / slope).real), abs((by_stiffness / slope).real)
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
        known[WINDOW_TOOL_POWER] = total[TOOL_POWER] / count
        if total[CHIP_CHIP] <= 0.0 or total[WORKPIECE_WORKPIECE] <= 0.0:
            continue
        known[CUTTING], known[CUTTING_ERROR], known[CLEARNESS] = _fit(
            total[FORCE_CHIP], total[CHIP_CHIP], total[FORCE_FORCE],
            count * noise[NOISE_FORCE_CHIP], count * noise[NOISE_CHIP], count, usual,
        )  # fmt: skip
        known[STIFFNESS], known[STIFFNESS_ERROR], _ = _fit(
            total[PULL_WORKPIECE], total[WORKPIECE_WORKPIECE], total[PULL_PULL],
            count * noise[NOISE_PULL_WORKPIECE], count * noise[NOISE_WORKPIECE], count, np.nan,
        )  # fmt: skip
    # The stiffness seldom changes: the longest window that agrees with a short one knows it best.
    short, short_error = windows[_REFERENCE, STIFFNESS], windows[_REFERENCE, STIFFNESS_ERROR]
    for number in range(lengths.size):
        known = windows[number]
        if known[CUTTING] != known[CUTTING]:
            continue
        stiffness, error = known[STIFFNESS], known[STIFFNESS_ERROR]
        for longer in range(lengths.size - 1, number, -1):
            other = windows[longer]
            if abs(other[STIFFNESS] - short) < _AGREEMENT * (other[STIFFNESS_ERROR] + short_error):
                stiffness, error = other[STIFFNESS], other[STIFFNESS_ERROR]
                break
        cutting = max(known[CUTTING], 0.0)
        stiffness = min(max(stiffness, mechanics[SOFTEST]), mechanics[STIFFEST])
        s = root_near(mechanics, cutting, stiffness, delay, guess)
        if not s.real > 0.0:
            other = root_near(mechanics, cutting, stiffness, delay, deeper)
            if other.real > s.real or s.real != s.real:
                s = other
        _, slope, by_cutting, by_stiffness = characteristic(
            mechanics, cutting, stiffness, delay, s
        )
        # Far off the curve is flat, and would make a wild value look sure.
        of_cutting = max(abs((by_cutting / slope).real), usual_slopes[0])
        of_stiffness = max(abs((by_stiffness / slope).real), usual_slopes[1])
        by_cutting_error = known[CUTTING_ERROR] * of_cutting
        if s.real > 0.0:
            # Growth flattens with C w; what is sure is how much less the least likely C w gives.
            least = max(cutting - _LIKELY * known[CUTTING_ERROR], 0.0)
            lower = root_near(mechanics, least, stiffness, delay, s)
            if lower.real == lower.real:
                by_cutting_error = max(by_cutting_error, (s.real - lower.real) / _LIKELY)
        variance = by_cutting_error**2 + (error * of_stiffness) ** 2
        known[STIFFNESS], known[STIFFNESS_ERROR] = stiffness, error
        known[GROWTH], known[GROWTH_ERROR] = s.real, math.sqrt(variance)
        known[ANGULAR_FREQUENCY] = s.imag
