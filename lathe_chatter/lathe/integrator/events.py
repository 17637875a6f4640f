"""Finds where a smooth function of a short piece of time first becomes negative."""

from __future__ import annotations

from lathe_chatter.arrays import Array
from lathe_chatter.compiled import compiled
from lathe_chatter.lathe.integrator.propagation import slope_at, value_and_slope, value_at

NEVER = 2.0
"""An answer beyond the piece [0, 1]."""
_ITERATIONS = 60
_CLOSE = 1e-15


@compiled(borrows=True)
def _root(series: Array, terms: int, sign: float, low: float, high: float, place: float) -> float:
    """The root of sign * series between `low` (positive there) and `high` (negative).

    Newton's method from `place`. Its steps shrink as step' = c step^2, so two of them tell the
    size of the next: the last one need not be taken to know that it is nothing.
    """
    last = 0.0
    for _ in range(_ITERATIONS):
        value, slope = value_and_slope(series, terms, place)
        if sign * value >= 0.0:
            low = place
        else:
            high = place
        step = value / slope
        size = abs(step)
        place -= step
        if not low < place < high:  # Newton has left the bracket, or the slope is zero
            place, last = 0.5 * (low + high), 0.0
            if high - low <= _CLOSE:
                break
            continue
        if size * size * size <= _CLOSE * last * last:
            break
        last = size
    return place


@compiled(borrows=True)
def _turning_point(series: Array, terms: int, rising_first: bool) -> float:
    """Where the slope changes sign between 0 and 1, by bisection: it happens twice a period."""
    low, high = 0.0, 1.0
    for _ in range(_ITERATIONS):
        place = 0.5 * (low + high)
        if (slope_at(series, terms, place) > 0.0) == rising_first:
            low = place
        else:
            high = place
        if high - low <= _CLOSE:
            break
    return 0.5 * (low + high)


@compiled(borrows=True)
def first_crossing(series: Array, terms: int, sign: float) -> float:
    """Where sign * series, a margin that should stay positive, first falls below zero.

    A piece is a small part of a vibration period (|lambda| dt <= 0.12), so the margin turns
    at most once inside it. At 0 the margin may be zero but for rounding, just after an event.

    Args:
        series: Coefficients of the power series on [0, 1].
        terms: How many of them.
        sign: +1 or -1.

    Returns:
        The place in [0, 1], or `NEVER`.
    """
    start = sign * series[0]
    end = sign * value_at(series, terms, 1.0)
    slope_start = sign * series[1]
    low, high, place = 0.0, 1.0, NEVER
    if end < 0.0 < start:
        place = start / (start - end)
    elif end < 0.0 < slope_start:  # it grows first, and comes back
        low = _turning_point(series, terms, sign > 0.0)
        place = 0.5 * (low + high) if sign * value_at(series, terms, low) > 0.0 else 0.0
    elif end < 0.0:
        return 0.0
    elif slope_start < 0.0 < sign * slope_at(series, terms, 1.0):
        high = _turning_point(series, terms, sign < 0.0)
        if sign * value_at(series, terms, high) < 0.0:
            place = 0.5 * high if start > 0.0 else 0.0
    if 0.0 < place < NEVER:
        return _root(series, terms, sign, low, high, place)
    return place


@compiled(inline=True, borrows=True)
def may_turn_back(
    start: float, slope: float, end: float, slope_end: float, duration: float
) -> bool:
    """Whether a margin may become negative in a piece.

    Either it is negative at the end, or it turns inside and its tangent at the start would take
    it below zero: where it turns upwards it is convex, and the curve lies above that tangent.
    """
    turns = (slope < 0.0) & (slope_end > 0.0) & (start + slope * duration < 0.0)
    return (end < 0.0) | turns
