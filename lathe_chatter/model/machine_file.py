"""A machine as a file: what a tap test and the machine's plate say, with units.

docs/reference/machine_file.md has an example and every field. A bare number is SI. What is left
out is the paper's, of which a bearing is the exception: a machine without one has no bearing
clearance.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from lathe_chatter.errors import MachineFileError, ParameterError, reason_of
from lathe_chatter.model.cut import BearingContact, Cut
from lathe_chatter.model.machine import PARTICIPATION, RIGID, Body, Machine, Mode
from lathe_chatter.model.machine_and_sampling import LatheSetup
from lathe_chatter.model.parameter_table import Row, rows_of
from lathe_chatter.model.quantity_fields import Quantity, limits_of
from lathe_chatter.model.uncertainty import MODAL, MOST_VARIANCE, Uncertainty
from lathe_chatter.model.values_with_units import number_in
from lathe_chatter.model.yaml_section import Section, section_of
from lathe_chatter.shipped_files import shipped_files

_TURN = 2.0 * np.pi
_SPEED = limits_of(Cut, 'spindle_speed_rpm')
_MOST_ERROR = 10.0
_LEAST_ERROR = 1e-6
"""Relative standard errors that are allowed: below, a percentage was meant."""
_IN_FILE = {
    'bearing': {
        'stiffness': 'machine.bearing_stiffness',
        'clearance': 'cut.bearing_clearance',
        'contact': 'cut.bearing_contact',
    },
    'material': {
        'cutting_coefficient': 'machine.cutting_coefficient',
        'process_damping': 'cut.process_damping',
    },
    'spindle': {
        'slowest_speed': 'slowest_speed',
        'fastest_speed': 'fastest_speed',
        'acceleration': 'spindle_acceleration',
    },
    'cut': {
        'spindle_speed': 'cut.spindle_speed_rpm',
        'feed': 'cut.feed_per_revolution',
        **{n: f'cut.{n}' for n in ('depth_of_cut', 'feed_speed', 'workpiece_diameter')},
    },
}
"""Where each value of the file but those of the modes stands in a `MachineDescription`."""
_ASSUMED = {
    'tool': 'a tool (50 g at 123 Hz; if it is rigid, add the line `tool: rigid`)',
    'workpiece': 'a workpiece (50 g at 103 Hz; if it is rigid, add the line `workpiece: rigid`)',
    'cutting_coefficient': 'a cutting coefficient (3.5 MPa; steel has about 2000 MPa)',
}
"""What is taken where a file has one body, and lacks another or the material."""
_ROUNDING = 1e-12
_BESIDE = {'material': ['errors']}


@dataclass(frozen=True)
class MachineDescription:
    """What a machine file holds.

    Attributes:
        machine: Tool, workpiece, bearing and material.
        cut: What is cut where nothing else is said.
        slowest_speed: Of the spindle, rev/min.
        fastest_speed: Of the spindle, rev/min.
        spindle_acceleration: rev/min per s, 0 where a change of speed is a step.
        uncertainty: How well the figures are known, None where the file says nothing of it.
        name: Of the file, for titles.
        assumed: Which of tool, workpiece and cutting_coefficient a file lacks that tells of one
            body: they are the paper's.

    Raises:
        ParameterError: If the slowest speed is not below the fastest.
    """

    machine: Machine = field(default_factory=Machine)
    cut: Cut = field(default_factory=Cut)
    slowest_speed: float = _SPEED.low
    fastest_speed: float = _SPEED.high
    spindle_acceleration: float = 0.0
    uncertainty: Uncertainty | None = None
    name: str = ''
    assumed: tuple[str, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        """Validate."""
        if not self.slowest_speed < self.fastest_speed:
            allowed = f'above slowest_speed, {self.slowest_speed:g} rev/min'
            raise ParameterError('fastest_speed', self.fastest_speed, 'rev/min', allowed)

    @property
    def speed_range(self) -> tuple[float, float] | None:
        """Slowest and fastest speed of the spindle, rev/min; None where the file has neither."""
        found = self.slowest_speed, self.fastest_speed
        return None if found == (_SPEED.low, _SPEED.high) else found

    def speed_doubt(self, cut: Cut) -> str:
        """That the spindle does not turn as a cut wants it to, a sentence; else empty."""
        swing = cut.spindle_speed_rpm * cut.speed_variation_amplitude
        slow, fast = cut.spindle_speed_rpm - swing, cut.spindle_speed_rpm + swing
        slow, fast = slow * (1.0 + _ROUNDING), fast * (1.0 - _ROUNDING)
        if self.slowest_speed <= slow and fast <= self.fastest_speed:
            return ''
        return (
            'The spindle turns outside of what the machine file says it can, '
            f'{self.slowest_speed:g} to {self.fastest_speed:g} rev/min.'
        )

    def assumption(self, machine: Machine | None = None, cut: Cut | None = None) -> str:
        """That the paper's machine stands in for what the file lacks, a sentence; else empty.

        Args:
            machine: That is taken: what it has otherwise than the file was given beside it.
            cut: That is taken; it may have a bearing contact of which the file knows nothing.
        """
        taken = machine or self.machine
        lacking = [
            _ASSUMED[name]
            for name in self.assumed
            if getattr(taken, name) == getattr(self.machine, name)
        ]
        if not lacking:
            return self._bearing_assumed(taken, cut or self.cut)
        if 'workpiece' in self.assumed and self.cut.bearing_contact is not BearingContact.NONE:
            clearance = self.cut.bearing_clearance * 1e6
            gap = f', with a bearing clearance of {clearance:g} um'
        else:
            gap = ''
        return (
            f'The machine file {self.name} lacks {" and ".join(lacking)}: what the paper has is '
            f'taken{gap}.'
        )

    def _bearing_assumed(self, taken: Machine, cut: Cut) -> str:
        """That a bearing of which the file has nothing is the paper's, or nothing."""
        in_file, wanted = (c.bearing_contact is not BearingContact.NONE for c in (self.cut, cut))
        usual = Machine(taken.tool, taken.workpiece).bearing_stiffness
        if in_file or not wanted or taken.bearing_stiffness != usual:
            return ''
        return (
            f'The machine file {self.name} has no bearing: {usual:.4g} N/m is taken as its '
            'stiffness, half of that of the workpiece as in the paper.'
        )

    def text(self) -> str:
        """The same as one line of JSON, which `load_machine` takes: to the last bit."""
        return json.dumps(self.sections())

    def save(self, path: Path | str, *, lacking: Iterable[str] = (), comment: str = '') -> None:
        """Write a machine file.

        Args:
            path: Of the file.
            lacking: Sections that are left out, for nothing is known of them.
            comment: A sentence at its top.

        Raises:
            MachineFileError: If it cannot be written.
        """
        left_out = set(lacking)
        kept = {name: part for name, part in self.sections().items() if name not in left_out}
        text = yaml.safe_dump(kept, sort_keys=False, default_flow_style=None)
        if comment:
            text = f'# {comment}\n{text}'
        try:
            Path(path).write_text(text, encoding='utf-8')
        except OSError as error:
            raise MachineFileError(f'{path} cannot be written: {reason_of(error)}.') from None

    def sections(self) -> dict[str, Any]:
        """The same as plain values by section, as the file has them."""
        known, made = self.uncertainty or Uncertainty(), dict[str, Any]()
        for name in ('tool', 'workpiece'):
            body: Body = getattr(self.machine, name)
            if body == RIGID:
                made[name] = 'rigid'
                continue
            made[name] = {'modes': [_described(mode) for mode in body.modes]}
            if (covariance := known.covariance_of(name, len(body.modes))) is not None:
                made[name]['covariance'] = covariance.tolist()
        for name, places in _IN_FILE.items():
            made[name] = {key: attrgetter(place)(self) for key, place in places.items()}
        made['bearing']['contact'] = self.cut.bearing_contact.value
        if error := known.error_of('cutting_coefficient'):
            made['material']['errors'] = {'cutting_coefficient': f'{100.0 * error!r} %'}
        return made


_ROWS = {row.name: row for row in (*rows_of(LatheSetup()), *rows_of(MachineDescription()))}
_ROWS['slowest_speed'] = _ROWS['fastest_speed'] = _ROWS['cut.spindle_speed_rpm']
_COEFFICIENT = {'cutting_coefficient': _ROWS['machine.cutting_coefficient']}
_FREQUENCY = Quantity('undamped natural frequency', 'Hz', high=1e6 / _TURN, exclusive=True)
_STIFFNESS = Quantity('modal stiffness', 'N/m', high=1e18, exclusive=True)
_UNCERTAIN = {
    'frequency': Row('', 0.0, '', _FREQUENCY),
    'damping_ratio': _ROWS['machine.tool.damping_ratio'],
    'mass': _ROWS['machine.tool.mass'],
    'stiffness': Row('', 0.0, '', _STIFFNESS),
}
_PARTS = dict.fromkeys(('chip', 'force', 'bearing'), Row('', 1.0, '', PARTICIPATION))


def _described(mode: Mode) -> dict[str, Any]:
    """A mode as the file has it; mass and angular frequency come back to the last bit."""
    frequency = f'{mode.natural_frequency!r} rad/s'
    parts = {name: getattr(mode, name) for name in _PARTS}
    found = {'frequency': frequency, 'damping_ratio': mode.damping_ratio, 'mass': mode.mass}
    return found | {name: value for name, value in parts.items() if value != 1.0}


def narrowed(
    speeds: tuple[float, float], spindle: tuple[float, float] | None
) -> tuple[float, float] | None:
    """The speeds, rev/min, of a range that a spindle has too; None where there are none."""
    slowest, fastest = spindle or speeds
    slowest, fastest = max(speeds[0], slowest), min(speeds[1], fastest)
    return (slowest, fastest) if slowest < fastest else None


def shipped_machines() -> dict[str, Path]:
    """The machine files of the package by name."""
    return shipped_files('machines')


def load_machine(source: Path | str) -> MachineDescription:
    """A machine from its file.

    Args:
        source: A path, the name of a machine that is shipped, or the text of such a file.

    Raises:
        MachineFileError: If there is no such file, or with file, line, field, value, unit and
            what is allowed.
    """
    text, name = str(source), 'the machine'
    if '\n' not in text and not text.lstrip().startswith('{'):
        path = shipped_machines().get(text, Path(text))
        name = str(source) if text in shipped_machines() else path.name
        try:
            text = path.read_text(encoding='utf-8')
        except (OSError, ValueError) as error:
            reason = reason_of(error) if isinstance(error, OSError) else 'it is no text'
            shipped = ', '.join(shipped_machines()) or 'none'
            raise MachineFileError(
                f'The machine {source} cannot be read: {reason}. Shipped are: {shipped}.'
            ) from None
    return _description(section_of(text, name), Path(name).stem)


def _description(top: Section, name: str) -> MachineDescription:
    top.only('tool', 'workpiece', *_IN_FILE)
    known, given = Uncertainty(), dict[str, Any]()
    for part in ('tool', 'workpiece'):
        if part in top.nodes and _is_rigid(top, part):
            given[f'machine.{part}'] = RIGID
        elif part in top.nodes:
            given[f'machine.{part}'], known = _body(top.inner(part), part, known)
    if 'workpiece' in top.nodes and 'bearing' not in top.nodes:
        given['cut.bearing_contact'] = BearingContact.NONE
    for part, places in _IN_FILE.items():
        section, rows = top.inner(part), {key: _ROWS[place] for key, place in places.items()}
        found = section.values(rows, *_BESIDE.get(part, ()))
        given |= {places[key]: value for key, value in found.items()}
        for figure, error in _errors(section, found, _COEFFICIENT).items():
            known = known.with_error(figure, error)
    if 'cut.feed_per_revolution' in given:  # the feed speed at the start; a feed of 0 is none
        per_second = given.get('cut.spindle_speed_rpm', Cut().spindle_speed_rpm) / 60.0
        given.setdefault('cut.feed_speed', given['cut.feed_per_revolution'] * per_second)
    owned = {owner: dict[str, Any]() for owner in ('machine', 'cut', '')}
    for place, value in given.items():
        owner, _, key = place.rpartition('.')
        owned[owner][key] = value
    try:
        machine, cut = Machine(**owned['machine']), Cut(**owned['cut'])
        return MachineDescription(
            machine, cut, **owned[''], uncertainty=known or None, name=name, assumed=_lacking(top)
        )
    except ParameterError as error:
        section = top.inner('spindle') if error.name in owned[''] else top
        raise section.refused(str(error).rstrip('.')) from None


def _is_rigid(top: Section, part: str) -> bool:
    """Whether a body is told to be rigid, and not by its modes."""
    node = top.nodes[part]
    if isinstance(node, yaml.ScalarNode) and node.value and node.value != 'rigid':
        raise top.refused(f'{part} must have `modes`, or be rigid', node)
    return isinstance(node, yaml.ScalarNode) and node.value == 'rigid'


def _lacking(top: Section) -> tuple[str, ...]:
    """What a file that tells of a body does not tell of."""
    bodies = [part for part in ('tool', 'workpiece') if part not in top.nodes]
    if len(bodies) == 2:
        return ()
    known = 'cutting_coefficient' in top.inner('material').nodes
    return (*bodies, *(() if known else ('cutting_coefficient',)))


def _errors(
    section: Section, values: Mapping[str, float], rows: Mapping[str, Row]
) -> dict[str, float]:
    """Relative standard errors, given relative (`2 %`) or in the unit of the value."""
    errors, found = section.inner('errors'), dict[str, float]()
    errors.only(*rows)
    for name, node in errors.nodes.items():
        if name not in values:
            raise errors.refused(f'{name} has an error here and no value beside it', node)
        relative = str(node.value).rstrip().endswith('%')
        unit, size = ('', 1.0) if relative else (rows[name].unit, abs(values[name]) or 1.0)
        limits = Quantity('standard error', unit, high=_MOST_ERROR * size)
        found[name] = errors.value(name, node, Row('', 0.0, '', limits)) / size
        if 0.0 < found[name] < _LEAST_ERROR:
            said = f'{name} is {found[name]:.1g} of its value: it must be 0 or at least'
            raise errors.refused(f'{said} {_LEAST_ERROR:g} of it, as 2 % is', node)
    return found


def _body(section: Section, part: str, known: Uncertainty) -> tuple[list[Mode], Uncertainty]:
    """The modes of a body, and what is known of their errors."""
    section.only('modes', 'covariance')
    modes = []
    for k, entry in enumerate(section.items('modes')):
        found = entry.values(_UNCERTAIN | _PARTS, 'errors')
        if missing := [name for name in ('frequency', 'damping_ratio') if name not in found]:
            raise entry.refused(f'it needs {missing[0]}')
        if ('mass' in found) == ('stiffness' in found):
            raise entry.refused('it needs either mass or stiffness')
        known = known.with_mode(part, k, _errors(entry, found, _UNCERTAIN))
        text, omega = entry.nodes['frequency'].value, _TURN * found.pop('frequency')
        if text.rstrip().endswith('rad/s'):  # to the last bit
            omega = number_in(text, 'rad/s')
        if 'stiffness' in found:
            found['mass'] = found.pop('stiffness') / omega**2
        try:
            modes.append(Mode(natural_frequency=omega, **found))
        except ParameterError as error:
            raise entry.refused(str(error).rstrip('.')) from None
    if node := section.nodes.get('covariance'):
        try:
            matrix = np.array(yaml.safe_load(yaml.serialize(node)), float)
            known = known.with_covariance(part, len(modes), matrix)
        except (TypeError, ValueError):
            size = len(MODAL) * len(modes)
            raise section.refused(
                f'covariance must be a matrix of {size} x {size} numbers, symmetric and with '
                f'variances from 0 to {MOST_VARIANCE:g}',
                node,
            ) from None
    return modes, known
