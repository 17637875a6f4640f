"""Whether the machine that was told is the one that is heard: the tool's own equation, fitted.

    F = (c - c_told) x' + (k - k_told) x + C w h,

where F is the force by the told numbers and everything is in the band of the kernels, x less its
mean at every spindle angle. Cutting closes a loop, so least squares would be biased: the fit is by
instrumental variables (two-stage least squares), the outputs of x, of the workpiece's motion and
of h at 1, 4/3 and 5/3 kernel lengths earlier, which cannot know of later forces or noise. Every
block of some seconds has a C w of its own; what it says of c and k is added up. Sargan's J says
whether the equation holds at all: a second mode or a tone in the force shows there.
"""

from __future__ import annotations

import math
from collections import deque
from enum import Enum
from typing import NamedTuple

import numpy as np

from lathe_chatter.array_types import Array, Integers
from lathe_chatter.compiled import compiled
from lathe_chatter.detection.filter_design import Complex, Kernels
from lathe_chatter.model import Machine

_LAGS = np.array([1.0, 4.0 / 3.0, 5.0 / 3.0])
_HEARD, _FITTED = 3, 4
"""Signals of which earlier outputs are instruments: x, workpiece, h. And F, x', x, h."""
INSTRUMENTS = _HEARD * 3
_BLOCKS = 4
"""Blocks that count."""
_FEWEST_OUTPUTS = 200.0
_INFLATION = 1.25
"""Of standard errors, found by simulation: outputs that overlap are not independent."""
_MODEL_ERROR = 3e-4
"""Misfit of a machine that is right, as a part of the force's power: J asks no more than that."""
_MOST_J = 5.0
"""Sargan's J over its degrees of freedom, up to which the equation is believed (good: 2.4)."""
_FEWEST_BLOCKS = 2
"""Blocks without which no machine is called wrong."""
_NEGATIVE = 2.0
"""Standard errors by which C w may be below 0: what says more knows nothing of k either."""
_VAGUE, _CORRECTABLE = 0.025, 0.01
"""Relative standard errors from which on nothing is judged, and below which it is corrected: with
less clear instruments the frequency comes out too high."""


class Verdict(str, Enum):
    """Of the machine as told."""

    UNKNOWN = 'unknown'
    FITS = 'fits'
    MISFIT = 'does not fit'


class FitSums(NamedTuple):
    """Sums over the outputs of a block, and of the newest hop, changed in place.

    A hop is taken into the block when the next one has shown that there was no jump in it.

    Attributes:
        past: Outputs of x, workpiece and h, as a ring (lags, 3).
        counts: Outputs in the block, in the newest hop, and in a row (3,).
        lags: Of the instruments, outputs (3,).
        square: Instruments by instruments (2, 9, 9).
        cross: Instruments by F, x', x and h (2, 9, 4).
        fitted: F, x', x and h by themselves (2, 4, 4).
        instruments: Room for those of an output (9,).
    """

    past: Complex
    counts: Integers
    lags: Integers
    square: Complex
    cross: Complex
    fitted: Complex
    instruments: Complex


def new_sums(kernels: Kernels, stride: int) -> FitSums:
    """Nothing added up."""
    lags = np.ceil(_LAGS * kernels.band.size / stride).astype(np.int64)
    return FitSums(
        np.zeros((int(lags[-1]) + 1, _HEARD), complex),
        np.zeros(3, np.int64),
        lags,
        np.zeros((2, INSTRUMENTS, INSTRUMENTS), complex),
        np.zeros((2, INSTRUMENTS, _FITTED), complex),
        np.zeros((2, _FITTED, _FITTED), complex),
        np.zeros(INSTRUMENTS, complex),
    )


def clear_sums(sums: FitSums) -> None:
    """Begin another block."""
    for array in (sums.counts, sums.square, sums.cross, sums.fitted):
        array[0] = 0


@compiled(borrows=True, inner=True)
def take_hop(sums: FitSums, counts: bool) -> None:
    """Take the newest hop into the block, or forget it."""
    if counts:
        sums.counts[0] += sums.counts[1]
    sums.counts[1] = 0
    # One by one: a whole array put into another takes 4 s more to compile.
    for kept in (sums.square, sums.cross, sums.fitted):
        for i in range(kept.shape[1]):
            for j in range(kept.shape[2]):
                if counts:
                    kept[0, i, j] += kept[1, i, j]
                kept[1, i, j] = 0.0


@compiled(borrows=True, inner=True)
def add_output(
    sums: FitSums, force: complex, slope: complex, place: complex, workpiece: complex,
    chip: complex,
) -> None:  # fmt: skip
    """Take in one output of the kernels."""
    size = sums.past.shape[0]
    newest = sums.counts[2] % size
    sums.past[newest, 0], sums.past[newest, 1], sums.past[newest, 2] = place, workpiece, chip
    sums.counts[2] += 1
    if sums.counts[2] < size:
        return
    sums.counts[1] += 1
    instruments = sums.instruments
    for i in range(3):
        for j in range(3):
            instruments[3 * i + j] = sums.past[(newest - sums.lags[i]) % size, j].conjugate()
    fitted = (force, slope, place, chip)
    for i in range(INSTRUMENTS):
        for j in range(i + 1):
            sums.square[1, i, j] += instruments[i] * instruments[j].conjugate()
        for j in range(4):
            sums.cross[1, i, j] += instruments[i] * fitted[j]
    for i in range(4):
        for j in range(4):
            sums.fitted[1, i, j] += fitted[i].conjugate() * fitted[j]


class _Block(NamedTuple):
    """What a block says: weight and side for (c - c_told, k - k_told), J, and C w, N/m."""

    weight: Array
    side: Array
    misfit: float
    freedom: float
    cutting: float
    cutting_error: float


class MachineFit:
    """Adds up what the blocks say, and judges.

    Args:
        machine: As told.

    Attributes:
        verdict: Whether it fits.
        frequency: Of the tool as fitted, Hz; nan where unknown.
        error: Its standard error, Hz.
    """

    def __init__(self, machine: Machine) -> None:
        """Nothing known."""
        self._tool = machine.tool
        self._blocks: deque[_Block] = deque(maxlen=_BLOCKS)
        self._same_cut = 0
        self.verdict = Verdict.UNKNOWN
        self.frequency = self.error = math.nan

    @property
    def is_correctable(self) -> bool:
        """Whether the frequency is so sure that it may take the place of the told one."""
        full = len(self._blocks) == _BLOCKS
        return full and self.error < _CORRECTABLE * self.frequency

    def cutting(self) -> tuple[float, float]:
        """C w in the blocks of the present cut and its standard error, N/m; nan if unknown."""
        blocks = [*self._blocks][-self._same_cut :] if self._same_cut else []
        if not blocks or any(block.misfit > _MOST_J * block.freedom for block in blocks):
            return math.nan, math.nan
        weights = np.array([1.0 / block.cutting_error**2 for block in blocks])
        mean = weights @ [block.cutting for block in blocks] / weights.sum()
        return float(mean), 1.0 / math.sqrt(weights.sum())

    def close_block(self, sums: FitSums, *, jumped: bool) -> None:
        """Take a block in, if it is long enough, and judge; after a jump there is another cut."""
        block = _solved(sums) if sums.counts[0] >= _FEWEST_OUTPUTS else None
        if block is not None and block.cutting > -_NEGATIVE * block.cutting_error:
            self._blocks.append(block)
            self._same_cut += 1
            self._judge()
        if jumped:
            self._same_cut = 0
        clear_sums(sums)

    def _judge(self) -> None:
        weight = np.sum([block.weight for block in self._blocks], axis=0)
        side = np.sum([block.side for block in self._blocks], axis=0)
        misfit = sum(block.misfit for block in self._blocks)
        freedom = sum(block.freedom for block in self._blocks)
        self.verdict = Verdict.UNKNOWN
        try:
            off = np.linalg.solve(weight, side)
            variance = np.linalg.inv(weight)[1, 1]
        except np.linalg.LinAlgError:
            return
        stiffness = self._tool.stiffness + off[1]
        if not (stiffness > 0.0 and variance > 0.0 and misfit < _MOST_J * freedom):
            return
        self.frequency = math.sqrt(stiffness / self._tool.mass) / (2.0 * math.pi)
        self.error = float(_INFLATION * 0.5 * math.sqrt(variance) / stiffness * self.frequency)
        told = self._tool.natural_frequency / (2.0 * math.pi)
        off_by, spread = told / self.frequency - 1.0, 2.0 * self.error / self.frequency
        if spread > 2.0 * _VAGUE:
            return
        surely = 1.5 * spread  # it is looked at again and again
        if off_by - surely > 0.01 or off_by + surely < -0.015:
            if len(self._blocks) >= _FEWEST_BLOCKS:
                self.verdict = Verdict.MISFIT
        elif off_by + spread < 0.03 and off_by - spread > -0.04:
            self.verdict = Verdict.FITS


def _solved(sums: FitSums) -> _Block | None:
    """Two-stage least squares over a block, C w taken out of the normal equations."""
    square = sums.square[0] + np.tril(sums.square[0], -1).conj().T
    scale = np.sqrt(square.diagonal().real)
    if not (scale > 0.0).all():
        return None
    square = square / np.outer(scale, scale)
    cross = sums.cross[0] / scale[:, None]
    try:
        projected = np.linalg.solve(square + 1e-12 * np.eye(INSTRUMENTS), cross)
    except np.linalg.LinAlgError:
        return None
    normal = (cross.conj().T @ projected).real
    inner, side = normal[1:, 1:], normal[1:, 0]
    units = np.sqrt(inner.diagonal())
    if not (units > 0.0).all():
        return None
    try:
        slopes = np.linalg.solve(inner / np.outer(units, units), side / units) / units
    except np.linalg.LinAlgError:
        return None
    weights = np.array([1.0, *(-slopes)])
    left = weights @ sums.fitted[0].real @ weights + _MODEL_ERROR * sums.fitted[0, 0, 0].real
    variance = float(left / (2.0 * sums.counts[0]))
    if not variance > 0.0:
        return None
    misfit = float(weights @ normal @ weights) / variance
    # C w is each block's own.
    reduced = inner[:2, :2] - np.outer(inner[:2, 2], inner[2, :2]) / inner[2, 2]
    rest = side[:2] - inner[:2, 2] * side[2] / inner[2, 2]
    freedom = 2.0 * INSTRUMENTS - 3.0
    spread = np.linalg.inv(inner / np.outer(units, units))[2, 2] / units[2] ** 2
    error = _INFLATION * math.sqrt(max(variance * spread, 0.0))
    return _Block(reduced / variance, rest / variance, misfit, freedom, float(slopes[2]), error)
