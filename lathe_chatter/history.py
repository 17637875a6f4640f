"""What happened in a recorded run, told from the record alone.

Topics carry no simulated time except the samples. So what another topic says is dated by when
it was recorded, against the samples recorded around it; changes of the cut say their simulated
time themselves (changes.py).
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from lathe_chatter.changes import Change, parse_change
from lathe_chatter.model import Array, Cut, Machine, Mode
from lathe_chatter.recording import Run, read_run
from lathe_chatter.recording.identity import PARAMETERS
from lathe_chatter.recording.reader import Samples

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


def read_history(path: Path) -> History:
    """Read what happened in a recorded run.

    Raises:
        RunReadError: If there is no such run, or it has no samples.
    """
    run = read_run(path)
    samples = run.samples()
    lathe = _topic(run, '/samples').removesuffix('/samples')
    parameters = _parameters(run, lathe)
    changes = _changes(run, lathe)
    for change in reversed(changes):
        parameters |= change.old
    estimates = {name: _series(run, samples, f'/{name}') for name in _ESTIMATES}
    return History(
        path=Path(path),
        machine=_machine(parameters),
        start=Cut(**{n: v for n, v in parameters.items() if n in Cut.__dataclass_fields__}),
        samples=samples.columns,
        changes=changes,
        flags=_flags(run, samples, estimates),
        estimates=estimates,
    )


def _topic(run: Run, ending: str) -> str:
    """The topic of the run with this ending, empty where there is none."""
    return next((name for name in sorted(run.topics) if name.endswith(ending)), '')


def _parameters(run: Run, lathe: str) -> dict[str, Any]:
    """The parameters with which the lathe was started.

    It announces them to the readers that it waits for. Where it waited for none, the recorder
    has asked, perhaps after the first change; what that changed is told by `_changes`.
    """
    found: dict[str, Any] = {}
    for recorded in run.messages('/parameter_events'):
        if recorded.message.node == lathe:
            for parameter in recorded.message.new_parameters:
                found.setdefault(parameter.name, _value(parameter.value))
    for note in run.notes():
        if note.name == PARAMETERS + lathe:
            found = {**json.loads(note.values['parameters']), **found}
    return found


def _value(value: Any) -> Any:
    """What an rcl_interfaces ParameterValue holds."""
    kinds = {1: 'bool_value', 2: 'integer_value', 3: 'double_value', 4: 'string_value'}
    return getattr(value, kinds[value.type]) if value.type in kinds else None


def _machine(parameters: Mapping[str, Any]) -> Machine:
    """The machine among the parameters of a lathe."""

    def mode(part: str, usual: Mode) -> Mode:
        names = [entry.name for entry in fields(Mode)]
        return Mode(**{n: parameters.get(f'{part}.{n}', getattr(usual, n)) for n in names})

    usual = Machine()
    plain = ('bearing_stiffness', 'cutting_coefficient')
    return Machine(
        tool=mode('tool', usual.tool),
        workpiece=mode('workpiece', usual.workpiece),
        **{name: parameters[name] for name in plain if name in parameters},
    )


def _changes(run: Run, lathe: str) -> list[Change]:
    """The changes of the cut that the lathe logged."""
    logger = lathe.lstrip('/').replace('/', '.')
    found = [
        parse_change(recorded.message.msg)
        for recorded in run.messages('/rosout')
        if recorded.message.name == logger
    ]
    return sorted(filter(None, found), key=lambda change: change.time)


def _series(run: Run, samples: Samples, ending: str) -> Array:
    """A figure of the monitor over simulated time (2, m)."""
    topic = _topic(run, f'chatter_monitor{ending}')
    pairs = [
        (samples.simulated_time(recorded.log_time), recorded.message.data)
        for recorded in (run.messages(topic) if topic else ())
    ]
    return np.array(pairs).reshape(-1, 2).T


def _flags(run: Run, samples: Samples, estimates: Mapping[str, Array]) -> list[Flag]:
    """Every change of the flag."""
    topic = _topic(run, 'chatter_monitor/chatter')
    flags: list[Flag] = []
    up = False
    for recorded in run.messages(topic) if topic else ():
        if recorded.message.data == up:
            continue
        up = recorded.message.data
        time = samples.simulated_time(recorded.log_time)
        at = {name: value_near(estimates[name], time) for name in ('frequency', 'growth_rate')}
        flags.append(Flag(time, up, **at))
    return flags


def value_near(series: Array, time: float) -> float:
    """The value of an estimate (2, m) nearest to a time, nan where there is none."""
    if series.shape[1] == 0:
        return math.nan
    return float(series[1, np.argmin(np.abs(series[0] - time))])
