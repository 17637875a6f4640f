"""Excerpts of a run in which the cut is one: its size, its spectrum, and once in every turn."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lathe_chatter.arrays import Array
from lathe_chatter.model import BearingContact, Cut
from lathe_chatter.report.run_history import History

_LONGEST = 2.0
"""s that an excerpt has at most."""
_PORTRAIT = 0.25
"""s that a phase portrait shows."""
_FEWEST = 16


class Spectrum(NamedTuple):
    """An amplitude spectrum: of a steady vibration the peak is its amplitude.

    Attributes:
        frequency: Hz (n,).
        amplitude: In the unit of the signal (n,).
    """

    frequency: Array
    amplitude: Array

    @property
    def peak(self) -> float:
        """Frequency of the largest amplitude, by a parabola through its logarithm, Hz."""
        k = int(np.argmax(self.amplitude))
        if not 0 < k < len(self.amplitude) - 1 or self.amplitude[k - 1 : k + 2].min() <= 0.0:
            return float(self.frequency[k])
        before, at, after = np.log(self.amplitude[k - 1 : k + 2])
        bend = before - 2.0 * at + after
        shift = 0.5 * (before - after) / bend if bend else 0.0
        return float(self.frequency[k] + shift * (self.frequency[1] - self.frequency[0]))


class Section(NamedTuple):
    """Displacement and velocity at the same angle of every turn (n,), m and m/s."""

    displacement: Array
    velocity: Array


@dataclass(frozen=True)
class Excerpt:
    """The last part of a run before an instant, within which the cut did not change.

    Attributes:
        title: Which excerpt of the run.
        until: Simulated time, s.
        cut: In force.
        samples: By name of column, the last `_LONGEST` s at most.
    """

    title: str
    until: float
    cut: Cut
    samples: dict[str, Array]

    @property
    def portrait(self) -> dict[str, Array]:
        """The last quarter of a second, for a phase portrait."""
        inside = self.samples['time'] > self.until - _PORTRAIT
        return {name: values[inside] for name, values in self.samples.items()}

    def size(self, name: str) -> float:
        """Peak to peak of a column in the last quarter of a second."""
        values = self.portrait[name]
        return float(np.ptp(values)) if values.size else math.nan

    @property
    def out_of_cut(self) -> float:
        """Share of the samples in which the tool cuts no chip."""
        return _share(self.portrait['chip_thickness'] <= 0.0)

    @property
    def on_bearing(self) -> float:
        """Share of the samples in which the bearing carries."""
        if self.cut.bearing_contact is BearingContact.GAP:
            touching = self.portrait['workpiece_displacement'] >= self.cut.bearing_clearance
            return _share(touching)
        return float(self.cut.bearing_contact is BearingContact.SEATED)

    def spectrum(self, name: str) -> Spectrum:
        """Amplitude spectrum of a column."""
        return spectrum(self.samples['time'], self.samples[name])

    def section(self, body: str) -> Section:
        """Of `tool` or `workpiece`, whenever the spindle comes round to the same angle."""
        return once_per_turn(
            self.samples['time'],
            self.samples['spindle_angle'],
            self.samples[f'{body}_displacement'],
            self.samples[f'{body}_velocity'],
        )


def excerpts_of(history: History) -> list[Excerpt]:
    """Two or three that are worth a closer look: before anything happened, chatter, the end."""
    end = history.duration
    disturbances = _disturbances(history)
    first = disturbances[0] if disturbances else min(history.begin + _PORTRAIT, end)
    wanted = [('before the first change' if disturbances else 'at the start', first)]
    spans = [span for span in history.chatter_spans() if span[1] > history.begin]
    if spans:
        start, stop = spans[0]
        inside = [time for time in disturbances if start < time < stop]
        wanted.append(('chatter', inside[0] if inside else stop))
    if end > wanted[-1][1]:
        wanted.append(('at the end', end))
    begins = [_undisturbed_since(history, until) for _, until in wanted]
    samples = history.samples.between(
        [(begin, until) for begin, (_, until) in zip(begins, wanted, strict=True)]
    )
    return [
        Excerpt(title, until, history.cut_at(0.5 * (begin + until)), signals)
        for (title, until), begin, signals in zip(wanted, begins, samples, strict=True)
    ]


def _disturbances(history: History) -> list[float]:
    """When the cut was changed or knocked, or its spindle reached its speed, s."""
    times = [change.time for change in history.changes] + [k.time for k in history.knocks]
    times += [ramp.end for ramp in history.ramps]
    times += [session.time for session in history.later_sessions]
    return sorted({time for time in times if history.begin < time <= history.duration})


def _undisturbed_since(history: History, until: float) -> float:
    """From when on nothing happened before an instant, s; not too long ago."""
    before = (time for time in _disturbances(history) if time < until - 1e-9)
    # The first sample is in it: a span is what comes after its begin.
    begin = history.begin - 1e-9 * (1.0 + abs(history.begin))
    return max(max(before, default=begin), until - _LONGEST)


def spectrum(time: Array, signal: Array) -> Spectrum:
    """Amplitude spectrum of a signal about its mean, with a Hann window.

    Args:
        time: Evenly spaced, s (n,).
        signal: (n,).

    Returns:
        Frequencies and amplitudes; empty for a signal too short to have any.
    """
    if signal.size < _FEWEST:
        return Spectrum(np.zeros(0), np.zeros(0))
    window = np.hanning(signal.size + 2)[1:-1]
    lines = np.abs(np.fft.rfft((signal - signal.mean()) * window))
    interval = (time[-1] - time[0]) / (time.size - 1)
    return Spectrum(np.fft.rfftfreq(signal.size, interval), 2.0 * lines / window.sum())


def once_per_turn(time: Array, angle: Array, displacement: Array, velocity: Array) -> Section:
    """Displacement and velocity at every whole turn of the spindle.

    Between two samples the motion is the cubic that has their displacements and velocities.

    Args:
        time: s (n,).
        angle: Of the spindle, rev, rising (n,).
        displacement: m (n,).
        velocity: m/s (n,).
    """
    turn = np.floor(angle)
    (k,) = np.nonzero(turn[1:] > turn[:-1])
    s = (turn[k + 1] - angle[k]) / (angle[k + 1] - angle[k])
    step = time[k + 1] - time[k]
    x, y = displacement[k], displacement[k + 1]
    u, v = step * velocity[k], step * velocity[k + 1]
    bend, twist = 3.0 * (y - x) - 2.0 * u - v, 2.0 * (x - y) + u + v
    place = x + s * (u + s * (bend + s * twist))
    slope = u + s * (2.0 * bend + s * 3.0 * twist)
    return Section(place, slope / step)


def _share(those: NDArray[np.bool_]) -> float:
    """How many of some samples are those; nan of none."""
    return float(those.mean()) if those.size else math.nan
