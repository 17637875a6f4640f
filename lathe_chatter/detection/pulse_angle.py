"""The spindle's angle where no encoder tells it: from a pulse a turn."""

from __future__ import annotations

import math

import numpy as np

from lathe_chatter.array_types import Array

_CORRECTED, _FOLLOWED = 0.25, 0.03
"""Part of a pulse's offset by which the angle is corrected, and the speed follows: a pulse is seen
to a sample only, and a speed may drift."""
_LOST = 0.2
"""Relative change of a turn's duration from which on the speed is taken anew."""
_MISSING = 1.6
"""Turns without a pulse after which the spindle stands."""
_LEVEL = 0.5
"""Between the lowest and the highest value that were seen, where a pulse begins."""


class PulseAngle:
    """Turns a signal that rises once a turn into the spindle's angle, sample by sample.

    Before two pulses have come the angle is unknown; where they stay away the spindle stands.
    """

    def __init__(self) -> None:
        """No pulse has come."""
        self._low, self._high = math.inf, -math.inf
        self._above = True
        self._pulses, self._begun = 0, -math.inf
        self._angle = self._speed = self._slope = math.nan

    def take(self, time: Array, signal: Array) -> Array:
        """Angles at samples (n,), rev; nan at one that is no number, which is passed over.

        Args:
            time: s (n,).
            signal: In any unit (n,).
        """
        known = np.isfinite(time) & np.isfinite(signal)
        angles = np.full(len(time), np.nan)
        if known.any():
            angles[known] = self._follow(time[known], signal[known])
        return angles

    def _follow(self, time: Array, signal: Array) -> Array:
        lows = np.minimum.accumulate(np.r_[self._low, signal])[1:]
        highs = np.maximum.accumulate(np.r_[self._high, signal])[1:]
        self._low, self._high = float(lows[-1]), float(highs[-1])
        above = (signal > lows + _LEVEL * (highs - lows)) & (highs > lows)
        rises = np.flatnonzero(above & ~np.r_[self._above, above[:-1]])
        self._above = bool(above[-1])
        angles, begin = np.empty(len(time)), 0
        for rise in rises.tolist():
            angles[begin:rise] = self._between(time[begin:rise])
            self._pulse(float(time[rise]))
            begin = rise
        angles[begin:] = self._between(time[begin:])
        return angles

    def _between(self, time: Array) -> Array:
        if self._pulses < 2:
            return np.full(len(time), np.nan)
        turns = np.minimum(self._slope * (time - self._begun), _MISSING)
        return self._angle + turns

    def _pulse(self, now: float) -> None:
        period, self._begun = now - self._begun, now
        self._pulses += 1
        if self._pulses == 1 or not period > 0.0:  # the first, or the first after a restart
            self._pulses = 1
            return
        if self._pulses == 2:
            self._angle, self._speed = 1.0, 1.0 / period
        else:
            self._angle += min(self._slope * period, _MISSING)
        offset = round(self._angle) - self._angle
        if abs(self._speed * period - 1.0) > _LOST:  # it stood, or has changed at once
            self._speed = 1.0 / period
        else:
            self._speed += _FOLLOWED * offset / period
        # What is wrong is made good over the next turn: the angle never jumps.
        self._slope = self._speed * (1.0 + _CORRECTED * offset)
