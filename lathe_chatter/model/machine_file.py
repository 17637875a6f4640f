"""A machine as a file: what a tap test and the machine's plate say, with units.

    tool:
      modes:
        - {frequency: 312 Hz, damping_ratio: 0.03, stiffness: 21 N/um}
    workpiece:
      modes:
        - {frequency: 120 Hz, damping_ratio: 3 %, mass: 20 kg, errors: {frequency: 0.2 %}}
    bearing: {stiffness: 5e7 N/m, clearance: 5 um, contact: gap}
    material: {cutting_coefficient: 1500 MPa, errors: {cutting_coefficient: 15 %}}
    spindle: {slowest_speed: 60 rpm, fastest_speed: 3000 rpm, acceleration: 500 rpm/s}
    cut: {spindle_speed: 900 rpm, depth_of_cut: 0.5 mm, feed: 0.2 mm/rev}

A bare number is SI. What is left out is the paper's, of which a bearing is the exception: a
machine without one has no bearing clearance. docs/machine_file.md has every field.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from lathe_chatter.errors import MachineFileError, ParameterError, nearest_name, reason_of
from lathe_chatter.model.cut import BearingContact, Cut
from lathe_chatter.model.lathe_setup import LatheSetup
from lathe_chatter.model.machine import Body, Machine, Mode
from lathe_chatter.model.quantities import Quantity, limits_of
from lathe_chatter.model.uncertainty import MODAL, Uncertainty
from lathe_chatter.model.units import number_in, units_of

_TURN = 2.0 * np.pi
_PARTICIPATION = Quantity('participation of a mode', low=-1e6, high=1e6)
_MODE = {
    'frequency': Quantity('undamped natural frequency', 'Hz', high=1e6 / _TURN, exclusive=True),
    'damping_ratio': limits_of(Mode, 'damping_ratio'),
    'mass': limits_of(Mode, 'mass'),
    'stiffness': Quantity('modal stiffness', 'N/m', high=1e18, exclusive=True),
    **dict.fromkeys(('chip', 'force', 'bearing'), _PARTICIPATION),
}
_BEARING = {
    'stiffness': limits_of(Machine, 'bearing_stiffness'),
    'clearance': limits_of(Cut, 'bearing_clearance'),
}
_MATERIAL = {'cutting_coefficient': limits_of(Machine, 'cutting_coefficient')}
_SPEED = limits_of(Cut, 'spindle_speed_rpm')
_SPINDLE = {
    'slowest_speed': _SPEED,
    'fastest_speed': _SPEED,
    'acceleration': limits_of(LatheSetup, 'spindle_acceleration'),
}
_CUT = {
    'spindle_speed': _SPEED,
    'depth_of_cut': limits_of(Cut, 'depth_of_cut'),
    'feed': Quantity('feed per revolution', 'm', high=0.01),
}
_SECTIONS = ('tool', 'workpiece', 'bearing', 'material', 'spindle', 'cut')


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
    """

    machine: Machine = field(default_factory=Machine)
    cut: Cut = field(default_factory=Cut)
    slowest_speed: float = _SPEED.low
    fastest_speed: float = _SPEED.high
    spindle_acceleration: float = 0.0
    uncertainty: Uncertainty | None = None
    name: str = ''

    def text(self) -> str:
        """The same as one line of JSON, which `load_machine` takes: to the last bit."""
        return json.dumps(self._sections())

    def save(self, path: Path | str) -> None:
        """Write a machine file.

        Raises:
            MachineFileError: If it cannot be written.
        """
        text = yaml.safe_dump(self._sections(), sort_keys=False, default_flow_style=None)
        try:
            Path(path).write_text(text, encoding='utf-8')
        except OSError as error:
            raise MachineFileError(f'{path} cannot be written: {reason_of(error)}.') from None

    def _sections(self) -> dict[str, Any]:
        known = self.uncertainty
        made: dict[str, Any] = {}
        for name in ('tool', 'workpiece'):
            body: Body = getattr(self.machine, name)
            made[name] = {'modes': [_described(mode) for mode in body.modes]}
            covariance = known and known.covariance_of(name, len(body.modes))
            if covariance is not None:
                made[name]['covariance'] = covariance.tolist()
        made['bearing'] = {
            'stiffness': self.machine.bearing_stiffness,
            'clearance': self.cut.bearing_clearance,
            'contact': self.cut.bearing_contact.value,
        }
        made['material'] = {'cutting_coefficient': self.machine.cutting_coefficient}
        error = known and known.error_of('cutting_coefficient')
        if error:
            made['material']['errors'] = {'cutting_coefficient': f'{100.0 * error!r} %'}
        made['spindle'] = {
            'slowest_speed': self.slowest_speed,
            'fastest_speed': self.fastest_speed,
            'acceleration': self.spindle_acceleration,
        }
        made['cut'] = {
            'spindle_speed': self.cut.spindle_speed_rpm,
            'depth_of_cut': self.cut.depth_of_cut,
            'feed': self.cut.feed,
        }
        return made


def _described(mode: Mode) -> dict[str, Any]:
    """A mode as the file has it; mass and angular frequency come back to the last bit."""
    described: dict[str, Any] = {
        'frequency': f'{mode.natural_frequency!r} rad/s',
        'damping_ratio': mode.damping_ratio,
        'mass': mode.mass,
    }
    parts = {name: getattr(mode, name) for name in ('chip', 'force', 'bearing')}
    return described | {name: value for name, value in parts.items() if value != 1.0}


def shipped_machines() -> dict[str, Path]:
    """The machine files of the package by name."""
    package = Path(__file__).resolve().parents[1]
    places = [
        package.parent / 'config' / 'machines',
        *(p / 'share' / 'lathe_chatter' / 'config' / 'machines' for p in package.parents),
    ]
    place = next((place for place in places if place.is_dir()), places[0])
    return {file.stem: file for file in sorted(place.glob('*.yaml'))}


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
    try:
        node = yaml.compose(text, Loader=yaml.SafeLoader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        line = f', line {mark.line + 1}' if mark else ''
        raise MachineFileError(f'{name}{line}: {error.problem}.') from None
    except yaml.YAMLError as error:
        raise MachineFileError(f'{name}: {" ".join(str(error).split())}.') from None
    return _description(_Section(node, name, ''), Path(name).stem)


class _Section:
    """A mapping of a YAML file whose entries know their lines."""

    def __init__(self, node: yaml.Node | None, file: str, path: str) -> None:
        self.file, self.path = file, path
        self.line = node.start_mark.line + 1 if node is not None else 1
        if not isinstance(node, yaml.MappingNode):
            raise self.refused('it must be a mapping of names to values')
        self.nodes: dict[str, yaml.Node] = {}
        for key, value in node.value:
            if key.value in self.nodes:
                raise self.refused(f'{key.value!r} stands there twice', key)
            self.nodes[key.value] = value

    def refused(self, text: str, node: yaml.Node | None = None) -> MachineFileError:
        line = node.start_mark.line + 1 if node is not None else self.line
        where = f'{self.path}: ' if self.path else ''
        return MachineFileError(f'{self.file}, line {line}: {where}{text}.')

    def only(self, *known: str) -> None:
        for key, node in self.nodes.items():
            if key not in known:
                near = nearest_name(key, known)
                hint = f'did you mean {near}?' if near else f'known are {", ".join(known)}'
                raise self.refused(f'there is no {key!r}: {hint}'.removesuffix('?'), node)

    def section(self, name: str) -> _Section | None:
        node = self.nodes.get(name)
        path = f'{self.path}.{name}' if self.path else name
        return None if node is None else _Section(node, self.file, path)

    def number(self, name: str, limits: Quantity) -> float | None:
        """The value under a name, in the unit of its limits."""
        node = self.nodes.get(name)
        if node is None:
            return None
        full = f'{self.path}.{name}'
        text = node.value if isinstance(node, yaml.ScalarNode) else yaml.serialize(node).strip()
        value = number_in(text, limits.unit) if isinstance(node, yaml.ScalarNode) else None
        try:
            return limits.check(full, text if value is None else value)
        except ParameterError as error:
            units = units_of(limits.unit)
            hint = f', in {units}' if value is None and units else ''
            raise MachineFileError(
                f'{self.file}, line {node.start_mark.line + 1}: {str(error).rstrip(".")}{hint}.'
            ) from None

    def numbers(self, table: Mapping[str, Quantity]) -> dict[str, float]:
        found = {name: self.number(name, limits) for name, limits in table.items()}
        return {name: value for name, value in found.items() if value is not None}

    def errors(self, values: Mapping[str, float], table: Mapping[str, Quantity]) -> dict[str, float]:
        """Relative standard errors, given relative (`2 %`) or in the unit of the value."""
        section = self.section('errors')
        if section is None:
            return {}
        section.only(*values)
        found = {}
        for name, node in section.nodes.items():
            if isinstance(node, yaml.ScalarNode) and node.value.rstrip().endswith('%'):
                relative = section.number(name, Quantity('standard error', high=10.0))
            else:
                limits = replace(table[name], low=0.0, high=1e300, exclusive=False)
                relative = (section.number(name, limits) or 0.0) / (abs(values[name]) or 1.0)
            found[name] = relative or 0.0
        return found

    def items(self, name: str) -> Iterator[_Section]:
        node = self.nodes.get(name)
        if not isinstance(node, yaml.SequenceNode) or not node.value:
            raise self.refused(f'{name} must be a list with an entry for each', node)
        for k, entry in enumerate(node.value):
            yield _Section(entry, self.file, f'{self.path}.{name}[{k}]')


def _description(top: _Section, name: str) -> MachineDescription:
    top.only(*_SECTIONS)
    bodies: dict[str, Any] = {}
    uncertainty = Uncertainty()
    for part in ('tool', 'workpiece'):
        section = top.section(part)
        if section is not None:
            bodies[part], uncertainty = _body(section, part, uncertainty)
    bearing, material = top.section('bearing'), top.section('material')
    spindle, cut = top.section('spindle'), top.section('cut')
    cut_values: dict[str, Any] = {}
    if bearing is None and 'workpiece' in bodies:
        cut_values['bearing_contact'] = BearingContact.NONE
    if bearing is not None:
        bearing.only(*_BEARING, 'contact')
        found = bearing.numbers(_BEARING)
        if 'stiffness' in found:
            bodies['bearing_stiffness'] = found['stiffness']
        if 'clearance' in found:
            cut_values['bearing_clearance'] = found['clearance']
        contact = bearing.nodes.get('contact')
        if contact is not None:
            words = [choice.value for choice in BearingContact]
            if contact.value not in words:
                raise bearing.refused(
                    f'contact is {contact.value!r}: it must be one of {", ".join(words)}', contact
                )
            cut_values['bearing_contact'] = contact.value
    if material is not None:
        material.only(*_MATERIAL, 'errors')
        found = material.numbers(_MATERIAL)
        bodies |= found
        for known, error in material.errors(found, _MATERIAL).items():
            uncertainty = uncertainty.with_error(known, error)
    limits: dict[str, float] = {}
    if spindle is not None:
        spindle.only(*_SPINDLE)
        limits = spindle.numbers(_SPINDLE)
        slow, fast = limits.get('slowest_speed', 0.0), limits.get('fastest_speed', _SPEED.high)
        if not slow < fast:
            raise spindle.refused(
                f'fastest_speed is {fast:g} rev/min: it must be above slowest_speed, {slow:g}'
            )
        if 'acceleration' in limits:
            limits['spindle_acceleration'] = limits.pop('acceleration')
    if cut is not None:
        cut.only(*_CUT)
        found = cut.numbers(_CUT)
        speed = found.get('spindle_speed', Cut().spindle_speed_rpm)
        cut_values['spindle_speed_rpm'] = speed
        if 'depth_of_cut' in found:
            cut_values['depth_of_cut'] = found['depth_of_cut']
        if 'feed' in found:
            cut_values['feed_speed'] = found['feed'] * speed / 60.0
    try:
        machine, default_cut = Machine(**bodies), Cut(**cut_values)
    except ParameterError as error:
        raise top.refused(str(error).rstrip('.')) from None
    return MachineDescription(
        machine, default_cut, **limits, uncertainty=uncertainty or None, name=name
    )


def _body(section: _Section, part: str, known: Uncertainty) -> tuple[list[Mode], Uncertainty]:
    """The modes of a body, and what is known of their errors."""
    section.only('modes', 'covariance')
    modes = []
    for k, entry in enumerate(section.items('modes')):
        entry.only(*_MODE, 'errors')
        found = entry.numbers(_MODE)
        for name in ('frequency', 'damping_ratio'):
            if name not in found:
                raise entry.refused(f'it needs {name}')
        if ('mass' in found) == ('stiffness' in found):
            raise entry.refused('it needs either mass or stiffness')
        errors = entry.errors(found, _MODE)
        text = entry.nodes['frequency'].value
        omega = number_in(text, 'rad/s') if text.rstrip().endswith('rad/s') else None
        omega = omega or _TURN * found['frequency']
        mass = found['mass'] if 'mass' in found else found['stiffness'] / omega**2
        parts = {name: found[name] for name in ('chip', 'force', 'bearing') if name in found}
        try:
            modes.append(Mode(mass, omega, found['damping_ratio'], **parts))
        except ParameterError as error:
            raise entry.refused(str(error).rstrip('.')) from None
        known = known.with_mode(part, k, errors)
    node = section.nodes.get('covariance')
    if node is not None:
        try:
            matrix = np.array(yaml.safe_load(yaml.serialize(node)), float)
            known = known.with_covariance(part, len(modes), matrix)
        except (TypeError, ValueError):
            size = len(MODAL) * len(modes)
            raise section.refused(
                f'covariance must be a matrix of {size} x {size} numbers, symmetric and with no '
                'negative variance',
                node,
            ) from None
    return modes, known


