"""From raw samples to signals in which only regeneration is left.

Means of a few samples thin the data out. From every signal its own value one spindle turn
before is subtracted, which removes runout, unbalance and the mean at once, with no time
constant: u = x - x(t - tau). The chip thickness left is that of r = x_t - x_wp,

    h = r - r(t - tau),   its change over a turn   q = h - h(t - tau),   F_u = C w q,

whatever is periodic and whatever the mean chip is. What the kernels make of these is summed
up as products, from which every estimate follows.
"""

from __future__ import annotations

import numpy as np

from lathe_chatter.compiled import compiled
from lathe_chatter.detection.kernels import Complex, Kernels
from lathe_chatter.model import Array, Integers

# Rows of the history of thinned samples.
ANGLE, TOOL, WORKPIECE, TOOL_CHANGE, RELATIVE_CHANGE, CHIP_CHANGE, HISTORY_ROWS = range(7)

# What is counted: samples held, place one turn ago, from where the changes hold, ...
FILLED, POINTER, CHANGES_FROM, CHIPS_FROM, SINCE_OUTPUT, COUNTS_SIZE = range(6)

# Sums over the outputs of one hop: force F, chip q, workpiece x, pull F - m x'' - c x' = k x.
(
    FORCE_FORCE,
    FORCE_CHIP,
    CHIP_CHIP,
    PULL_PULL,
    PULL_WORKPIECE,
    WORKPIECE_WORKPIECE,
    RELATIVE_POWER,
    TOOL_POWER,
    OUTPUTS,
    PRODUCTS_SIZE,
) = range(10)


@compiled(inline=True)
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


@compiled()
def _make_room(history: Array, counts: Integers) -> None:
    """Forget the older half."""
    keep = history.shape[1] // 2
    shift = counts[FILLED] - keep
    history[:, :keep] = history[:, shift : shift + keep].copy()
    counts[FILLED] = keep
    for place in (POINTER, CHANGES_FROM, CHIPS_FROM):
        counts[place] = max(counts[place] - shift, 0)


@compiled()
def _take_changes(history: Array, counts: Integers) -> None:
    """Fill in the changes over a turn of the newest thinned sample."""
    n = counts[FILLED] - 1
    angles = history[ANGLE]
    before = angles[n] - 1.0
    p = counts[POINTER]
    while p + 1 < n and angles[p + 1] <= before:
        p += 1
    counts[POINTER] = p
    if p < 2 or p > n - 4 or angles[p] > before:
        counts[CHANGES_FROM] = counts[CHIPS_FROM] = n + 1
        return
    x = (before - angles[p]) / (angles[p + 1] - angles[p])
    tool = history[TOOL, n] - _interpolated(history[TOOL], p, x)
    relative = tool - history[WORKPIECE, n] + _interpolated(history[WORKPIECE], p, x)
    history[TOOL_CHANGE, n] = tool
    history[RELATIVE_CHANGE, n] = relative
    if p - 2 < counts[CHANGES_FROM]:
        counts[CHIPS_FROM] = n + 1
        return
    history[CHIP_CHANGE, n] = relative - _interpolated(history[RELATIVE_CHANGE], p, x)


@compiled()
def _take_products(history: Array, first: int, kernels: Kernels, products: Array) -> complex:
    """Multiply the newest samples by the kernels and add up; the band-passed relative motion."""
    force = chip = place = inertia = tool = 0j
    for i in range(kernels.band.size):
        change = history[TOOL_CHANGE, first + i]
        moved = change - history[RELATIVE_CHANGE, first + i]
        tool += kernels.band[i] * change
        force += kernels.force[i] * change
        chip += kernels.band[i] * history[CHIP_CHANGE, first + i]
        place += kernels.band[i] * moved
        inertia += kernels.inertia[i] * moved
    pull = force - inertia
    relative = tool - place
    products[FORCE_FORCE] += force.real**2 + force.imag**2
    products[FORCE_CHIP] += force.real * chip.real + force.imag * chip.imag
    products[CHIP_CHIP] += chip.real**2 + chip.imag**2
    products[PULL_PULL] += pull.real**2 + pull.imag**2
    products[PULL_WORKPIECE] += pull.real * place.real + pull.imag * place.imag
    products[WORKPIECE_WORKPIECE] += place.real**2 + place.imag**2
    products[RELATIVE_POWER] += relative.real**2 + relative.imag**2
    products[TOOL_POWER] += tool.real**2 + tool.imag**2
    products[OUTPUTS] += 1.0
    return relative


@compiled()
def follow(
    block: Array, strides: Integers, kernels: Kernels, memory: tuple[Array, Integers],
    results: tuple[Array, Complex],
) -> int:  # fmt: skip
    """Take in one hop of samples.

    Args:
        block: Spindle angle, tool and workpiece displacement (n, 3), rev and m.
        strides: Samples a thinned sample, thinned samples an output.
        kernels: From `kernels.design`.
        memory: History (HISTORY_ROWS, capacity) and counts (COUNTS_SIZE,), changed in place.
        results: Written: products (PRODUCTS_SIZE,) and band-passed relative motion (outputs,).

    Returns:
        The number of outputs.
    """
    history, counts = memory
    products, motion = results
    products[:] = 0.0
    made, taps = 0, kernels.band.size
    thinning, stride = strides[0], strides[1]
    for start in range(0, block.shape[0], thinning):
        if counts[FILLED] == history.shape[1]:
            _make_room(history, counts)
        n = counts[FILLED]
        for row in range(3):
            total = 0.0
            for i in range(start, start + thinning):
                total += block[i, row]
            history[row, n] = total / thinning
        counts[FILLED] = n + 1
        _take_changes(history, counts)
        counts[SINCE_OUTPUT] += 1
        if counts[SINCE_OUTPUT] < stride:
            continue
        counts[SINCE_OUTPUT] = 0
        first = n + 1 - taps
        if first >= counts[CHIPS_FROM]:
            motion[made] = _take_products(history, first, kernels, products)
            made += 1
    return made


def fresh_memory(turn: float, taps: int) -> tuple[Array, Integers]:
    """Nothing remembered yet, with room for turns of up to `turn` thinned samples."""
    keep = int(2.1 * turn) + taps + 32
    counts = np.zeros(COUNTS_SIZE, np.int64)
    return np.zeros((HISTORY_ROWS, 2 * keep)), counts
