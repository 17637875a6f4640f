"""What the detector says of a recording over time, and how right that is by its labels."""

from __future__ import annotations

import csv
import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lathe_chatter.array_types import Array
from lathe_chatter.detection import ChatterDetector, Estimate
from lathe_chatter.detection.estimate import IDLE, STABLE, STATES, UNKNOWN
from lathe_chatter.errors import SignalFileError, reason_of
from lathe_chatter.listening.signal_file import Signals

_BLOCK = 0.02
"""s of samples that are judged at once."""
_LATE = 0.5
"""s within which a flag belongs to the chatter that began before it."""
CHATTER = 'chatter'
_HEAD = ['start', 'end', 'state']
_CALM = {STABLE, IDLE, UNKNOWN}


class Spell(NamedTuple):
    """A time in which the state was one.

    Attributes:
        time: Of its first estimate, s.
        state: As in `Estimate`.
        chatter: Whether it was flagged at first.
        frequency: Median of its estimates, Hz; the first ones may be far off. Nan without any, and
            where nothing vibrates by itself: without a machine it is then that of some noise.
        growth_rate: Likewise, 1/s.
    """

    time: float
    state: str
    chatter: bool
    frequency: float
    growth_rate: float


@dataclass(frozen=True)
class Judged:
    """Estimates over time, one for each block of samples."""

    estimates: tuple[Estimate, ...]

    @property
    def times(self) -> Array:
        """Of the estimates, s (n,)."""
        return np.array([each.time for each in self.estimates])

    @property
    def flagged(self) -> NDArray[np.bool_]:
        """Whether chatter is flagged (n,)."""
        return np.array([each.chatter for each in self.estimates], bool)

    def spells(self) -> list[Spell]:
        """The states in order."""
        timed = (each for each in self.estimates if math.isfinite(each.time))
        found = []
        for state, each in itertools.groupby(timed, lambda estimate: estimate.state):
            every = list(each)
            inside = [e for e in every if state not in _CALM or e.mode.knows_machine]
            figures = (_settled(inside, name) for name in ('frequency', 'growth_rate'))
            found.append(Spell(every[0].time, state, every[0].chatter, *figures))
        return found


def _settled(estimates: Sequence[Estimate], name: str) -> float:
    values = [getattr(each, name) for each in estimates]
    known = [value for value in values if math.isfinite(value)]
    return float(np.median(known)) if known else math.nan


def judge(
    signals: Signals,
    detector: ChatterDetector,
    progress: Callable[[float], object] = lambda _seconds: None,
) -> Judged:
    """Let a detector listen to a recording.

    Args:
        signals: The recording.
        detector: That has heard nothing yet.
        progress: Is told how many more seconds have been judged.

    Raises:
        LayoutError: If there is nothing in it that can be listened to.
    """
    rate = signals.rate
    count = max(1, round(_BLOCK * rate))
    found = []
    for begin in range(0, len(signals.samples), count):
        block = signals.samples[begin : begin + count]
        found.append(detector.update(block, signals.columns))
        progress(len(block) / rate)
    return Judged(tuple(found))


class Label(NamedTuple):
    """What was the case from one time to another, s."""

    start: float
    end: float
    state: str


def read_labels(path: Path) -> list[Label]:
    """Read a CSV of rows `start,end,state`, the state as in `Estimate`; it may have that head.

    Raises:
        SignalFileError: If it is none, a state is not known, or rows say two things of one time.
    """
    found = dict[int, Label]()
    try:
        with path.open(encoding='utf-8-sig', newline='') as stream:
            rows = [*csv.reader(stream)]
    except (OSError, ValueError, csv.Error) as error:
        raise SignalFileError(f'{path} cannot be read: {reason_of(error)}.') from None
    for number, row in enumerate(rows, 1):
        if not row or (number == 1 and [name.strip().lower() for name in row] == _HEAD):
            continue
        try:
            label = Label(float(row[0]), float(row[1]), row[2].strip().lower())
        except (IndexError, ValueError):
            head = ', or the head start,end,state' if number == 1 else ''
            raise SignalFileError(
                f'{path}, row {number} is {",".join(row)}: it must be start (s), end (s), '
                f'state{head}.'
            ) from None
        if not label.start < label.end:
            raise SignalFileError(
                f'{path}, row {number}: {label.start:g} s is not before its end.'
            )
        if label.state not in STATES:
            raise SignalFileError(
                f'{path}, row {number}: the state {row[2].strip()!r} must be one of '
                f'{", ".join(STATES)}.'
            )
        for before, other in found.items():
            if other.state != label.state and max(other[0], label[0]) < min(other[1], label[1]):
                raise SignalFileError(
                    f'{path}: row {before} ({_as_row(other)}) and row {number} ({_as_row(label)}) '
                    'overlap: at one time there is one state.'
                )
        found[number] = label
    if not found:
        raise SignalFileError(f'{path} has no rows: it must have start (s), end (s), state.')
    return [*found.values()]


def labels_beyond(labels: Sequence[Label], signals: Signals) -> list[str]:
    """What is to be known of labels that are scored in part: they reach beyond the recording.

    Raises:
        SignalFileError: If one lies beyond it as a whole, as those of another recording do.
    """
    begin, end = signals.samples[0, 0], signals.samples[-1, 0] + 1.0 / signals.rate
    lasts = f'the recording, which lasts from {begin:.6g} to {end:.6g} s'
    for label in labels:
        if label.end <= begin or label.start >= end:
            raise SignalFileError(f'The label {_as_row(label)} must lie in {lasts}.')
    return [
        f'The label {_as_row(label)} reaches beyond {lasts}: only what is in it is scored.'
        for label in labels
        if label.start < begin - _BLOCK or label.end > end + _BLOCK
    ]


def _as_row(label: Label) -> str:
    return f'{label.start:g},{label.end:g},{label.state}'


@dataclass(frozen=True)
class Score:
    """How right the flag was.

    Attributes:
        f1: Of the labelled seconds: harmonic mean of what part of the flagged was chatter, and
            what part of the chatter was flagged; nan without chatter and without a flag.
        event_f1: The same of the stretches of chatter.
        seconds: That are labelled.
        events: Stretches of chatter.
        found: Of them that were flagged.
        delay: From the beginning of such a stretch to its flag, 0 where that was up, median, s.
        false_alarms: Flags that rose outside of chatter.
        quiet_hours: Labelled hours without chatter, against which they count.
    """

    f1: float
    event_f1: float
    seconds: float
    events: int
    found: int
    delay: float
    false_alarms: int
    quiet_hours: float


def score(judged: Judged, labels: Sequence[Label]) -> Score:
    """Hold the flag against labels; what has none, or that of unknown, does not count."""
    return score_of(judged.times, judged.flagged, labels)


def score_of(times: Array, flagged: NDArray[np.bool_], labels: Sequence[Label]) -> Score:
    """The same of a flag at some times, s (n,) both; a time that is no number is left out."""
    known, labels = np.isfinite(times), [each for each in labels if each.state != UNKNOWN]
    times, flagged = times[known], flagged[known]
    labelled, chatter = np.zeros(len(times), bool), np.zeros(len(times), bool)
    delays, events = [], [label for label in labels if label.state == CHATTER]
    for label in labels:
        inside = (times > label.start) & (times <= label.end)
        labelled |= inside
        if label.state == CHATTER:
            chatter |= inside
            raised = times[inside & flagged]
            if len(raised):
                up = flagged[: np.searchsorted(times, raised[0], 'left')][-1:].any()
                delays.append(0.0 if up else float(raised[0]) - label.start)
    rises = np.flatnonzero(flagged & ~np.r_[False, flagged[:-1]])
    near = [any(label.start <= times[k] <= label.end + _LATE for label in events) for k in rises]
    steps = np.diff(times)
    fresh = np.r_[True, steps > 0.0][: len(times)]  # blocks shorter than a hop repeat an estimate
    period = float(np.median(steps[steps > 0.0])) if fresh.sum() > 1 else 0.0
    false = int(np.sum(labelled[rises] & ~np.array(near, bool))) if len(rises) else 0
    return Score(
        f1_of(int(np.sum(flagged & chatter)), int(np.sum((flagged != chatter) & labelled))),
        f1_of(len(delays), len(events) - len(delays) + false),
        float((labelled & fresh).sum()) * period,
        len(events),
        len(delays),
        float(np.median(delays)) if delays else math.nan,
        false,
        float((labelled & ~chatter & fresh).sum()) * period / 3600.0,
    )


def f1_of(right: int, wrong: int) -> float:
    """Harmonic mean of precision and recall: what was found, and what was missed or invented."""
    return 2 * right / (2 * right + wrong) if right + wrong else math.nan
