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
from typing import Any

import numpy as np

from lathe_chatter.arrays import Array
from lathe_chatter.lathe.cut_events import Change, Knock
from lathe_chatter.model import Cut, Machine
from lathe_chatter.model.parameters import cut_from, machine_from
from lathe_chatter.recording import Run, read_run
from lathe_chatter.recording.cut_log import read_cut_log
from lathe_chatter.recording.run import Samples

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


@dataclass(frozen=True)
class History:
    """A run as arrays and occurrences.

    Attributes:
        path: The folder of the run.
        machine: As it was at the start.
        start: The cut at the start.
        samples: By name of column (n,), SI.
        changes: Of the cut, in order.
        knocks: On the tool, in order.
        flags: Of the monitor, in order.
        estimates: Growth rate, frequency and so on by name: simulated times and values (2, m).
        tool_leaves_cut: The force law, see `VirtualLathe`.
    """

    path: Path
    machine: Machine
    start: Cut
    samples: dict[str, Array]
    changes: list[Change] = field(default_factory=list)
    knocks: list[Knock] = field(default_factory=list)
    flags: list[Flag] = field(default_factory=list)
    estimates: dict[str, Array] = field(default_factory=dict)
    tool_leaves_cut: bool = True

    def cut_at(self, time: float) -> Cut:
        """The cut in force at a simulated time, s."""
        values: dict[str, Any] = {}
        for change in self.changes:
            if change.time <= time:
                values |= change.new
        return self.start.with_changes(**values)

    @property
    def duration(self) -> float:
        """Simulated time of the last sample, s."""
        time = self.samples['time']
        return float(time[-1]) if len(time) else 0.0

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
    samples = run.samples()
    lathe = _topic(run, '/samples').removesuffix('/samples')
    log = read_cut_log(run, lathe)
    estimates = {name: _series(run, samples, f'/{name}') for name in _ESTIMATES}
    return History(
        path=Path(path),
        machine=machine_from(log.parameters),
        start=cut_from(log.parameters),
        samples=samples.columns,
        changes=list(log.changes),
        knocks=[
            each for session in log.sessions for each in session.events if isinstance(each, Knock)
        ],
        flags=_flags(run, samples, estimates),
        estimates=estimates,
        tool_leaves_cut=bool(log.parameters.get('tool_leaves_cut', True)),
    )


def _topic(run: Run, ending: str) -> str:
    """The topic of the run with this ending, empty where there is none."""
    return next((name for name in sorted(run.topics) if name.endswith(ending)), '')


def _series(run: Run, samples: Samples, ending: str) -> Array:
    """A figure of the monitor over simulated time (2, m)."""
    topic = _topic(run, f'chatter_monitor{ending}')
    found = [*run.messages(topic)] if topic else []
    times = samples.simulated_time([each.log_time for each in found])
    return np.array([times, [each.message.data for each in found]])


def _flags(run: Run, samples: Samples, estimates: Mapping[str, Array]) -> list[Flag]:
    """Every change of the flag."""
    topic = _topic(run, 'chatter_monitor/chatter')
    flags: list[Flag] = []
    up = False
    for recorded in run.messages(topic) if topic else ():
        if recorded.message.data == up:
            continue
        up = recorded.message.data
        (time,) = samples.simulated_time([recorded.log_time]).tolist()
        at = {name: value_near(estimates[name], time) for name in ('frequency', 'growth_rate')}
        flags.append(Flag(time, up, **at))
    return flags


def value_near(series: Array, time: float) -> float:
    """The value of an estimate (2, m) nearest to a time, nan where there is none."""
    if series.shape[1] == 0:
        return math.nan
    return float(series[1, np.argmin(np.abs(series[0] - time))])
