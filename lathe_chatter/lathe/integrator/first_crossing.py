"""Finds where a smooth function of a short piece of time first becomes negative."""

from __future__ import annotations

from lathe_chatter.array_types import Array
from lathe_chatter.compiled import compiled
from lathe_chatter.lathe.integrator.propagation import value_and_slope

NEVER = 2.0
"""An answer beyond the piece [0, 1]."""
_ITERATIONS = 60
_CLOSE = 1e-15


@compiled(inline=True, borrows=True, inner=True)
def may_turn_back(
    start: float, slope: float, end: float, slope_end: float, duration: float
) -> bool:
    """Whether a margin may become negative in a piece.

    Either it is negative at the end, or it turns inside and its tangent at the start would take
    it below zero: where it turns upwards it is convex, and the curve lies above that tangent.
    """
    turns = (slope < 0.0) & (slope_end > 0.0) & (start + slope * duration < 0.0)
    return (end < 0.0) | turns


@compiled(borrows=True, inner=True)
def _lowest(margin: Array, last: int) -> tuple[float, float]:
    """Where a margin that falls first and then rises is lowest, or some place where it is < 0."""
    low, high, place, value = 0.0, 1.0, 0.5, 0.0
    for _ in range(_ITERATIONS):
        place = 0.5 * (low + high)
        value, slope = value_and_slope(margin, last, place)
        if value < 0.0 or high - low <= _CLOSE:
            break
        if slope < 0.0:
            low = place
        else:
            high = place
    return place, value


@compiled(borrows=True, inner=True)
def _highest(margin: Array, last: int) -> float:
    """Where a margin that rises first and then falls is highest."""
    low, high = 0.0, 1.0
    for _ in range(_ITERATIONS):
        place = 0.5 * (low + high)
        if value_and_slope(margin, last, place)[1] > 0.0:
            low = place
        else:
            high = place
        if high - low <= _CLOSE:
            break
    return low


@compiled(borrows=True, inner=True)
def _guess(start: float, slope: float, end: float, slope_end: float) -> float:
    """A zero in [0, 1] of the cubic through both ends, by a few steps of Newton's method."""
    a2 = 3.0 * (end - start) - 2.0 * slope - slope_end
    a3 = 2.0 * (start - end) + slope + slope_end
    place = start / (start - end)
    for _ in range(3):
        falls = slope + place * (2.0 * a2 + place * 3.0 * a3)
        if falls >= 0.0:
            break
        value = start + place * (slope + place * (a2 + place * a3))
        place = min(max(place - value / falls, 0.0), 1.0)
    return place


@compiled(borrows=True, inner=True)
def first_crossing(margin: Array, last: int, end: float, slope_end: float) -> float:
    """Where a margin, which should stay positive, first falls below zero.

    A piece is a small part of a vibration period (|lambda| dt <= 0.25), so the margin turns
    at most once inside it. At 0 the margin may be zero but for rounding, just after an event.

    Args:
        margin: Coefficients of its power series on [0, 1].
        last: The last of them that counts.
        end: Its value at 1.
        slope_end: Its slope there.

    Returns:
        The place in [0, 1], or `NEVER`.
    """
    start, slope = margin[0], margin[1]
    low, high = 0.0, 1.0
    if end < 0.0 < start:
        place = _guess(start, slope, end, slope_end)
    elif end < 0.0 < slope:  # it grows first, and comes back
        low = _highest(margin, last)
        if not value_and_slope(margin, last, low)[0] > 0.0:
            return 0.0
        place = 0.5 * (low + high)
    elif end < 0.0:
        return 0.0
    elif slope < 0.0 < slope_end:
        high, value = _lowest(margin, last)
        if value >= 0.0:
            return NEVER
        if start <= 0.0:
            return 0.0
        place = 0.5 * high
    else:
        return NEVER
    # Newton's steps shrink as step' = c step^2, so two of them tell the size of the next: the
    # last one need not be taken to know that it is nothing.
    before = 1.0
    for _ in range(_ITERATIONS):
        value, falls = value_and_slope(margin, last, place)
        if value >= 0.0:
            low = place
        else:
            high = place
        step = value / falls
        size = abs(step)
        place -= step
        if not low <= place <= high:  # Newton has left the bracket, or the slope is zero
            place, before = 0.5 * (low + high), 1.0
            if high - low <= _CLOSE:
                break
            continue
        if size * size * size <= _CLOSE * before * before or size <= 0.1 * _CLOSE:
            break
        before = size
    return place
