"""What happened in a recorded run, told from the record alone.

Topics carry no simulated time except the samples. So what another topic says is dated by when
it was recorded, against the samples recorded around it; changes of the cut say their simulated
time themselves (changes.py).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from lathe_chatter.changes import Change
from lathe_chatter.model import Array, Cut, Machine


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
        flags: Of the monitor, in order.
        estimates: Growth rate, frequency and so on by name: simulated times and values (2, m).
    """

    path: Path
    machine: Machine
    start: Cut
    samples: dict[str, Array]
    changes: list[Change] = field(default_factory=list)
    flags: list[Flag] = field(default_factory=list)
    estimates: dict[str, Array] = field(default_factory=dict)

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


def value_near(series: Array | None, time: float) -> float:
    """The value of an estimate (2, m) nearest to a time, nan where there is none."""
    if series is None or series.shape[1] == 0:
        return float('nan')
    return float(series[1, np.argmin(np.abs(series[0] - time))])
