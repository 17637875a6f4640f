"""A plan: which machines, cuts, sensors and events a data set has, read from YAML.

docs/how_to/datasets.md has every field.
"""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any

import yaml

from lathe_chatter.errors import MachineFileError, ParameterError, PlanError, reason_of
from lathe_chatter.lathe.virtual_lathe import IMPULSE
from lathe_chatter.model.distribution import FIXED, Distribution, distribution, distributions
from lathe_chatter.model.machine_file import MachineDescription, load_machine
from lathe_chatter.model.parameter_table import Row
from lathe_chatter.model.parameters import CUT_ROWS, LATHE, MACHINE_FILE, MACHINE_ROWS
from lathe_chatter.model.quantities import Quantity
from lathe_chatter.model.uncertainty import uncertainty_from
from lathe_chatter.model.yaml_section import Section
from lathe_chatter.samples import sample_columns

OF_FILE = 'file'
"""Stands for the errors that a machine file has."""
CUT = {row.name: row for row in CUT_ROWS if not row.name.startswith('speed_variation')}
"""What may be drawn of a cut; of a varied speed no single root is the truth."""
MACHINE = {row.name: row for row in (MACHINE_FILE, *MACHINE_ROWS, LATHE['tool_leaves_cut'])}


class Form(str, Enum):
    """What a data set is written as."""

    PARQUET, HDF5, ZARR, MCAP = 'parquet', 'hdf5', 'zarr', 'mcap'


_COUNT, _TIME = Quantity('', low=1.0, high=1e9), Quantity('', 's', high=3600.0)
_TOP = (
    *(Row('title', '', ''), LATHE['seed'], Row('machines', 100, '', _COUNT)),
    *(Row('runs', 1, '', _COUNT), Row('duration', 2.0, '', _TIME)),
    Row('form', 'parquet', '', choices=Form),
)
_WINDOWS = tuple(Row(name, 0.0, '', _TIME) for name in ('length', 'every', 'first'))
_EVENT = (Row('share', 1.0, '', Quantity('', high=1.0)), Row('over', 0.0, '', _TIME))
_AT, _KNOCK = Row('at', 0.0, '', _TIME), Row('knock', 0.0, '', IMPULSE)


@dataclass(frozen=True)
class Event:
    """Something that happens in a run, or in a share of the runs."""

    at: Distribution  # s
    changes: dict[str, Distribution]  # of the cut, by parameter
    knock: Distribution | None  # on the tool, N s
    share: float
    over: float  # s that the changes take, in even steps; 0 is at once


@dataclass(frozen=True)
class Plan:
    """What a data set is: as in the file, with times in samples where the name says so."""

    title: str
    seed: int
    machines: int
    runs: int  # of each machine
    duration: float  # of a run, s
    form: Form
    machine: dict[str, Distribution]  # drawn for each machine, by parameter
    files: dict[str, str]  # the machine files that are named, as text
    errors: str  # of the machine, as `uncertainty_from` takes them, or `OF_FILE`
    cut: dict[str, Distribution]  # drawn for each run, by parameter
    columns: tuple[str, ...]
    sample_rate: float  # Hz
    events: tuple[Event, ...]
    samples: int  # of a run
    length: int  # of a window, samples
    every: int  # samples from one window to the next
    first: int  # sample at which the first begins
    splits: dict[str, float]  # shares of the machines
    text: str = field(repr=False)

    @property
    def identity(self) -> str:
        """Of everything but comments and the title: two plans with one make the same data."""
        facts = {name: v for name, v in vars(self).items() if name not in {'title', 'text'}}
        return hashlib.sha256(repr(facts).encode()).hexdigest()[:16]

    @property
    def starts(self) -> range:
        """The samples at which the windows of a run begin."""
        return range(self.first, self.samples - self.length + 1, self.every)

    @property
    def windows(self) -> int:
        """In all, where no run ends early."""
        return self.machines * self.runs * len(self.starts)

    @property
    def drawn(self) -> list[str]:
        """The parameters that differ from window to window, in the order of the table."""
        every = [self.machine, self.cut, *(event.changes for event in self.events)]
        names = {n for part in every for n, how in part.items() if how.kind != FIXED}
        names |= {name for event in self.events for name in event.changes}
        names |= {'spindle_speed_rpm', 'depth_of_cut'}
        return [row.name for row in LATHE if row.name in names - {MACHINE_FILE.name}]

    def machines_of(self) -> dict[str, range]:
        """The machines of each split: as each is drawn by itself, any are a fair choice."""
        shares = [0.0, *itertools.accumulate(self.splits.values())]
        edges = [round(self.machines * min(share, 1.0)) for share in shares]
        ranges = itertools.starmap(range, itertools.pairwise(edges))
        return dict(zip(self.splits, ranges, strict=True))


def load_plan(path: Path) -> Plan:
    """Read and check a plan.

    Raises:
        PlanError: With file, line, field, value, unit and what is allowed.
    """
    try:
        text = path.read_text(encoding='utf-8')
        return _plan(Section(yaml.compose(text, yaml.SafeLoader), str(path), ''), path, text)
    except OSError as error:
        raise PlanError(f'The plan {path} cannot be read: {reason_of(error)}.') from None
    except (UnicodeDecodeError, yaml.YAMLError) as error:
        raise PlanError(f'The plan {path} is no YAML: {" ".join(str(error).split())}.') from None
    except (MachineFileError, ParameterError) as error:
        raise PlanError(str(error)) from None


def _plan(top: Section, path: Path, text: str) -> Plan:
    inner = ('machine', 'cut', 'sensors', 'events', 'windows', 'splits')
    values = _single(top, _TOP, *inner)
    machine, files, errors = _machine(top.inner('machine'), path)
    sensors, windows = top.inner('sensors'), top.inner('windows')
    rate = _single(sensors, [LATHE['sample_rate']], 'columns')['sample_rate']
    samples = round(values['duration'] * rate)
    times = {n: round(v * rate) for n, v in _single(windows, _WINDOWS).items()}
    length = times['length'] or samples - times['first']
    if not 1 <= length <= samples - times['first']:
        raise windows.refused(f'a window must lie within the run of {values["duration"]:g} s')
    facts = {'length': length, 'every': times['every'] or length, 'first': times['first']}
    return Plan(
        **{**values, 'title': values['title'] or path.stem, 'form': Form(values['form'])},
        machine=machine,
        files=files,
        errors=errors,
        cut=distributions(top.inner('cut'), CUT),
        columns=_columns(sensors),
        sample_rate=rate,
        events=tuple(map(_event, top.items('events'))) if 'events' in top.nodes else (),
        samples=samples,
        **facts,
        splits=_splits(top.inner('splits')),
        text=text,
    )


def _single(section: Section, rows: Iterable[Row], *others: str) -> dict[str, Any]:
    """The single values of a section that has these and some others."""
    named = {row.name: row for row in rows}
    section.only(*named, *others)
    found = {name: row.default for name, row in named.items()}
    for name in named.keys() & section.nodes.keys():
        how = distribution(section, name, named[name])
        if how.kind != FIXED:
            raise section.refused(f'{name} must be a single value', section.nodes[name])
        found[name] = how.values[0]
    return found


def _machine(section: Section, path: Path) -> tuple[dict[str, Distribution], dict[str, str], str]:
    """How machines are drawn, the files that are named, and the errors."""
    errors = _single(section, [Row('errors', '', '')], *MACHINE)['errors']
    section.nodes.pop('errors', None)
    drawn = distributions(section, MACHINE)
    described = {'': MachineDescription()}
    if MACHINE_FILE.name in drawn:
        sources = drawn[MACHINE_FILE.name].values
        beside = {s: path.parent / s if (path.parent / s).is_file() else s for s in sources}
        described = {source: load_machine(place) for source, place in beside.items()}
    for source, one in described.items():
        for name in drawn:
            part = name.partition('.')[0]
            if '.' in name and len(getattr(one.machine, part).modes) > 1:
                raise section.refused(f'{name} is that of one mode, and {source} has several')
        if errors == OF_FILE and not one.uncertainty:
            raise section.refused(
                f'errors is file, and {source or "there is no file that"} has none'
            )
        if errors not in {'', OF_FILE}:
            uncertainty_from(errors, one.machine)
    return drawn, {s: one.text() for s, one in described.items() if s}, errors


def _columns(section: Section) -> tuple[str, ...]:
    node, known = section.nodes.get('columns'), sample_columns(accelerometers=True)
    if node is None:
        return ('tool_displacement', 'workpiece_displacement')
    entries = node.value if isinstance(node, yaml.SequenceNode) else []
    names = tuple(str(entry.value) for entry in entries)
    wrong = [name for name in names if name not in known]
    if not names or wrong or len({*names}) < len(names):
        unknown = f', and {wrong[0]!r} is none' if wrong else ''
        raise section.refused(
            f'columns must be a list of some of {", ".join(known)}{unknown}', node
        )
    return names


def _event(entry: Section) -> Event:
    single = _single(entry, _EVENT, 'at', 'set', 'knock')
    changes = distributions(entry.inner('set'), CUT)
    knock = distribution(entry, 'knock', _KNOCK) if 'knock' in entry.nodes else None
    if 'at' not in entry.nodes or not (changes or knock):
        raise entry.refused('an event needs at, and set or knock')
    text = next((name for name in changes if CUT[name].limits is None), None)
    if single['over'] and text:
        raise entry.refused(f'{text} can only change at once, without over')
    return Event(distribution(entry, 'at', _AT), changes, knock, **single)


def _splits(section: Section) -> dict[str, float]:
    share = Quantity('a share', high=1.0)
    shares = {name: section.number(name, share) or 0.0 for name in section.nodes}
    if shares and abs(sum(shares.values()) - 1.0) > 1e-9:
        raise section.refused('the shares must add up to 1')
    if wrong := [name for name in shares if not name.isidentifier()]:
        raise section.refused(f'{wrong[0]!r} must be a name of letters, as test')
    return shares or {'train': 0.8, 'test': 0.2}
