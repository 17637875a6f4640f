"""What happened in a recorded run, told from the record alone.

Topics carry no simulated time except the samples. So what another topic says is dated by when
it was recorded, against the samples recorded around it; changes of the cut say their simulated
time themselves (changes.py).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lathe_chatter.arrays import Array
from lathe_chatter.lathe.cut_events import Change, Knock
from lathe_chatter.model import Cut, Machine
from lathe_chatter.model.parameters import cut_from, machine_from
from lathe_chatter.recording import Run, read_run
from lathe_chatter.recording.cut_log import read_cut_log
from lathe_chatter.report.run_samples import RunSamples

_FLAG = 'chatter'
_ESTIMATES = ('growth_rate', 'frequency', 'amplitude', 'recommended_speed_rpm')


@dataclass(frozen=True)
class Flag:
    """The monitor's flag rising (or falling), with its estimates about then.

    Attributes:
        time: Simulated time, s.
        chatter: What the flag said.
        frequency: Hz, nan where unknown.
        growth_rate: 1/s, nan where unknown.
    """

    time: float
    chatter: bool
    frequency: float = float('nan')
    growth_rate: float = float('nan')


class Ramp(NamedTuple):
    """The spindle on its way to a speed: from when to when, s, and between which, rev/min."""

    start: float
    end: float
    low: float
    high: float


@dataclass(frozen=True)
class History:
    """A run as arrays and occurrences.

    Attributes:
        path: The folder of the run.
        machine: As it was at the start.
        start: The cut at the start.
        samples: Of the lathe.
        changes: Of the cut, in order.
        knocks: On the tool, in order.
        flags: Of the monitor, in order.
        estimates: Growth rate, frequency and so on by name: simulated times and values (2, m).
        tool_leaves_cut: The force law, see `VirtualLathe`.
        spindle_acceleration: rev/min per s; 0 where the speed steps.
    """

    path: Path
    machine: Machine
    start: Cut
    samples: RunSamples
    changes: list[Change] = field(default_factory=list)
    knocks: list[Knock] = field(default_factory=list)
    flags: list[Flag] = field(default_factory=list)
    estimates: dict[str, Array] = field(default_factory=dict)
    tool_leaves_cut: bool = True
    spindle_acceleration: float = 0.0

    def cut_at(self, time: float) -> Cut:
        """The cut in force at a simulated time, s: what is set, and the speed that is reached."""
        values: dict[str, Any] = {}
        for change in self.changes:
            if change.time <= time:
                values |= change.new
        return self.start.with_changes(**{**values, 'spindle_speed_rpm': self.speed_at(time)})

    def speed_at(self, time: float) -> float:
        """The spindle speed that is reached at a simulated time, rev/min; without its swing."""
        speed = self.start.spindle_speed_rpm
        for ramp in self.ramps:
            if time >= ramp.end:
                speed = ramp.high
            elif time >= ramp.start:
                share = (time - ramp.start) / (ramp.end - ramp.start)
                speed = ramp.low + share * (ramp.high - ramp.low)
        return speed

    @property
    def ramps(self) -> list[Ramp]:
        """Every change of the spindle speed in order; a step takes no time."""
        found: list[Ramp] = []
        for change in self.changes:
            target = change.new.get('spindle_speed_rpm')
            if target is None:
                continue
            speed = self.start.spindle_speed_rpm
            if found:
                last = found[-1]
                speed = last.high
                if last.start <= change.time < last.end:  # turned round on its way
                    share = (change.time - last.start) / (last.end - last.start)
                    speed = last.low + share * (last.high - last.low)
                    found[-1] = last._replace(end=change.time, high=speed)
            taken = 0.0
            if self.spindle_acceleration:
                taken = abs(target - speed) / self.spindle_acceleration
            found.append(Ramp(change.time, change.time + taken, speed, float(target)))
        return found

    @property
    def begin(self) -> float:
        """Simulated time of the first sample, s."""
        return self.samples.first

    @property
    def duration(self) -> float:
        """Simulated time of the last sample, s."""
        return self.samples.last

    def chatter_spans(self) -> list[tuple[float, float]]:
        """When the flag was up: from and to, s."""
        spans: list[tuple[float, float]] = []
        since: float | None = None
        for flag in self.flags:
            if flag.chatter and since is None:
                since = flag.time
            elif not flag.chatter and since is not None:
                spans.append((since, flag.time))
                since = None
        if since is not None:
            spans.append((since, self.duration))
        return spans


def read_history(path: Path) -> History:
    """Read what happened in a recorded run.

    Raises:
        RunReadError: If there is no such run, or it has no samples.
    """
    run = read_run(path)
    topic = run.samples_topic()
    samples = RunSamples(lambda: run.sample_blocks(topic))
    if not samples.count:
        raise run.without_samples(topic)
    log = read_cut_log(run, topic.removesuffix('/samples'))
    figures = _monitor_figures(run)
    estimates = {
        name: np.array([samples.simulated_time([at for at, _ in found]), [v for _, v in found]])
        for name, found in figures.items()
        if name != _FLAG
    }
    return History(
        path=Path(path),
        machine=machine_from(log.parameters),
        start=cut_from(log.parameters),
        samples=samples,
        changes=list(log.changes),
        knocks=[
            each for session in log.sessions for each in session.events if isinstance(each, Knock)
        ],
        flags=_flags(samples, figures[_FLAG], estimates),
        estimates=estimates,
        tool_leaves_cut=bool(log.parameters.get('tool_leaves_cut', True)),
        spindle_acceleration=float(log.parameters.get('spindle_acceleration', 0.0)),
    )


def _monitor_figures(run: Run) -> dict[str, list[tuple[int, float]]]:
    """What the monitor published by name: when it was received, ns, and what; in one pass."""
    names = (*_ESTIMATES, _FLAG)
    topics = {_topic(run, f'chatter_monitor/{name}'): name for name in names}
    topics.pop('', None)
    found: dict[str, list[tuple[int, float]]] = {name: [] for name in names}
    for recorded in run.messages(*topics) if topics else ():
        found[topics[recorded.topic]].append((recorded.log_time, float(recorded.message.data)))
    return found


def _topic(run: Run, ending: str) -> str:
    """The topic of the run with this ending, empty where there is none."""
    return next((name for name in sorted(run.topics) if name.endswith(ending)), '')


def _flags(
    samples: RunSamples, published: list[tuple[int, float]], estimates: Mapping[str, Array]
) -> list[Flag]:
    """Every change of the flag."""
    flags: list[Flag] = []
    up = False
    for received, value in published:
        if bool(value) == up:
            continue
        up = bool(value)
        (time,) = samples.simulated_time([received]).tolist()
        at = {name: value_near(estimates[name], time) for name in ('frequency', 'growth_rate')}
        flags.append(Flag(time, up, **at))
    return flags


def value_near(series: Array, time: float) -> float:
    """The value of an estimate (2, m) nearest to a time, nan where there is none."""
    if series.shape[1] == 0:
        return math.nan
    return float(series[1, np.argmin(np.abs(series[0] - time))])
