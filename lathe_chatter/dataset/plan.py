"""A plan: which machines, cuts, sensors and events a data set has, read from YAML.

docs/how_to/datasets.md has every field.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml

from lathe_chatter.errors import MachineFileError, ParameterError, PlanError, reason_of
from lathe_chatter.lathe.config import config_from
from lathe_chatter.lathe.virtual_lathe import IMPULSE
from lathe_chatter.model.lathe_parameter_table import CUT_ROWS, LATHE, MACHINE_FILE, MACHINE_ROWS
from lathe_chatter.model.machine_file import MachineDescription, load_machine
from lathe_chatter.model.parameter_table import Row
from lathe_chatter.model.quantity_fields import Quantity
from lathe_chatter.model.uncertainty import uncertainty_from
from lathe_chatter.model.yaml_section import Section, section_of, text_of
from lathe_chatter.samples import sample_columns

UNIFORM, LOG_UNIFORM, NORMAL, CHOICE = 'uniform', 'log_uniform', 'normal', 'choice'
FACTOR = Row('of_limit', 1.0, '', Quantity('multiple of the safe depth', high=100.0))
_ANY = Quantity('', low=-math.inf)
_SPREADS = 6.0
"""Standard deviations that a normal value may lie off its mean before it is drawn again."""
OF_FILE = 'file'
"""Stands for the errors that a machine file has."""
CUT = {row.name: row for row in CUT_ROWS if not row.name.startswith('speed_variation')}
"""What may be drawn of a cut; of a varied speed no single root is the truth."""
_MACHINE = {row.name: row for row in (MACHINE_FILE, *MACHINE_ROWS, LATHE['tool_leaves_cut'])}
_COUNT, _TIME = Quantity('', low=1.0, high=1e9), Quantity('', 's', high=3600.0)
_SHARE = Quantity('a share', high=1.0)
_TOP = [Row('title', '', ''), LATHE['seed'], Row('duration', 2.0, '', _TIME)]
_TOP += [Row('machines', 100, '', _COUNT), Row('runs', 1, '', _COUNT)]
_INNER = ('machine', 'cut', 'sensors', 'events', 'windows', 'splits')
_WINDOWS = [Row(name, 0.0, '', _TIME) for name in ('length', 'every', 'first')]
_DRAWN = {'at': Row('at', 0.0, '', _TIME), 'knock': Row('knock', 0.0, '', IMPULSE)}
_EVENT = [Row('share', 1.0, '', _SHARE), Row('over', 0.0, '', _TIME)]


class Form(str, Enum):
    """What a data set is written as."""

    PARQUET, HDF5, ZARR, MCAP = 'parquet', 'hdf5', 'zarr', 'mcap'


class Distribution(NamedTuple):
    """How a value is drawn.

    Attributes:
        kind: One of the above.
        values: Lowest and highest; mean and standard deviation; or the choices, of which there
            may be one.
        limits: Of a normal value.
        of_limit: Whether the value is a multiple of the safe depth of the cut.
    """

    kind: str
    values: tuple[Any, ...]
    limits: Quantity
    of_limit: bool = False

    def draw(self, rng: np.random.Generator) -> Any:
        """A value."""
        first, last = self.values[0], self.values[-1]
        if self.kind == CHOICE:
            return self.values[int(rng.integers(len(self.values)))]
        if self.kind == UNIFORM:
            return first + (last - first) * rng.random()
        if self.kind == LOG_UNIFORM:
            return min(max(first * math.exp(math.log(last / first) * rng.random()), first), last)
        while True:
            value = first + last * rng.standard_normal()
            near = abs(value - first) <= _SPREADS * last
            if near and self.limits.low <= value <= self.limits.high:
                return value


Drawn = dict[str, Distribution]
"""How parameters are drawn, by name."""


class Event(NamedTuple):
    """Something that happens in a share of the runs."""

    at: Distribution  # s
    changes: Drawn  # of the cut, by parameter
    knock: Distribution | None  # on the tool, N s
    share: float
    over: float  # s that the changes take, in even steps; 0 is at once


@dataclass(frozen=True)
class Plan:
    """What a data set is, as in the file; windows in samples."""

    title: str = field(repr=False)
    seed: int
    machines: int
    runs: int  # of each machine
    duration: float  # of a run, s
    form: Form
    machine: Drawn  # drawn for each machine, by parameter; its files as text
    doubts: tuple[str, ...] = field(repr=False)  # what those files lack, in sentences
    errors: str  # of the machine, as `uncertainty_from` takes them, or `OF_FILE`
    cut: Drawn  # drawn for each run, by parameter
    columns: tuple[str, ...]
    sample_rate: float  # Hz
    events: tuple[Event, ...]
    samples: int  # of a run
    length: int  # of a window
    starts: range  # samples at which the windows of a run begin
    splits: dict[str, float]  # shares of the machines
    text: str = field(repr=False)

    @property
    def windows(self) -> int:
        """In all, where no run ends early."""
        return self.machines * self.runs * len(self.starts)

    @property
    def drawn(self) -> list[str]:
        """The parameters that differ from window to window, in the order of the table."""
        names = {'spindle_speed_rpm', 'depth_of_cut', *(n for e in self.events for n in e.changes)}
        names |= {n for n, how in (self.machine | self.cut).items() if len(how.values) > 1}
        return [row.name for row in LATHE if row.name in names - {MACHINE_FILE.name}]

    def machines_of(self) -> dict[str, range]:
        """The machines of each split: as each is drawn by itself, any are a fair choice."""
        edges = [round(self.machines * s) for s in itertools.accumulate(self.splits.values())]
        ranges = itertools.starmap(range, itertools.pairwise([0, *edges]))
        return dict(zip(self.splits, ranges, strict=True))


def load_plan(path: Path | str) -> Plan:
    """Read and check a plan.

    Raises:
        PlanError: With file, line, field, value, unit and what is allowed.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding='utf-8')
        return _plan(section_of(text, str(path)), path, text)
    except (OSError, UnicodeDecodeError) as error:
        raise PlanError(f'The plan {path} cannot be read: {reason_of(error)}.') from None
    except MachineFileError as error:
        raise PlanError(str(error)) from None
    except ParameterError as error:
        raise PlanError(f'{path}: {error}') from None


def _plan(top: Section, path: Path, text: str) -> Plan:
    values = _values_of(top, [*_TOP, Row('form', 'parquet', '', choices=Form)], *_INNER)
    sensors, windows = top.inner('sensors'), top.inner('windows')
    events = top.items('events') if 'events' in top.nodes else ()
    rate = _values_of(sensors, [LATHE['sample_rate']], 'columns')['sample_rate']
    samples = round(values['duration'] * rate)
    # What is shorter than a sample is one.
    spans = (math.ceil(v * rate - 1e-6) for v in _values_of(windows, _WINDOWS).values())
    length, every, first = spans
    if not 1 <= (length := length or samples - first) <= samples - first:
        raise windows.refused(f'a window must lie within the run of {values["duration"]:g} s')
    return Plan(
        **{**values, 'title': values['title'] or path.stem, 'form': Form(values['form'])},
        **_machine(top.inner('machine'), path),
        cut=_distributions(top.inner('cut'), CUT),
        columns=_columns(sensors),
        sample_rate=rate,
        events=tuple(_event(each, values['duration']) for each in events),
        samples=samples,
        length=length,
        starts=range(first, samples - length + 1, every or length),
        splits=_splits(top.inner('splits')),
        text=text,
    )


def _machine(section: Section, path: Path) -> dict[str, Any]:
    """What a plan has of its machines, by field."""
    errors = _values_of(section, [Row('errors', '', '')], *_MACHINE)['errors']
    drawn = _distributions(section, _MACHINE, 'errors')
    given, described = drawn.get(MACHINE_FILE.name), {'no file that': MachineDescription()}
    if given:
        places = {source: path.parent / source for source in given.values}
        try:
            described = {s: load_machine(p if p.is_file() else s) for s, p in places.items()}
        except MachineFileError as error:
            said, node = str(error).rstrip('.'), section.nodes['machine']
            raise section.refused(said, node, 'machine') from None
        texts = tuple(described[source].text() for source in given.values)
        drawn[MACHINE_FILE.name] = given._replace(values=texts)
    firsts, doubts = {name: how.values[0] for name, how in drawn.items()}, list[str]()
    for source, one in described.items():
        config = config_from({**firsts, MACHINE_FILE.name: one.text() if given else ''})
        doubts += filter(None, [one.assumption(config.machine, config.cut)])
        if errors == OF_FILE and not one.uncertainty:
            raise section.refused(f'errors is file: {source} has none')
        if errors != OF_FILE:
            uncertainty_from(errors, one.machine)
    return {'machine': drawn, 'errors': errors, 'doubts': tuple(doubts)}


def _columns(section: Section) -> tuple[str, ...]:
    node, known = section.nodes.get('columns'), sample_columns(accelerometers=True)
    if node is None:
        return ('tool_displacement', 'workpiece_displacement')
    names = tuple(map(text_of, node.value)) if isinstance(node, yaml.SequenceNode) else ()
    if 0 < len(names) == len({*names} & {*known}):
        return names
    raise section.refused(f'columns must be a list of some of {", ".join(known)}', node)


def _event(entry: Section, duration: float) -> Event:
    single = _values_of(entry, _EVENT, *_DRAWN, 'set')
    at, knock = map(_distributions(entry, _DRAWN, *single, 'set').get, _DRAWN)
    changes = _distributions(entry.inner('set'), CUT)
    if at is None or not (changes or knock):
        raise entry.refused('an event needs at, and set or knock')
    first = min(at.values) if at.kind == CHOICE else at.values[0]
    if first >= duration:
        raise entry.refused(f'at is {first:g} s, and the run ends at {duration:g} s')
    if single['over'] and (words := [n for n in changes if CUT[n].limits is None]):
        raise entry.refused(f'{words[0]} can only change at once, without over')
    return Event(at, changes, knock, **single)


def _splits(section: Section) -> dict[str, float]:
    shares = section.values(dict.fromkeys(section.nodes, Row('', 0.0, '', _SHARE)))
    if shares and abs(sum(shares.values()) - 1.0) > 1e-9:
        raise section.refused('the shares must add up to 1')
    if wrong := [name for name in shares if not name.isidentifier()]:
        raise section.refused(f'{wrong[0]!r} must be a name of letters, as test')
    return shares or {'train': 0.8, 'test': 0.2}


def _distributions(section: Section, rows: dict[str, Row], *others: str) -> Drawn:
    """What a section says of parameters, besides which it may only have some others.

    Raises:
        MachineFileError: With file, line, field, value and what is allowed.
    """
    section.only(*rows, *others)
    return {n: _distribution(section, n, row) for n, row in rows.items() if n in section.nodes}


def _values_of(section: Section, rows: Iterable[Row], *others: str) -> dict[str, Any]:
    """The values of a section that are not drawn, defaults for the rest.

    Args:
        section: Where they stand.
        rows: What they are.
        others: What else the section may have.

    Raises:
        MachineFileError: With file, line, field, value and what is allowed.
    """
    named = {row.name: row for row in rows}
    return {n: row.default for n, row in named.items()} | section.values(named, *others)


def _distribution(
    section: Section, name: str, row: Row, *, of_limit: bool = False
) -> Distribution:
    """What a section says of one parameter.

    Raises:
        MachineFileError: With file, line, field, value and what is allowed.
    """
    node, limits = section.nodes[name], row.limits or _ANY
    if not isinstance(node, yaml.MappingNode):
        return Distribution(CHOICE, (section.value(name, node, row),), limits, of_limit)
    inner = section.inner(name)
    inner.only(UNIFORM, LOG_UNIFORM, NORMAL, CHOICE, *[FACTOR.name] * (name == 'depth_of_cut'))
    if len(inner.nodes) != 1:
        raise inner.refused('it must have one way in which it is drawn')
    ((kind, given),) = inner.nodes.items()
    if kind == FACTOR.name:
        return _distribution(inner, kind, FACTOR, of_limit=True)
    if not isinstance(given, yaml.SequenceNode) or not given.value:
        raise inner.refused(f'{kind} must be a list of values', given)
    values = tuple(inner.value(kind, entry, row) for entry in given.value)
    if kind != CHOICE:
        wrong = len(values) != 2 or row.limits is None
        if wrong or (kind == NORMAL and values[1] <= 0.0):
            meaning = 'mean and standard deviation' if kind == NORMAL else 'lowest and highest'
            raise inner.refused(f'{kind} must be two numbers, {meaning}', given)
        if kind != NORMAL and not values[0] < values[1]:
            low, high = map(text_of, given.value)
            raise inner.refused(f'{kind}: the lowest, {low}, must be below {high}', given)
        if kind == LOG_UNIFORM and values[0] <= 0.0:
            raise inner.refused('log_uniform must begin above 0', given)
    return Distribution(kind, values, limits, of_limit)
