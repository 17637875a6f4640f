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
machine without one has no bearing clearance. docs/reference/machine_file.md has every field.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from lathe_chatter.errors import MachineFileError, ParameterError, reason_of
from lathe_chatter.model.cut import BearingContact, Cut
from lathe_chatter.model.machine import Body, Machine, Mode
from lathe_chatter.model.machine_and_sampling import LatheSetup
from lathe_chatter.model.quantity_fields import Quantity, limits_of
from lathe_chatter.model.uncertainty import MODAL, MOST_VARIANCE, Uncertainty
from lathe_chatter.model.values_with_units import number_in
from lathe_chatter.model.yaml_section import Section, section_of, text_of

_TURN = 2.0 * np.pi
_PARTICIPATION = Quantity('participation of a mode', low=-1e6, high=1e6)
_MODE = {
    'frequency': Quantity('undamped natural frequency', 'Hz', high=1e6 / _TURN, exclusive=True),
    'damping_ratio': limits_of(Mode, 'damping_ratio'),
    'mass': limits_of(Mode, 'mass'),
    'stiffness': Quantity('modal stiffness', 'N/m', high=1e18, exclusive=True),
    **dict.fromkeys(('chip', 'force', 'bearing'), _PARTICIPATION),
}
_UNCERTAIN = {k: _MODE[k] for k in ('frequency', 'damping_ratio', 'mass', 'stiffness')}
_COEFFICIENT = {'cutting_coefficient': limits_of(Machine, 'cutting_coefficient')}
_SPEED = limits_of(Cut, 'spindle_speed_rpm')
_SPINDLE = dict.fromkeys(('slowest_speed', 'fastest_speed'), _SPEED)
_SPINDLE['acceleration'] = limits_of(LatheSetup, 'spindle_acceleration')
_OF_CUT = {
    'bearing': {'clearance': 'bearing_clearance'},
    'material': {'process_damping': 'process_damping'},
    'cut': {'spindle_speed': 'spindle_speed_rpm', 'feed': 'feed_per_revolution'}
    | {name: name for name in ('depth_of_cut', 'feed_speed', 'workpiece_diameter')},
}
"""Names in the file of what are fields of a `Cut`, by section."""
_USUAL_SPEED = Cut().spindle_speed_rpm
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

    @property
    def speed_range(self) -> tuple[float, float] | None:
        """Slowest and fastest speed of the spindle, rev/min; None where the file has neither."""
        found = self.slowest_speed, self.fastest_speed
        return None if found == (_SPEED.low, _SPEED.high) else found

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
            covariance = known.covariance_of(name, len(body.modes)) if known else None
            if covariance is not None:
                made[name]['covariance'] = covariance.tolist()
        made['bearing'] = {
            'stiffness': self.machine.bearing_stiffness,
            **self._of_cut('bearing'),
            'contact': self.cut.bearing_contact.value,
        }
        made['material'] = {
            'cutting_coefficient': self.machine.cutting_coefficient,
            **self._of_cut('material'),
        }
        if known and (error := known.error_of('cutting_coefficient')):
            made['material']['errors'] = {'cutting_coefficient': f'{100.0 * error!r} %'}
        if self.speed_range is not None:
            slowest, fastest = self.speed_range
            made['spindle'] = {'slowest_speed': slowest, 'fastest_speed': fastest}
        if self.spindle_acceleration:
            made.setdefault('spindle', {})['acceleration'] = self.spindle_acceleration
        made['cut'] = self._of_cut('cut')
        return made

    def _of_cut(self, section: str) -> dict[str, float]:
        return {name: getattr(self.cut, field) for name, field in _OF_CUT[section].items()}


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
    return _description(section_of(text, name), Path(name).stem)


def _description(top: Section, name: str) -> MachineDescription:
    top.only(*_SECTIONS)
    machine: dict[str, Any] = {}
    known = Uncertainty()
    for part in ('tool', 'workpiece'):
        if section := top.section(part):
            machine[part], known = _body(section, part, known)
    bearing, material = top.inner('bearing'), top.inner('material')
    bearing.only('stiffness', *_OF_CUT['bearing'], 'contact')
    limits = limits_of(Machine, 'bearing_stiffness')
    if (stiffness := bearing.number('stiffness', limits)) is not None:
        machine['bearing_stiffness'] = stiffness
    cut = _fields(bearing) | _contact(bearing)
    if 'bearing' not in top.nodes and 'workpiece' in machine:
        cut['bearing_contact'] = BearingContact.NONE
    material.only(*_COEFFICIENT, *_OF_CUT['material'], 'errors')
    found = material.numbers(_COEFFICIENT)
    machine |= found
    for figure, error in material.errors(found, _COEFFICIENT).items():
        known = known.with_error(figure, error)
    section = top.inner('cut')
    section.only(*_OF_CUT['cut'])
    cut |= _fields(material) | _fields(section)
    if 'feed_per_revolution' in cut:  # the feed speed at the start; a feed of 0 is none
        per_minute = cut['feed_per_revolution'] * cut.get('spindle_speed_rpm', _USUAL_SPEED)
        cut.setdefault('feed_speed', per_minute / 60.0)
    try:
        made, usual = Machine(**machine), Cut(**cut)
    except ParameterError as error:
        raise top.refused(str(error).rstrip('.')) from None
    spindle = _spindle(top.inner('spindle'))
    return MachineDescription(made, usual, **spindle, uncertainty=known or None, name=name)


def _contact(section: Section) -> dict[str, Any]:
    node, words = section.nodes.get('contact'), [choice.value for choice in BearingContact]
    if node is None:
        return {}
    if text_of(node) not in words:
        allowed = f'it must be one of {", ".join(words)}'
        raise section.refused(f'contact is {text_of(node)!r}: {allowed}', node)
    return {'bearing_contact': node.value}


def _spindle(section: Section) -> dict[str, float]:
    section.only(*_SPINDLE)
    found = section.numbers(_SPINDLE)
    slow, fast = found.get('slowest_speed', _SPEED.low), found.get('fastest_speed', _SPEED.high)
    if not slow < fast:
        raise section.refused(
            f'fastest_speed is {fast:g} rev/min: it must be above slowest_speed, {slow:g} rev/min'
        )
    if 'acceleration' in found:
        found['spindle_acceleration'] = found.pop('acceleration')
    return found


def _fields(section: Section) -> dict[str, Any]:
    """Those fields of a cut that a section has, by their names."""
    names = _OF_CUT[section.path]
    found = section.numbers({name: limits_of(Cut, field) for name, field in names.items()})
    return {names[name]: value for name, value in found.items()}


def _body(section: Section, part: str, known: Uncertainty) -> tuple[list[Mode], Uncertainty]:
    """The modes of a body, and what is known of their errors."""
    section.only('modes', 'covariance')
    modes = []
    for k, entry in enumerate(section.items('modes')):
        entry.only(*_MODE, 'errors')
        found = entry.numbers(_MODE)
        if missing := [name for name in ('frequency', 'damping_ratio') if name not in found]:
            raise entry.refused(f'it needs {missing[0]}')
        if ('mass' in found) == ('stiffness' in found):
            raise entry.refused('it needs either mass or stiffness')
        errors = entry.errors(found, _UNCERTAIN)
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
                f'covariance must be a matrix of {size} x {size} numbers, symmetric and with '
                f'variances from 0 to {MOST_VARIANCE:g}',
                node,
            ) from None
    return modes, known
