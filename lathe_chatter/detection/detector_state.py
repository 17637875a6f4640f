"""What the judgement remembers from hop to hop, by name: records and arrays for compiled code."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.detection.filter_design import Complex
from lathe_chatter.detection.structured_arrays import Records, record, record_type

HOPS = 64
"""Hops that are remembered one by one."""
WINDOWS = np.array([2, 4, 8, 16, 32, 64])
"""Lengths of the windows, hops."""
BLOCK_COUNT, LAG = 40, 3
"""Blocks of a baseline, and blocks it stays behind."""
SPEEDS = 5
"""Hops over which a change of speed is seen."""

# States, in the order of `estimate.STATES`.
IDLE, STABLE, WATCH, CHATTER, FORCED, UNKNOWN = range(6)
REJECTED, TRUSTED, UNCHECKED = range(3)
"""What has become of the machine that was told: it does not fit, it fits, or nobody knows yet."""
SERIOUSNESS = (1, 2, 4, 5, 3, 0)
"""Of the states, where several bands are judged: the most serious one is said."""


_NOW = record_type(
    """
    usual_misfit misfits_seen peak_amplitude peak_motion push score rise once_per_turn spread
    synchronous_amplitude smallest_amplitude strictness amplitude shown_amplitude
    root_cutting root_stiffness usual_speed swing mean_place mean_power
    growth growth_error omega cutting cutting_error stiffness stiffness_error
    """,
    """
    newest hops_seen state alarmed since_alarm calm ramping holding since_jump blocks
    block_fill saturated stepped hold_ended
    fit_hops fit_is_due by_line line_gone strongest since_break out_of_proportion
    """,
    'root deeper_root',
)


class DetectorState(NamedTuple):
    """What the judgement remembers, changed in place.

    Attributes:
        now: One record. Figures that are handed out: `growth` to `stiffness_error`,
            `shown_amplitude`, `once_per_turn`, `score`. `newest`: place of the newest hop in the
            rings. `since_break`: hops since the tool may last have left the cut.
            `out_of_proportion`: hops for which the vibration is still called so to the tool's mean
            displacement. `root`, `deeper_root`: rightmost roots of a cut like the present one, and
            of a deeper one.
        motion: Resonators at the ends of the last hops, as a ring (HOPS, bins).
        usual: Mean product with the hop before, mean square, mean square innovation
            (3, bins); the first complex.
        blocks: Mean energies in the blocks of the baseline (blocks, bins).
        baseline: Their mean, behind by a lag (bins,).
        least: What it is at least: the energy of a vibration too small to be called chatter
            (bins,). What is left of a cut that has settled without noise are roundings.
        speeds: Of the last hops, rev/s (SPEEDS,).
        block_speeds: At the ends of the blocks of the baseline, rev/s (blocks,).
        amplitudes: Of the tool in the last hops, as a ring, m (HOPS,).
        loudest: The strongest resonator in the last hops, as a ring (HOPS,).
        line: Mean of the power of each resonator, and of its square (2, bins).
        line_shares: Of the newest power in these means (bins,).
        plain_scores: What would be suspected without a machine, as a ring (HOPS,).
    """

    now: Records
    motion: Complex
    usual: Complex
    blocks: Array
    baseline: Array
    least: Array
    speeds: Array
    block_speeds: Array
    amplitudes: Array
    loudest: Array
    line: Array
    line_shares: Array
    plain_scores: Array


def new_state(least: Array, **values: object) -> DetectorState:
    """Nothing known but the least energy of each bin and the fields of `now` that are given."""
    bins = least.size
    return DetectorState(
        record(
            _NOW,
            np.nan,
            misfits_seen=0.0,
            margin_weight=0.0,
            margin_cutting=0.0,
            push=0.0,
            score=0.0,
            state=UNKNOWN,
            **values,
        ),
        np.zeros((HOPS, bins), complex),
        np.zeros((3, bins), complex),
        np.zeros((BLOCK_COUNT + LAG + 1, bins)),
        np.full(bins, np.nan),
        least,
        np.zeros(SPEEDS),
        np.zeros(BLOCK_COUNT + LAG + 1),
        np.zeros(HOPS),
        np.zeros(HOPS),
        np.zeros((2, bins)),
        np.ones(bins),
        np.zeros(HOPS),
    )
