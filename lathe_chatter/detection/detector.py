"""`ChatterDetector`: samples in, state and estimates out."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from lathe_chatter.detection import states
from lathe_chatter.detection.advice import better_speed
from lathe_chatter.detection.identification import (
    ANGULAR_FREQUENCY,
    CUTTING,
    GROWTH,
    GROWTH_ERROR,
    STIFFNESS,
    WINDOW_OUTPUTS,
    WINDOW_SIZE,
    WINDOW_TOOL_POWER,
    identify,
    mechanics_of,
    rightmost_in_band,
)
from lathe_chatter.detection.intake import Break, Hop, Intake, Rate
from lathe_chatter.detection.kernels import band_of, design, gain
from lathe_chatter.detection.signals import (
    PRODUCTS_SIZE,
    follow,
    fresh_memory,
)
from lathe_chatter.detection.states import Estimate
from lathe_chatter.model import Array, Machine

_PAPER = Machine()
_WINDOWS = np.array([1, 2, 4, 8, 16, 32])
_REFERENCE = 3
_PATIENCE = 2


class ChatterDetector:
    """Flags chatter from what sensors on a machine would see."""

    def __init__(
        self,
        machine: Machine | None = _PAPER,
        *,
        speed_range: tuple[float, float] = (60.0, 30000.0),
        smallest_amplitude: float = 1e-10,
    ) -> None:
        """Begin with nothing known."""
        self._machine = machine or _PAPER
        self._speed_range = speed_range
        self._smallest = smallest_amplitude
        self._band = band_of(self._machine)
        self._mechanics = mechanics_of(self._machine, *self._band)
        self.reset()

    def reset(self) -> None:
        """Forget everything, as at the start."""
        self._intake = Intake()
        self._rate = 0.0
        self._alarmed = False
        self._estimate = Estimate()
        self._guess = complex(0.0, math.pi * sum(self._band))
        self._suspected = self._calm = 0
        self._peak = 0.0
        self._since_alarm = 0

    def update(self, samples: Array, columns: Sequence[str]) -> Estimate:
        """Take in samples."""
        for item in self._intake.take(samples, columns):
            if isinstance(item, Hop):
                self._take_hop(item)
            elif isinstance(item, Rate):
                self._prepare(item.value)
            elif item is Break.RESTART:
                intake = self._intake
                self.reset()
                self._intake = intake
            else:
                self._forget_signals()
        return self._estimate

    def _prepare(self, rate: float) -> None:
        self._sample_rate = rate
        thinning = max(1, int(rate / (9.0 * self._band.high)))
        thinned = rate / thinning
        stride = max(1, round(thinned / (2.25 * self._band.high)))
        self._thinned = thinned
        self._strides = np.array([thinning, stride])
        self._intake.hop = thinning * stride * 5
        self._kernels = design(self._band, thinned, self._machine)
        self._forget_signals()

    def _forget_signals(self) -> None:
        turn = 60.0 / self._speed_range[0] * self._thinned
        self._memory = fresh_memory(turn, self._kernels.band.size)
        self._products = np.zeros((64, PRODUCTS_SIZE))
        self._motion = np.zeros(8, complex)
        self._newest = 63
        self._windows = np.full((_WINDOWS.size, WINDOW_SIZE), np.nan)
        self._hops = 0

    def _take_hop(self, hop: Hop) -> None:
        self._newest = (self._newest + 1) % 64
        self._hops += 1
        follow(
            hop.block,
            self._strides,
            self._kernels,
            self._memory,
            (self._products[self._newest], self._motion),
        )
        turned = hop.block[-1, 0] - hop.block[0, 0]
        speed = turned / (len(hop.block) - 1) * self._sample_rate
        if speed * 60.0 < self._speed_range[0]:
            self._estimate = Estimate(time=hop.time, state=states.IDLE, chatter=self._alarmed)
            return
        figures = np.array([1.0 / speed, 0.8, 0.0, 0.0])
        windows = self._windows
        identify(
            self._products, self._newest, _WINDOWS, self._mechanics, figures, self._guess, windows
        )
        if self._hops % 8 == 0 and not math.isnan(windows[_REFERENCE, GROWTH]):
            self._guess = rightmost_in_band(
                self._mechanics,
                max(windows[_REFERENCE, CUTTING], 0.0),
                float(
                    np.clip(windows[_REFERENCE, STIFFNESS], self._mechanics[5], self._mechanics[6])
                ),
                1.0 / speed,
                self._guess,
            )
        self._decide(hop.time, speed)

    def _decide(self, time: float, speed: float) -> None:
        windows = self._windows
        if not windows[0, WINDOW_OUTPUTS] >= 2:
            self._estimate = Estimate(time=time, state=states.UNKNOWN, chatter=self._alarmed)
            return
        errors = np.where(np.isnan(windows[:, GROWTH_ERROR]), np.inf, windows[:, GROWTH_ERROR])
        best = [float(value) for value in windows[int(np.argmin(errors))]]
        omega = best[ANGULAR_FREQUENCY]
        taps = self._kernels.band.size
        comb = abs(1.0 - np.exp(-1j * omega / speed)) if math.isfinite(omega) else 1.0
        amplitude = 2.0 * math.sqrt(windows[1, WINDOW_TOOL_POWER]) / max(comb, 0.1)
        if math.isfinite(omega):
            amplitude /= max(gain(self._band, self._thinned, taps, omega / (2 * math.pi)), 0.1)
        with np.errstate(invalid='ignore'):
            surely = (windows[:, GROWTH] / windows[:, GROWTH_ERROR] > 6.0) & (
                windows[:, GROWTH] > 0.2
            )
        suspect = bool(surely.any()) and amplitude > self._smallest
        self._suspected = self._suspected + 1 if suspect else 0
        if self._alarmed:
            self._since_alarm += 1
            self._peak = max(self._peak, amplitude)
            dead = amplitude < 0.1 * self._peak and best[GROWTH] < 0.0
            self._calm = self._calm + 1 if dead else 0
            if self._calm >= 20:
                self._alarmed = False
        elif self._suspected > _PATIENCE:
            self._alarmed, self._peak, self._calm = True, amplitude, 0
            self._since_alarm = 0
        state = states.CHATTER if self._alarmed else states.WATCH if suspect else states.STABLE
        stiffness = best[STIFFNESS]
        open_, bearing = self._machine.workpiece.stiffness, self._machine.bearing_stiffness
        speed_rpm = self._estimate.recommended_speed_rpm if self._alarmed else math.nan
        if self._alarmed and self._since_alarm in {0, 10, 30}:
            speed_rpm = better_speed(self._machine, best[CUTTING], self._speed_range, 60 * speed)
        self._estimate = Estimate(
            time,
            state,
            self._alarmed,
            best[GROWTH],
            best[GROWTH_ERROR],
            omega / (2 * math.pi),
            amplitude,
            best[CUTTING],
            stiffness,
            bool(stiffness > open_ + 0.1 * bearing) if math.isfinite(stiffness) else None,
            speed_rpm,
        )
