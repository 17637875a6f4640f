"""Excerpts of a run in which the cut is one: its size, its spectrum, and once in every turn."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lathe_chatter.array_types import Array
from lathe_chatter.model import BearingContact, Cut, Machine
from lathe_chatter.report.run_history import History, Session

_LONGEST = 207.0
"""Periods of the lowest mode that an excerpt has at most; of the paper's machine, 2 s."""
_TURNS = 30.0
"""Turns that it may last in any case."""
_MOST_SAMPLES = 1_000_000
_PORTRAIT = 26.0
"""Periods of the lowest mode that a phase portrait shows; of the paper's machine, 0.25 s."""
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
        samples: By name of column.
        session: Of which it is.
    """

    title: str
    until: float
    cut: Cut
    samples: dict[str, Array]
    session: Session

    @property
    def portrait(self) -> dict[str, Array]:
        """The last periods, for a phase portrait."""
        inside = self.samples['time'] > self.until - _PORTRAIT * _period(self.session.machine)
        return {name: values[inside] for name, values in self.samples.items()}

    def size(self, name: str) -> float:
        """Peak to peak of a column in the last periods."""
        values = self.portrait[name]
        return float(np.ptp(values)) if values.size else math.nan

    @property
    def out_of_cut(self) -> float:
        """Share of the samples in which the tool cuts no chip."""
        return _share(self.portrait['chip_thickness'] <= 0.0)

    @property
    def on_bearing(self) -> float:
        """Share of the samples in which the bearing carries; nan where no sample tells it."""
        contact, gap = self.cut.bearing_contact, self.cut.bearing_clearance
        if contact in {BearingContact.NONE, BearingContact.SEATED}:
            return float(contact is BearingContact.SEATED)
        if not clearance_is_seen(self.cut, self.session.machine):
            return math.nan
        place = self.portrait['workpiece_displacement']
        return _share((np.abs(place) if contact is BearingContact.BOTH_SIDES else place) >= gap)

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


def clearance_is_seen(cut: Cut, machine: Machine) -> bool:
    """Whether the workpiece displacement of the samples is that at a bearing with clearance."""
    with_clearance = cut.bearing_contact in {BearingContact.GAP, BearingContact.BOTH_SIDES}
    modes = machine.workpiece.modes
    return with_clearance and all(mode.bearing == mode.chip for mode in modes)


def _period(machine: Machine) -> float:
    """Of the slowest mode, s."""
    modes = (*machine.tool.modes, *machine.workpiece.modes)
    return 2.0 * math.pi / min(mode.natural_frequency for mode in modes)


def excerpts_of(history: History) -> list[Excerpt]:
    """Two or three that are worth a closer look: before anything happened, chatter, the end."""
    end = history.duration
    disturbances = _disturbances(history)
    periods = _PORTRAIT * _period(history.sessions[0].machine)
    first = disturbances[0] if disturbances else min(history.begin + periods, end)
    wanted = [('before the first change' if disturbances else 'at the start', first)]
    spans = [span for span in history.chatter_spans() if span[1] > history.begin]
    if spans:  # a short one may be a false alarm
        start, stop = max(spans, key=lambda span: span[1] - span[0])
        inside = [time for time in disturbances if start < time < stop]
        wanted.append(('chatter', inside[0] if inside else stop))
    if end > wanted[-1][1]:
        wanted.append(('at the end', end))
    begins = [_undisturbed_since(history, until) for _, until in wanted]
    samples = history.samples.between(
        [(begin, until) for begin, (_, until) in zip(begins, wanted, strict=True)]
    )
    return [
        Excerpt(
            title, until, history.cut_at(0.5 * (begin + until)), signals, history.session_at(until)
        )
        for (title, until), begin, signals in zip(wanted, begins, samples, strict=True)
    ]  # fmt: skip


def _disturbances(history: History) -> list[float]:
    """When the cut was changed or knocked, or its spindle reached its speed, s."""
    knocks = (knock.time for knock in history.knocks)
    inside = {time for time in knocks if history.begin < time <= history.duration}
    return sorted(history.edges | inside)


def _undisturbed_since(history: History, until: float) -> float:
    """From when on nothing happened before an instant, s; not too long ago."""
    before = (time for time in _disturbances(history) if time < until - 1e-9)
    # The first sample is in it: a span is what comes after its begin.
    begin = history.begin - 1e-9 * (1.0 + abs(history.begin))
    machine, cut = history.session_at(until).machine, history.cut_at(until)
    longest = max(_LONGEST * _period(machine), _TURNS * cut.delay)
    longest = min(longest, _MOST_SAMPLES * history.samples.step)
    return max(max(before, default=begin), until - longest)


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

    Between two samples the displacement is the cubic that has their displacements and velocities,
    the velocity that through the two velocities on either side: taken from displacements it
    would have the noise of their sensor over the step between two samples.

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
    ends = 2.0 * velocity[:1] - velocity[1:2], 2.0 * velocity[-1:] - velocity[-2:-1]
    wide = np.concatenate([ends[0], velocity, ends[1]])
    p, q = s * (s - 1.0), (s + 1.0) * (s - 2.0)
    inner = 0.5 * q * ((s - 1.0) * velocity[k] - s * velocity[k + 1])
    outer = p * ((s + 1.0) * wide[k + 3] - (s - 2.0) * wide[k]) / 6.0
    return Section(x + s * (u + s * (bend + s * twist)), inner + outer)


def _share(those: NDArray[np.bool_]) -> float:
    """How many of some samples are those; nan of none."""
    return float(those.mean()) if those.size else math.nan
