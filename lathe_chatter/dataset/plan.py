"""A plan: which machines, cuts, sensors and events a data set has, read from YAML.

docs/how_to/datasets.md has every field.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import NamedTuple

import yaml

from lathe_chatter.dataset.drawn_value import Distribution, distribution, distributions, values_of
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
_EVENT = [Row('share', 1.0, '', _SHARE), Row('over', 0.0, '', _TIME)]


class Form(str, Enum):
    """What a data set is written as."""

    PARQUET, HDF5, ZARR, MCAP = 'parquet', 'hdf5', 'zarr', 'mcap'


class Event(NamedTuple):
    """Something that happens in a share of the runs."""

    at: Distribution  # s
    changes: dict[str, Distribution]  # of the cut, by parameter
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
    machine: dict[str, Distribution]  # drawn for each machine, by parameter
    files: dict[str, str]  # the machine files that are named, as text
    doubts: tuple[str, ...] = field(repr=False)  # what those files lack, in sentences
    errors: str  # of the machine, as `uncertainty_from` takes them, or `OF_FILE`
    cut: dict[str, Distribution]  # drawn for each run, by parameter
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
        names = {name for event in self.events for name in event.changes}
        names |= {n for n, how in (self.machine | self.cut).items() if len(how.values) > 1}
        names |= {'spindle_speed_rpm', 'depth_of_cut'}
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
    values = values_of(top, [*_TOP, Row('form', 'parquet', '', choices=Form)], *_INNER)
    machine, files, errors, doubts = _machine(top.inner('machine'), path)
    sensors, windows = top.inner('sensors'), top.inner('windows')
    rate = values_of(sensors, [LATHE['sample_rate']], 'columns')['sample_rate']
    samples = round(values['duration'] * rate)
    length, every, first = (round(v * rate) for v in values_of(windows, _WINDOWS).values())
    length = length or samples - first
    if not 1 <= length <= samples - first:
        raise windows.refused(f'a window must lie within the run of {values["duration"]:g} s')
    return Plan(
        **{**values, 'title': values['title'] or path.stem, 'form': Form(values['form'])},
        machine=machine,
        files=files,
        doubts=doubts,
        errors=errors,
        cut=distributions(top.inner('cut'), CUT),
        columns=_columns(sensors),
        sample_rate=rate,
        events=tuple(map(_event, top.items('events'))) if 'events' in top.nodes else (),
        samples=samples,
        length=length,
        starts=range(first, samples - length + 1, every or length),
        splits=_splits(top.inner('splits')),
        text=text,
    )


def _machine(
    section: Section, path: Path
) -> tuple[dict[str, Distribution], dict[str, str], str, tuple[str, ...]]:
    """How machines are drawn, the files that are named, the errors, and what files lack."""
    errors = values_of(section, [Row('errors', '', '')], *_MACHINE)['errors']
    section.nodes.pop('errors', None)
    drawn, described = distributions(section, _MACHINE), {'': MachineDescription()}
    if file := drawn.get(MACHINE_FILE.name):
        places = {source: path.parent / source for source in file.values}
        described = {s: load_machine(p if p.is_file() else s) for s, p in places.items()}
    firsts = {name: how.values[0] for name, how in drawn.items() if name != MACHINE_FILE.name}
    files = {source: one.text() for source, one in described.items() if source}
    doubts: list[str] = []
    for source, one in described.items():
        config = config_from({**firsts, MACHINE_FILE.name: files.get(source, '')})
        doubts += filter(None, [one.assumption(config.machine, config.cut)])
        if errors == OF_FILE and not one.uncertainty:
            raise section.refused(f'errors is file: {source or "no file that"} has none')
        if errors not in {'', OF_FILE}:
            uncertainty_from(errors, one.machine)
    return drawn, files, errors, tuple(doubts)


def _columns(section: Section) -> tuple[str, ...]:
    node, known = section.nodes.get('columns'), sample_columns(accelerometers=True)
    if node is None:
        return ('tool_displacement', 'workpiece_displacement')
    names = tuple(map(text_of, node.value)) if isinstance(node, yaml.SequenceNode) else ()
    if 0 < len(names) == len({*names} & {*known}):
        return names
    raise section.refused(f'columns must be a list of some of {", ".join(known)}', node)


def _event(entry: Section) -> Event:
    single = values_of(entry, _EVENT, 'at', 'set', 'knock')
    rows = {'at': Row('at', 0.0, '', _TIME), 'knock': Row('knock', 0.0, '', IMPULSE)}
    at, knock = (distribution(entry, n, rows[n]) if n in entry.nodes else None for n in rows)
    changes = distributions(entry.inner('set'), CUT)
    if at is None or not (changes or knock):
        raise entry.refused('an event needs at, and set or knock')
    words = [name for name in changes if CUT[name].limits is None]
    if single['over'] and words:
        raise entry.refused(f'{words[0]} can only change at once, without over')
    return Event(at, changes, knock, **single)


def _splits(section: Section) -> dict[str, float]:
    shares = section.values(dict.fromkeys(section.nodes, Row('', 0.0, '', _SHARE)))
    if shares and abs(sum(shares.values()) - 1.0) > 1e-9:
        raise section.refused('the shares must add up to 1')
    if wrong := [name for name in shares if not name.isidentifier()]:
        raise section.refused(f'{wrong[0]!r} must be a name of letters, as test')
    return shares or {'train': 0.8, 'test': 0.2}
