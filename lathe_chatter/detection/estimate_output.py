"""What is told of the judgement: the state, and the figures of the window that knows best."""

from __future__ import annotations

import math

import numpy as np

from lathe_chatter.arrays import Array
from lathe_chatter.compiled import compiled
from lathe_chatter.detection.baseline import SETTLING
from lathe_chatter.detection.detector_state import (
    ALARMED,
    AMPLITUDE,
    CHATTER,
    FIGURE_CUTTING,
    FIGURE_ERROR,
    FIGURE_GROWTH,
    FIGURE_OMEGA,
    FIGURE_STIFFNESS,
    FORCED,
    HOPS,
    IDLE,
    RAMPING,
    SCORE,
    SEEN,
    SINCE_ALARM,
    SMALLEST,
    STABLE,
    STRICTNESS,
    UNKNOWN,
    WATCH,
    WINDOWS,
    Ledger,
)
from lathe_chatter.detection.identification import (
    ANGULAR_FREQUENCY,
    CUTTING,
    CUTTING_ERROR,
    GROWTH,
    GROWTH_ERROR,
    STIFFNESS,
)
from lathe_chatter.detection.signals import TOOL_MEAN

_WATCH = 0.75
_ONSET = 8
"""Hops before the alarm in which chatter may have begun: an older window has two cuts in it."""
_CUTS, _PUSHED = 4.0, 32
"""Standard errors from which on a force is one, and hops over which its mean is taken."""


@compiled()
def cuts(known: Array, products: Array, newest: int) -> bool:
    """Whether anything is cut: C w is clearly not zero, or the tool is pushed aside on average."""
    if not known[CUTTING] <= _CUTS * known[CUTTING_ERROR]:
        return True
    mean = squares = 0.0
    for back in range(_PUSHED):
        place = products[(newest - back) % HOPS, TOOL_MEAN]
        mean += place / _PUSHED
        squares += place**2 / _PUSHED
    # Neighbours vibrate together: the mean of 32 is about as sure as that of 8.
    error = math.sqrt(max(squares - mean**2, 0.0) / (_PUSHED / 4.0))
    return abs(mean) > _CUTS * error


@compiled()
def state_of(ledger: Ledger, cutting: bool, forced: bool) -> int:
    """Which of `states.STATES`, by its number."""
    numbers, flags = ledger.numbers, ledger.flags
    if flags[ALARMED] != 0:
        return CHATTER
    if flags[RAMPING] != 0 or flags[SEEN] < SETTLING:
        return UNKNOWN
    if not cutting:
        return IDLE
    if numbers[SCORE] > _WATCH * numbers[STRICTNESS]:
        return WATCH
    if forced:
        return FORCED
    return STABLE


@compiled()
def tell(
    ledger: Ledger, windows: Array, wave: tuple[float, float, float], model: bool, amplitude: float
) -> None:
    """Hand out the figures of the window that knows the growth rate best."""
    numbers = ledger.numbers
    numbers[AMPLITUDE] = amplitude
    if not (amplitude > numbers[SMALLEST] or ledger.flags[ALARMED] != 0):
        # What is left of a cut that has settled are roundings, from which nothing is known.
        numbers[FIGURE_GROWTH] = numbers[FIGURE_ERROR] = numbers[FIGURE_OMEGA] = np.nan
        numbers[FIGURE_CUTTING] = numbers[FIGURE_STIFFNESS] = np.nan
        return
    best = -1
    alarmed, since = ledger.flags[ALARMED] != 0, ledger.flags[SINCE_ALARM]
    for number in range(windows.shape[0]):
        if alarmed and best >= 0 and WINDOWS[number] > since + _ONSET:
            break
        error = windows[number, GROWTH_ERROR]
        if error == error and (best < 0 or error < windows[best, GROWTH_ERROR]):
            best = number
    if best < 0:
        numbers[FIGURE_GROWTH], numbers[FIGURE_ERROR], numbers[FIGURE_OMEGA] = wave
        numbers[FIGURE_CUTTING] = numbers[FIGURE_STIFFNESS] = np.nan
        return
    known = windows[best]
    numbers[FIGURE_GROWTH], numbers[FIGURE_ERROR] = known[GROWTH], known[GROWTH_ERROR]
    numbers[FIGURE_OMEGA] = known[ANGULAR_FREQUENCY]
    if model:
        numbers[FIGURE_CUTTING] = known[CUTTING]
        numbers[FIGURE_STIFFNESS] = known[STIFFNESS]
