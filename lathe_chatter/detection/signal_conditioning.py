"""From raw samples to signals in which only regeneration is left, compiled.

Means of a few samples thin the data out. From every signal its own value one spindle turn
before is subtracted, which removes runout, unbalance and the mean at once, with no time
constant: u = x - x(t - tau). Of r = x_t - x_wp that is the change of the chip thickness,

    h = r - r(t - tau),    F = C w h  in the band,

and F follows from the tool's own equation. A bank of resonators listens to h for what grows.
The spread of the values at one and the same spindle angle, turn after turn, tells vibration
that is the spindle's own from vibration that is not.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.compiled import compiled
from lathe_chatter.detection.filter_design import Complex, Kernels
from lathe_chatter.detection.machine_check import FitSums, add_output, new_sums
from lathe_chatter.detection.structured_arrays import Records, record, record_type

# Rows of the history of thinned samples.
ANGLE, TOOL, WORKPIECE, TOOL_CHANGE, CHIP, TOOL_FREE, CHIP_FREE, HISTORY_ROWS = range(8)

_COUNTS = record_type('first_angle', 'filled turn_before changes_from free_from since_output')
"""Samples held, place one turn ago, from where the changes and
what is free of its mean hold, samples since an output."""

HOP_SUMS = record_type(
    """
    force_force force_chip chip_chip pull_pull pull_workpiece workpiece_workpiece tool_power
    free_power outputs tool_noise workpiece_noise tool_mean change_power
    """
)
"""Sums over the outputs of one hop: force F, chip h, the changes u of workpiece and tool over a
turn, pull F - m x'' - c x' = k x; the tool free of its mean at every spindle angle; third
differences of the raw samples; mean of the tool; mean square of the chip's change over a turn."""

PHASES = 8
"""Spindle angles at which a value is taken once a turn."""
_FORGETTING = 1.0 / 8.0
_TURN_SHARE = 1.0 / 16.0
"""What a turn changes of the mean at every spindle angle, by which the force is freed of all that
repeats with the spindle, were it but runout at the sensor: a micrometre of it outweighs much."""
# Rows of the once-per-turn statistics: running mean and variance, values seen.
PHASE_MEAN, PHASE_VARIANCE, PHASE_SEEN, PHASE_ROWS = range(4)

SETTINGS = record_type(
    'rate period gain tool_stiffness forced_amplitude slowest_turns',
    'hop thinning stride has_angle has_workpiece has_machine believed',
)
"""How samples are read and judged: sample rate, Hz; length of a hop, s; gain of the band pass;
stiffness, N/m; amplitude from which on the spindle's own vibration is told, m; slowest speed,
rev/s. Samples in a hop and in a thinned sample, thinned samples in an output; what is
there (2: an angle from a speed that is only nominal), and what has become of the machine that was
told (`detector_state.UNCHECKED`)."""


class Memory(NamedTuple):
    """What the signals remember, changed in place.

    Attributes:
        history: Thinned samples (HISTORY_ROWS, capacity).
        counts: One record.
        resonators: (bins,).
        turns: Their poles over a hop (bins,), written by who first needs them.
        centres: Their angular frequencies, rad/s (bins,), likewise.
        phases: Once-per-turn statistics (PHASE_ROWS, PHASES).
        fit: Of the tool's equation.
    """

    history: Array
    counts: Records
    resonators: Complex
    turns: Complex
    centres: Array
    phases: Array
    fit: FitSums


def new_memory(turn: float, kernels: Kernels, stride: int) -> Memory:
    """Nothing remembered yet, with room for turns of up to `turn` thinned samples."""
    keep = int(1.1 * turn) + kernels.band.size + 32
    return Memory(
        np.zeros((HISTORY_ROWS, 2 * keep)),
        record(_COUNTS),
        np.zeros(kernels.poles.size, complex),
        np.zeros(kernels.poles.size, complex),
        np.zeros(kernels.poles.size),
        np.zeros((PHASE_ROWS, PHASES)),
        new_sums(kernels, stride),
    )


@compiled(inline=True, borrows=True, inner=True)
def _interpolated(row: Array, index: int, x: float) -> float:
    """The polynomial through six values, a fraction x beyond `index`."""
    a, b, c, d, e, f = x + 2.0, x + 1.0, x, x - 1.0, x - 2.0, x - 3.0
    result: float = (
        row[index - 2] * (b * c * d * e * f) / -120.0
        + row[index - 1] * (a * c * d * e * f) / 24.0
        + row[index] * (a * b * d * e * f) / -12.0
        + row[index + 1] * (a * b * c * e * f) / 12.0
        + row[index + 2] * (a * b * c * d * f) / -24.0
        + row[index + 3] * (a * b * c * d * e) / 120.0
    )
    return result


@compiled(borrows=True, inner=True)
def _make_room(history: Array, counts: Any) -> None:
    """Forget the older half."""
    keep = history.shape[1] // 2
    shift = counts.filled - keep
    for row in range(history.shape[0]):  # a slice of two dimensions takes 2 s more to compile
        for column in range(keep):
            history[row, column] = history[row, shift + column]
    counts.filled = keep
    counts.turn_before = max(counts.turn_before - shift, 0)
    counts.changes_from = max(counts.changes_from - shift, 0)
    counts.free_from = max(counts.free_from - shift, 0)


@compiled(inner=True)
def mean_kept(turns: float) -> float:
    """What a turn leaves of the mean at a spindle angle, some turns after it has begun."""
    part = min(turns * _TURN_SHARE, 1.0)
    return (1.0 - _TURN_SHARE) * part * part * (3.0 - 2.0 * part)


@compiled(borrows=True, inner=True)
def _take_changes(history: Array, counts: Any, settings: Any) -> bool:
    """Fill in the changes over a turn of the newest thinned sample; whether there are any."""
    n = counts.filled - 1
    if settings.has_angle == 0:
        history[TOOL_CHANGE, n] = history[TOOL, n]
        history[CHIP, n] = history[TOOL, n] - history[WORKPIECE, n]
        return True
    angles = history[ANGLE]
    before = angles[n] - 1.0
    history[TOOL_FREE, n] = history[CHIP_FREE, n] = 0.0
    p = counts.turn_before
    while p + 1 < n and angles[p + 1] <= before:
        p += 1
    counts.turn_before = p
    if p < 2 or p > n - 4 or angles[p] > before:
        counts.changes_from = n + 1
        return False
    x = (before - angles[p]) / (angles[p + 1] - angles[p])
    tool = history[TOOL, n] - _interpolated(history[TOOL], p, x)
    history[TOOL_CHANGE, n] = history[CHIP, n] = tool
    if settings.has_workpiece != 0:
        history[CHIP, n] -= history[WORKPIECE, n] - _interpolated(history[WORKPIECE], p, x)
    if settings.has_machine != 0 and p - 2 < counts.changes_from:
        counts.free_from = n + 1
    elif settings.has_machine != 0:
        # x less its mean over turns: y = x - x(t - tau) + keep y(t - tau). That there was nothing
        # before the first sample must not echo, so the mean begins with one turn.
        keep = mean_kept(angles[n] - counts.first_angle)
        history[TOOL_FREE, n] = tool + keep * _interpolated(history[TOOL_FREE], p, x)
        before = history[CHIP, n] - _interpolated(history[CHIP], p, x)
        history[CHIP_FREE, n] = before + keep * _interpolated(history[CHIP_FREE], p, x)
    return True


@compiled(borrows=True, inner=True)
def _take_phase(history: Array, n: int, phases: Array) -> None:
    """Note the relative motion where the spindle passes one of a few fixed angles."""
    now, before = PHASES * history[ANGLE, n], PHASES * history[ANGLE, n - 1]
    mark = np.floor(now)
    if mark <= before:
        return
    x = (mark - before) / (now - before)
    value = x * (history[TOOL, n] - history[WORKPIECE, n])
    value += (1.0 - x) * (history[TOOL, n - 1] - history[WORKPIECE, n - 1])
    place = int(mark) % PHASES
    seen = phases[PHASE_SEEN, place]
    share = max(_FORGETTING, 1.0 / (seen + 1.0))
    off = value - phases[PHASE_MEAN, place]
    phases[PHASE_MEAN, place] += share * off
    phases[PHASE_VARIANCE, place] += share * (
        (1.0 - share) * off**2 - phases[PHASE_VARIANCE, place]
    )
    phases[PHASE_SEEN, place] = seen + 1.0


@compiled(borrows=True, inner=True)
def _take_products(
    history: Array, first: int, kernels: Kernels, settings: Any, products: Any, fit: FitSums
) -> None:
    """Multiply the newest samples by the kernels and add up."""
    products.outputs += 1.0
    if settings.has_machine == 0:
        return
    force = chip = tool = pull = place = slope = free = 0j
    for i in range(kernels.band.size):
        change = history[TOOL_CHANGE, first + i]
        tool += kernels.band[i] * change
        moved = change - history[CHIP, first + i]
        freed = history[TOOL_FREE, first + i]
        force += kernels.force[i] * freed
        slope += kernels.slope[i] * freed
        free += kernels.band[i] * freed
        chip += kernels.band[i] * history[CHIP_FREE, first + i]
        pull += kernels.force[i] * change - kernels.inertia[i] * moved
        place += kernels.band[i] * moved
    products.force_force += force.real**2 + force.imag**2
    products.force_chip += force.real * chip.real + force.imag * chip.imag
    products.chip_chip += chip.real**2 + chip.imag**2
    products.pull_pull += pull.real**2 + pull.imag**2
    products.pull_workpiece += pull.real * place.real + pull.imag * place.imag
    products.workpiece_workpiece += place.real**2 + place.imag**2
    products.tool_power += tool.real**2 + tool.imag**2
    products.free_power += free.real**2 + free.imag**2
    add_output(fit, force, slope, free, place, chip)


@compiled(borrows=True, inner=True)
def clear(sums: Any) -> None:
    """All 0."""
    sums.force_force = sums.force_chip = sums.chip_chip = 0.0
    sums.pull_pull = sums.pull_workpiece = sums.workpiece_workpiece = 0.0
    sums.tool_power = sums.free_power = sums.outputs = sums.tool_mean = 0.0
    sums.tool_noise = sums.workpiece_noise = sums.change_power = 0.0


@compiled(borrows=True, inner=True)
def add(total: Any, hop: Any) -> None:
    """Add what the fits need of a hop."""
    total.force_force += hop.force_force
    total.force_chip += hop.force_chip
    total.chip_chip += hop.chip_chip
    total.pull_pull += hop.pull_pull
    total.pull_workpiece += hop.pull_workpiece
    total.workpiece_workpiece += hop.workpiece_workpiece
    total.tool_power += hop.tool_power
    total.outputs += hop.outputs


@compiled(borrows=True, inner=True)
def _noise_of(block: Array, column: int) -> float:
    """Variance of the noise of single samples, from their third differences."""
    total = 0.0
    for i in range(3, block.shape[0]):
        third = block[i, column] - block[i - 3, column]
        third -= 3.0 * (block[i - 1, column] - block[i - 2, column])
        total += third**2
    return float(total / (20.0 * (block.shape[0] - 3)))


@compiled(borrows=True, inner=True)
def follow(block: Array, settings: Any, kernels: Kernels, memory: Memory, products: Any) -> None:
    """Take in one hop of samples.

    Args:
        block: Spindle angle, tool and workpiece displacement (n, 3), rev and m.
        settings: A record of `SETTINGS`.
        kernels: From `filter_design.design`.
        memory: Changed in place.
        products: A record of `HOP_SUMS`, written.
    """
    history, counts = memory.history, memory.counts[0]
    clear(products)
    products.tool_noise = _noise_of(block, 1)
    products.workpiece_noise = _noise_of(block, 2)
    thinning, taps = settings.thinning, kernels.band.size
    for start in range(0, block.shape[0], thinning):
        if counts.filled == history.shape[1]:
            _make_room(history, counts)
        n = counts.filled
        for row in range(3):
            total = 0.0
            for i in range(start, start + thinning):
                total += block[i, row]
            history[row, n] = total / thinning
        if n == 0:
            counts.first_angle = history[ANGLE, n]
        counts.filled = n + 1
        products.tool_mean += history[TOOL, n] * thinning / block.shape[0]
        if settings.has_angle == 1 and n > 0:
            _take_phase(history, n, memory.phases)
        if not _take_changes(history, counts, settings):
            continue
        products.change_power += history[CHIP, n] ** 2 * thinning / block.shape[0]
        for j in range(memory.resonators.size):
            memory.resonators[j] = kernels.poles[j] * memory.resonators[j] + history[CHIP, n]
        counts.since_output += 1
        first = n + 1 - taps
        known = first >= counts.changes_from and first >= counts.free_from
        if counts.since_output >= settings.stride and known:
            counts.since_output = 0
            _take_products(history, first, kernels, settings, products, memory.fit)
