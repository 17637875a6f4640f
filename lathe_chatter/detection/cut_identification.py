"""The cut identified in windows of several lengths, and the growth rate that follows from it.

Two least squares of one unknown each: C w from F = C w h, and the stiffness k that carries the
workpiece from F_u - m_wp u'' - c_wp u' = k u, both in the band, what the noise of the sensors
adds to the sums taken off. The rightmost root of the characteristic equation with these two
numbers is the growth rate; its derivatives carry their standard errors over. Windows end now
and differ in length: after a change of the cut the short ones know the new values at once.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from lathe_chatter.array_types import Array, Integers
from lathe_chatter.compiled import compiled
from lathe_chatter.detection.filter_design import BAND_BAND, FORCE_BAND, INERTIA_BAND
from lathe_chatter.detection.filter_design import FORCE_FORCE as SPILL_FORCE
from lathe_chatter.detection.signal_conditioning import add, clear
from lathe_chatter.detection.structured_arrays import Records, record, record_type
from lathe_chatter.model import Machine

FIT = record_type(
    """
    cutting cutting_error stiffness stiffness_error growth growth_error angular_frequency
    clearness tool_power outputs
    """,
    'length',
)
"""What one window knows, nan where unknown."""
_MECHANICS = record_type(
    'tool_mass tool_damping tool_stiffness workpiece_mass workpiece_damping '
    'softest stiffest low high'
)
NOISE_SUMS = record_type('force force_chip chip pull_workpiece workpiece')
"""What the noise of the sensors adds to the sums of one output."""

_MOST_SEEDS = 32
_DOUBLINGS, _HALVINGS = 6, 10
"""Of C w, to find where it becomes unstable."""
_STEP_LIMIT = 60.0
"""Largest Newton step, 1/s: no leap into another lobe."""
_LIKELY = 2.0
"""Standard errors within which C w may well be."""
_CORRELATION = 1.2
"""Variance of a sum over outputs that overlap, over the mean square of both parts of a misfit, of
which independent ones would have half; found by simulation."""
_USUAL = 50.0
"""Outputs that the usual misfit counts for beside a window's own."""
_LEAST = 0.1
"""Part of a sum that the noise of the sensors leaves at least."""
_MODEL_ERROR = 1e-3
"""Misfit of a machine that is known to three digits, as a part of the force."""
_REFERENCE = 2
_AGREEMENT = 4.0
"""Standard errors within which a longer window tells the same stiffness."""


def mechanics_of(machine: Machine, low: float, high: float) -> Records:
    """A machine as one record; the stiffness of the workpiece may be 20 % off."""
    tool, workpiece = machine.tool, machine.workpiece
    return record(
        _MECHANICS,
        tool_mass=tool.mass,
        tool_damping=tool.damping,
        tool_stiffness=tool.stiffness,
        workpiece_mass=workpiece.mass,
        workpiece_damping=workpiece.damping,
        softest=0.8 * machine.workpiece_stiffness(seated=False),
        stiffest=1.2 * machine.workpiece_stiffness(seated=True),
        low=2.0 * math.pi * low,
        high=2.0 * math.pi * high,
    )


@compiled(borrows=True, inner=True)
def forget(fit: Any) -> None:
    """Nothing known."""
    fit.cutting = fit.cutting_error = fit.stiffness = fit.stiffness_error = np.nan
    fit.growth = fit.growth_error = fit.angular_frequency = fit.clearness = np.nan
    fit.tool_power = fit.outputs = np.nan


@compiled(borrows=True, inner=True)
def characteristic(
    mechanics: Any, cutting: float, stiffness: float, delay: float, s: complex
) -> tuple[complex, complex, complex, complex]:
    """D(s) = T W + C w (1 - e^(-s tau)) (T + W) and its derivatives by s, C w and k."""
    tool = (mechanics.tool_mass * s + mechanics.tool_damping) * s + mechanics.tool_stiffness
    workpiece = (mechanics.workpiece_mass * s + mechanics.workpiece_damping) * s + stiffness
    tool_slope = 2.0 * mechanics.tool_mass * s + mechanics.tool_damping
    workpiece_slope = 2.0 * mechanics.workpiece_mass * s + mechanics.workpiece_damping
    echo = np.exp(-s * delay)
    both = tool + workpiece
    slope = tool_slope * workpiece + tool * workpiece_slope
    slope += cutting * ((1.0 - echo) * (tool_slope + workpiece_slope) + delay * echo * both)
    value = tool * workpiece + cutting * (1.0 - echo) * both
    return value, slope, (1.0 - echo) * both, tool + cutting * (1.0 - echo)


@compiled(borrows=True, inner=True)
def root_near(
    mechanics: Any, cutting: float, stiffness: float, delay: float, guess: complex
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
            if 0.5 * mechanics.low < s.imag < 2.0 * mechanics.high:
                return s
            break
    return complex(np.nan, np.nan)


@compiled(borrows=True, inner=True)
def rightmost_in_band(
    mechanics: Any, cutting: float, stiffness: float, delay: float, guess: complex
) -> complex:
    """The rightmost root that the guess and seeds all over the band lead to; the guess if none.

    The roots of a delay stand 1/tau apart along the imaginary axis; at speeds so low that
    more would be needed their real parts differ little from one to the next.
    """
    low, high = mechanics.low, mechanics.high
    count = min(_MOST_SEEDS, max(4, int(delay * (high - low) / math.pi) + 2))
    best = root_near(mechanics, cutting, stiffness, delay, guess)
    for i in range(count):
        seed = complex(0.0, low + (high - low) * i / (count - 1))
        s = root_near(mechanics, cutting, stiffness, delay, seed)
        if s.real > best.real or (best.real != best.real and s.real == s.real):
            best = s
    return best if best.real == best.real else guess


@compiled()
def cutting_limit(
    mechanics_: Records, cutting: float, stiffness: float, delay: float, guess: complex
) -> float:
    """The C w at which a cut like this one becomes unstable, N/m; nan where none is found."""
    mechanics = mechanics_[0]
    stiffness = min(max(stiffness, mechanics.softest), mechanics.stiffest)
    low, high = 0.0, cutting
    for _ in range(_DOUBLINGS):
        if rightmost_in_band(mechanics, high, stiffness, delay, guess).real > 0.0:
            break
        low, high = high, 2.0 * high
    if low >= 2.0 ** (_DOUBLINGS - 1) * cutting:
        return np.nan
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if rightmost_in_band(mechanics, middle, stiffness, delay, guess).real > 0.0:
            high = middle
        else:
            low = middle
    return low


@compiled(borrows=True, inner=True)
def _at(row: Array, lag: float) -> float:
    """A correlation at a lag between samples."""
    middle = row.size // 2
    if abs(lag) >= middle - 1:
        return 0.0
    place = int(np.floor(lag + middle))
    x = lag + middle - place
    value: float = (1.0 - x) * row[place] + x * row[place + 1]
    return value


@compiled(borrows=True, inner=True)
def noise_sums(spill: Array, tool: float, workpiece: float, turn: float, noise: Any) -> None:
    """What white noise of the thinned samples adds to the sums of one output.

    Args:
        spill: From `filter_design.Kernels`.
        tool: Variance of the noise of the tool's thinned samples, m2.
        workpiece: The same of the workpiece.
        turn: Thinned samples a turn.
        noise: A record of `NOISE_SUMS`, written.
    """
    change = 2.0 * (_at(spill[BAND_BAND], 0.0) - _at(spill[BAND_BAND], turn))
    noise.force = tool * _at(spill[SPILL_FORCE], 0.0)
    noise.force_chip = tool * (_at(spill[FORCE_BAND], 0.0) - _at(spill[FORCE_BAND], -turn))
    noise.chip = (tool + workpiece) * change
    noise.workpiece = workpiece * change
    row = spill[INERTIA_BAND]
    change = 2.0 * _at(row, 0.0) - _at(row, turn) - _at(row, -turn)
    noise.pull_workpiece = -workpiece * change


@compiled(borrows=True, inner=True)
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


@compiled(borrows=True, inner=True)
def identify(
    products: Records, newest: int, lengths: Integers, mechanics: Any, noise: Any,
    delay: float, now: Any, total: Any, windows: Records,
) -> None:  # fmt: skip
    """What every window says.

    Args:
        products: Sums of the last hops (hops,), as a ring.
        newest: Where the newest stands.
        lengths: Of the windows, hops, rising (windows,).
        mechanics: From `mechanics_of`.
        noise: From `noise_sums`.
        delay: Of a turn, s.
        now: Of the `DetectorState`: mean square misfit of the force in quiet cutting; C w, k and
            rightmost root of a similar cut, and the root of a deeper one, which may be of another
            mode: both are followed.
        total: A record of `HOP_SUMS` to work in.
        windows: Written (windows,); nan where unknown.
    """
    _, slope, by_cutting, by_stiffness = characteristic(
        mechanics, now.root_cutting, now.root_stiffness, delay, now.root
    )
    usual_slopes = abs((by_cutting / slope).real), abs((by_stiffness / slope).real)
    clear(total)
    done = 0
    for number in range(lengths.size):
        while done < lengths[number]:
            add(total, products[(newest - done) % products.shape[0]])
            done += 1
        known = windows[number]
        forget(known)
        count = total.outputs
        known.outputs, known.length = count, lengths[number]
        if count < 2.0:
            continue
        known.tool_power = total.tool_power / count
        if total.chip_chip <= 0.0 or total.workpiece_workpiece <= 0.0:
            continue
        known.cutting, known.cutting_error, known.clearness = _fit(
            total.force_chip, total.chip_chip, total.force_force,
            count * noise.force_chip, count * noise.chip, count,
            now.usual_misfit,
        )  # fmt: skip
        known.stiffness, known.stiffness_error, _ = _fit(
            total.pull_workpiece, total.workpiece_workpiece, total.pull_pull,
            count * noise.pull_workpiece, count * noise.workpiece, count, np.nan,
        )  # fmt: skip
    # The stiffness seldom changes: the longest window that agrees with a short one knows it best.
    short, short_error = windows[_REFERENCE].stiffness, windows[_REFERENCE].stiffness_error
    for number in range(lengths.size):
        known = windows[number]
        if known.cutting != known.cutting:
            continue
        stiffness, error = known.stiffness, known.stiffness_error
        for longer in range(lengths.size - 1, number, -1):
            other = windows[longer]
            if abs(other.stiffness - short) < _AGREEMENT * (other.stiffness_error + short_error):
                stiffness, error = other.stiffness, other.stiffness_error
                break
        cutting = max(known.cutting, 0.0)
        stiffness = min(max(stiffness, mechanics.softest), mechanics.stiffest)
        s = root_near(mechanics, cutting, stiffness, delay, now.root)
        if not s.real > 0.0:
            other = root_near(mechanics, cutting, stiffness, delay, now.deeper_root)
            if other.real > s.real or s.real != s.real:
                s = other
        _, slope, by_cutting, by_stiffness = characteristic(
            mechanics, cutting, stiffness, delay, s
        )
        # Far off the curve is flat, and would make a wild value look sure.
        of_cutting = max(abs((by_cutting / slope).real), usual_slopes[0])
        of_stiffness = max(abs((by_stiffness / slope).real), usual_slopes[1])
        by_cutting_error = known.cutting_error * of_cutting
        if s.real > 0.0:
            # Growth flattens with C w; what is sure is how much less the least likely C w gives.
            least = max(cutting - _LIKELY * known.cutting_error, 0.0)
            lower = root_near(mechanics, least, stiffness, delay, s)
            if lower.real == lower.real:
                by_cutting_error = max(by_cutting_error, (s.real - lower.real) / _LIKELY)
        variance = by_cutting_error**2 + (error * of_stiffness) ** 2
        known.stiffness, known.stiffness_error = stiffness, error
        known.growth, known.growth_error = s.real, math.sqrt(variance)
        known.angular_frequency = s.imag
