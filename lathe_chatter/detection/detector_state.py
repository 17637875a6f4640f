"""What the judgement remembers from hop to hop, by name: plain arrays for compiled code."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lathe_chatter.arrays import Array, Integers
from lathe_chatter.detection.kernels import Complex

HOPS = 64
"""Hops that are remembered one by one."""
WINDOWS = np.array([2, 4, 8, 16, 32, 64])
"""Lengths of the windows, hops."""
BLOCK_COUNT, LAG = 40, 3
"""Blocks of a baseline, and blocks it stays behind."""
SPEEDS = 5
"""Hops over which a change of speed is seen."""

# States, in the order of `states.STATES`.
IDLE, STABLE, WATCH, CHATTER, FORCED, UNKNOWN = range(6)

# Numbers that persist from hop to hop, and figures handed out.
(
    USUAL,
    USUAL_SEEN,
    PEAK,
    PEAK_ONCE,
    SCORE,
    RATIO,
    FIGURE_GROWTH,
    FIGURE_ERROR,
    FIGURE_OMEGA,
    AMPLITUDE,
    FIGURE_CUTTING,
    FIGURE_STIFFNESS,
    ONCE,
    RISE,
    FORCED_AMPLITUDE,
    SMALLEST,
    STRICTNESS,
    NUMBERS_SIZE,
) = range(18)

(
    SEEN,
    STATE,
    ALARMED,
    SINCE_ALARM,
    SUSPECTED,
    CALM,
    RAMPING,
    HOLDING,
    SINCE_JUMP,
    BLOCKS,
    BLOCK_FILL,
    SATURATED,
    STEPPED,
    FLAGS_SIZE,
) = range(14)


class Ledger(NamedTuple):
    """What the judgement remembers, changed in place.

    Attributes:
        numbers: (NUMBERS_SIZE,).
        flags: (FLAGS_SIZE,).
        motion: Resonators at the ends of the last hops, as a ring (HOPS, bins).
        usual: Mean product with the hop before, mean square, mean square innovation
            (3, bins); the first complex.
        blocks: Mean energies in the blocks of the baseline (blocks, bins).
        baseline: Their mean, behind by a lag (bins,).
        speeds: Of the last hops, rev/s (SPEEDS,).
    """

    numbers: Array
    flags: Integers
    motion: Complex
    usual: Complex
    blocks: Array
    baseline: Array
    speeds: Array


def fresh_ledger(bins: int) -> Ledger:
    """Nothing known."""
    numbers = np.full(NUMBERS_SIZE, np.nan)
    numbers[USUAL_SEEN] = numbers[SCORE] = 0.0
    ledger = Ledger(
        numbers,
        np.zeros(FLAGS_SIZE, np.int64),
        np.zeros((HOPS, bins), complex),
        np.zeros((3, bins), complex),
        np.zeros((BLOCK_COUNT + LAG + 1, bins)),
        np.full(bins, np.nan),
        np.zeros(SPEEDS),
    )
    ledger.flags[STATE] = UNKNOWN
    return ledger
