"""Recordings that a user has, with their labels: the detector beside what others would do.

In the folder, or in those inside it, `cut.wav` (or .csv, .mat, .parquet, .mcap) goes with
`cut.labels.csv`, rows of start, end (s) and state; what says `chatter` is chatter, and what has no
row does not count. The detector is told nothing. The thresholds of the others are those that are
best on the other recordings of the folder, or of the one itself where it is alone.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.detection import ChatterDetector
from lathe_chatter.executors import spread
from lathe_chatter.listening import Score, Signals, judge, read_signals
from lathe_chatter.listening.detector_score import Label, read_labels, score_of

_FORMS = ('.wav', '.csv', '.mat', '.parquet', '.mcap')
_HOP, _RMS = 0.02, 0.05
"""s from one value to the next, and over which an RMS is taken."""
_TURNS = 8
_TRIED = 60
"""Thresholds that are tried."""


class Heard(NamedTuple):
    """One recording: times, s, the flag of the detector there, and what others make of it (n,)."""

    name: str
    times: Array
    flagged: Array
    others: dict[str, Array]
    labels: list[Label]


def recordings(options: Any) -> list[str]:
    """Score the labelled recordings in a folder."""
    if options.folder is None:
        sys.exit('recordings: name the folder, as in `recordings FOLDER`')
    pairs = _pairs(options.folder)
    if not pairs:
        sys.exit(f'{options.folder} has no recording with labels: cut.wav and cut.labels.csv')
    heard = spread(_listen, pairs, executor=options.executor)
    lines = [f'{len(heard)} recordings, {sum(each.times[-1] for each in heard):.0f} s']
    if len(heard) > 1:
        lines += [_line(f'  {h.name}', score_of(h.times, h.flagged > 0, h.labels)) for h in heard]
    lines.append(_line('this detector', _pooled(heard, [each.flagged > 0 for each in heard])))
    for name in ('raw RMS', 'once-per-turn variance'):
        known = [each for each in heard if name in each.others]
        if known:
            thresholds = [_best(known, k, name) for k in range(len(known))]
            flags = [h.others[name] >= t for h, t in zip(known, thresholds, strict=True)]
            lines.append(_line(name, _pooled(known, flags)))
        else:
            lines.append(f'{name}: needs a spindle angle, and there is none')
    return lines


def _pairs(folder: Path) -> list[tuple[Path, Path]]:
    found = []
    for labels in sorted(folder.rglob('*.labels.csv')):
        stem = labels.name.removesuffix('.labels.csv')
        files = [labels.with_name(stem + form) for form in _FORMS]
        found += [(file, labels) for file in files if file.exists()][:1]
    return found


def _listen(pair: tuple[Path, Path]) -> Heard:
    file, labels = pair
    signals = read_signals(file)
    judged = judge(signals, ChatterDetector(None))
    times = np.nan_to_num(judged.times, nan=0.0)
    kept = np.r_[True, np.diff(times) > 0.0]
    times = times[kept]
    return Heard(
        file.name,
        times,
        judged.flagged[kept].astype(float),
        _others(signals, times),
        read_labels(labels),
    )


def _others(signals: Signals, times: Array) -> dict[str, Array]:
    """Raw RMS, and the part of the variance that is no function of the spindle angle, at times."""
    names = [n for n in signals.columns if n not in {'time', 'spindle_angle', 'spindle_pulse'}]
    time, value = signals.samples[:, 0], signals.samples[:, signals.columns.index(names[0])]
    value = value - np.median(value)
    sums = np.concatenate([[0.0], np.cumsum(value**2)])
    ends = np.searchsorted(time, times, side='right')
    begins = np.maximum(ends - round(_RMS * signals.rate), 0)
    rms = np.sqrt((sums[ends] - sums[begins]) / np.maximum(ends - begins, 1))
    found = {'raw RMS': rms}
    if 'spindle_angle' in signals.columns:
        angle = signals.samples[:, signals.columns.index('spindle_angle')]
        marks = np.arange(np.ceil(angle[0]), np.floor(angle[-1]))
        at, when = np.interp(marks, angle, value), np.interp(marks, angle, time)
        share = np.zeros(len(times))
        for k, now in enumerate(times):
            last = int(np.searchsorted(when, now))
            if last >= _TURNS:
                whole = value[np.searchsorted(time, when[last - _TURNS]) : ends[k]]
                share[k] = at[last - _TURNS : last].var() / max(float(whole.var()), 1e-300)
        found['once-per-turn variance'] = share
    return found


def _best(heard: Sequence[Heard], own: int, name: str) -> float:
    """The threshold with the best F1 of seconds on the others."""
    others = [h for k, h in enumerate(heard) if k != own] or [heard[own]]
    values = np.concatenate([each.others[name] for each in others])
    tried = np.unique(np.quantile(values, np.linspace(0.01, 0.999, _TRIED)))
    scores = [_pooled(others, [each.others[name] >= t for each in others]).f1 for t in tried]
    return float(tried[int(np.nanargmax(scores))]) if np.isfinite(scores).any() else np.inf


def _pooled(heard: Sequence[Heard], flags: Sequence[Any]) -> Score:
    """The score of all of them, one after the other."""
    times, labels, begin = [], [], 0.0
    for each in heard:
        times.append(each.times + begin)
        labels += [Label(la.start + begin, la.end + begin, la.state) for la in each.labels]
        begin += float(each.times[-1]) + 10.0
    return score_of(np.concatenate(times), np.concatenate(list(flags)), labels)


def _line(name: str, found: Score) -> str:
    hourly = found.false_alarms / found.quiet_hours if found.quiet_hours else np.nan
    return (
        f'{name:30s} F1 of seconds {found.f1:.3f}, of events {found.event_f1:.3f} '
        f'({found.found} of {found.events}), {found.false_alarms} false alarms in '
        f'{3600.0 * found.quiet_hours:.0f} quiet s = {hourly:.1f} an hour, '
        f'delay {found.delay:.2f} s'
    )
