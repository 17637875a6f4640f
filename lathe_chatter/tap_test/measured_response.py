"""A measured frequency response, and the files in which shops keep it.

Universal files (dataset 58, text and binary, function type 4, with their coherence of type 6)
say themselves what was measured over what, and in which units. A CSV says it in its head:

    frequency (Hz), real (m/s2/N), imaginary (m/s2/N), coherence

or with `magnitude` and `phase (deg)` in place of the two parts. Whatever was measured
(receptance m/N, mobility m/s/N, accelerance m/s2/N) is kept as measured, for there its noise is
even; the modes are fitted to it with the factor that makes it of a receptance.
"""

from __future__ import annotations

import contextlib
import csv
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lathe_chatter.array_types import Array
from lathe_chatter.errors import FrequencyResponseError, optional, reason_of

Complex = NDArray[np.complex128]

_LEAST = 16
"""Frequencies of a response."""
ORDERS = {'receptance': 0, 'mobility': 1, 'accelerance': 2}
"""How often the displacement was differentiated in what was measured."""

_G = 9.80665
_LENGTHS = {'m': 1.0, 'mm': 1e-3, 'um': 1e-6, 'µm': 1e-6, 'in': 0.0254}
_MOTIONS = {
    length + suffix: (form, factor)
    for length, factor in _LENGTHS.items()
    for form, suffix in zip(ORDERS, ('', '/s', '/s2'), strict=True)
} | dict.fromkeys(('g', 'gn'), ('accelerance', _G))
"""What is measured in a unit over that of the force, and the factor to SI."""
_FORCES = {'n': 1.0, 'kn': 1e3, 'lbf': 4.4482216152605}
_PER_HERTZ = {'': 1.0, 'hz': 1.0, 'khz': 1e-3, 'rad/s': 2.0 * np.pi}
_UFF_ORDERS = {8: 0, 11: 1, 12: 2}
"""Specific data types of dataset 58: displacement, velocity, acceleration."""
_UFF_FORCE, _UFF_FRF, _UFF_COHERENCE = 13, 4, 6
_UFF_FUNCTIONS = {
    1: 'a record over time', 2: 'an auto spectrum', 3: 'a cross spectrum',
    _UFF_COHERENCE: 'a coherence', 9: 'a spectral density', 12: 'a spectrum',
}  # fmt: skip
"""What else dataset 58 may hold, by its number of the function."""


@dataclass(frozen=True)
class FrequencyResponse:
    """One measured frequency response of a body, at the point where it is cut.

    Attributes:
        frequency: Ascending, Hz (n,).
        response: As measured, m/N, m/s/N or m/s2/N (n,).
        form: `receptance`, `mobility` or `accelerance`.
        coherence: Between 0 and 1 (n,), None where the file has none.
        source: The file, for people.
    """

    frequency: Array
    response: Complex = field(repr=False)
    form: str
    coherence: Array | None = field(default=None, repr=False)
    source: str = ''

    def __post_init__(self) -> None:
        """Validate.

        Raises:
            FrequencyResponseError: If lengths differ, values are not finite, or too few.
        """
        parts = [p for p in (self.frequency, self.response, self.coherence) if p is not None]
        falling = np.flatnonzero(np.diff(self.frequency.ravel(), prepend=-1e-300) <= 0.0)
        largest, said = float(np.abs(self.response).max(initial=0.0)), ''
        if self.form not in ORDERS:
            said = f'its form is {self.form!r}: it must be one of {", ".join(ORDERS)}'
        elif len({part.shape for part in parts}) != 1 or self.frequency.ndim != 1:
            said = 'its columns are not of one length'
        elif not all(np.isfinite(part).all() for part in parts):
            said = 'it holds values that are not finite'
        elif self.frequency.size < _LEAST:
            said = f'it must hold at least {_LEAST} frequencies, and has {self.frequency.size}'
        elif falling.size:
            wrong = self.frequency[falling[0]]
            said = (
                f'its frequencies must ascend from 0 Hz, and {wrong:g} Hz is below the one before'
            )
        elif not 1e-30 < largest < 1e30:
            said = f'the largest value of its {self.form} is {largest:g}: nothing was measured'
        elif self.coherence is not None and np.any(np.abs(self.coherence - 0.5) > 0.5):
            said = 'its coherence must be from 0 to 1'
        if said:
            raise FrequencyResponseError(f'{self.source}: {said}.')

    def within(self, lowest: float, highest: float) -> FrequencyResponse:
        """The same between two frequencies, Hz, and never at 0 Hz, where nothing vibrates."""
        inside = (self.frequency >= max(lowest, 1e-9)) & (self.frequency <= highest)
        coherence = None if self.coherence is None else self.coherence[inside]
        kept = self.frequency[inside], self.response[inside]
        return FrequencyResponse(*kept, self.form, coherence, self.source)

    @property
    def of_receptance(self) -> Complex:
        """What a receptance is multiplied by to give what was measured: (i omega)^order (n,)."""
        factor = (2j * np.pi * self.frequency) ** ORDERS[self.form]
        return factor.astype(np.complex128)


def read_frequency_responses(path: Path | str) -> list[FrequencyResponse]:
    """The frequency responses in a file, universal or CSV.

    Args:
        path: Ending in .uff, .unv or .bunv for a universal file; any other is read as CSV.

    Raises:
        FrequencyResponseError: If it cannot be read, or holds none.
    """
    path = Path(path)
    try:
        with path.open('rb') as file:
            head = file.read(64)
    except OSError as error:
        raise FrequencyResponseError(f'{path} cannot be read: {reason_of(error)}.') from None
    universal = path.suffix.lower() in {'.uff', '.unv', '.bunv', '.uf'} or re.match(
        rb'\s*-1\s*\r?\n\s*\d+', head
    )
    found = list(_universal(path) if universal else _csv(path))
    if not found:
        raise FrequencyResponseError(f'{path} holds no frequency response.')
    return found


def _universal(path: Path) -> Iterator[FrequencyResponse]:
    """Those of a universal file, each with the coherence of the same two points."""
    pyuff = optional('pyuff', 'a universal file')
    try:
        with contextlib.redirect_stdout(None):  # pyuff prints some sets as it reads them
            sets: Any = pyuff.UFF(str(path)).read_sets()
    except Exception as error:  # noqa: BLE001 -- pyuff raises whatever a broken file makes it
        raise FrequencyResponseError(f'{path} is no sound universal file: {error}.') from None
    sets = [sets] if isinstance(sets, dict) else sets
    functions = [entry for entry in sets if entry.get('type') == 58]
    if functions and not any(entry['func_type'] == _UFF_FRF for entry in functions):
        others = {_UFF_FUNCTIONS.get(e['func_type'], 'another function') for e in functions}
        raise FrequencyResponseError(
            f'{path} holds no frequency response, but {" and ".join(sorted(others))}: export the '
            'response over the force of the hammer.'
        )
    coherences = {_points(e): e for e in functions if e['func_type'] == _UFF_COHERENCE}
    for entry in functions:
        if entry['func_type'] != _UFF_FRF:
            continue
        order = _UFF_ORDERS.get(entry.get('ordinate_spec_data_type'))
        over = entry.get('orddenom_spec_data_type', _UFF_FORCE)
        labels = (entry.get(f'{axis}_axis_units_lab') or '' for axis in ('ordinate', 'orddenom'))
        unit, below = (
            '' if label.strip().upper() == 'NONE' else label.strip() for label in labels
        )
        if over not in {_UFF_FORCE, 0} or (order is None and not unit):
            raise FrequencyResponseError(
                f'{path}: a function is not said to be displacement, velocity or acceleration '
                'over force.'
            )
        unit = unit or ('m', 'm/s', 'm/s2')[order or 0]
        whole = unit.rpartition('/')[2].strip().lower() in _FORCES
        form, scale = _unit(unit if whole else f'{unit}/{below or "N"}', path)
        if order is not None and ORDERS[form] != order:
            raise FrequencyResponseError(
                f'{path}: a function is said to be {[*ORDERS][order]} and has the unit {unit}.'
            )
        beside = coherences.get(_points(entry))
        coherence = None if beside is None else np.clip(np.real(beside['data']), 0.0, 1.0)
        data = np.asarray(entry['data'], np.complex128) * scale
        yield FrequencyResponse(np.asarray(entry['x'], float), data, form, coherence, str(path))


def _points(entry: dict[str, Any]) -> tuple[Any, ...]:
    names = ('rsp_node', 'rsp_dir', 'ref_node', 'ref_dir')
    return tuple(entry.get(name) for name in names)


def _unit(text: str, path: Path, column: str = '') -> tuple[str, float]:
    """Form and factor to SI of a unit: `um/N`, `g/N`, `(m/s^2)/lbf`, `(1/N)*(m/s²)`."""
    # What is no text of UTF-8 was a small two.
    plain = re.sub(r'[()*·^\s]', '', text.replace('²', '2').replace('\ufffd', '2'))
    before = re.match(r'1/(kN|N|lbf)(.+?)(?:/N)?$', plain)
    motion, force = (before[2], before[1]) if before else plain.rpartition('/')[::2]
    if motion.lower() in _MOTIONS and force.lower() in _FORCES:
        form, factor = _MOTIONS[motion.lower()]
        return form, factor / _FORCES[force.lower()]
    raise FrequencyResponseError(
        f'{path}: the unit{column and f" of {column}"} is {text!r}: it must be a length (m, mm, '
        'um, in), such a length /s or /s2, or g, over a force (N, kN, lbf).'
    )


def _csv(path: Path) -> Iterator[FrequencyResponse]:
    """That of a CSV whose head names the columns and their units."""
    text = path.read_text(encoding='utf-8-sig', errors='replace')
    numbered = enumerate(text.splitlines(), 1)
    lines = [(k, line) for k, line in numbered if line.strip() and not line.startswith('#')]
    if not lines:
        raise FrequencyResponseError(f'{path} is empty.')
    separator = next((mark for mark in (';', '\t', ',') if mark in lines[0][1]), ',')
    rows = [(k, next(csv.reader([line], delimiter=separator))) for k, line in lines]
    head = rows.pop(0)[1]
    columns, units = dict[str, int](), dict[str, str]()
    for k, cell in enumerate(head):
        match = re.match(r'\s*(\w+)\s*(?:[(\[]\s*(.*?)\s*[)\]])?\s*$', cell)
        word, unit = (match[1].lower(), match[2] or '') if match else (f'column {k + 1}', '')
        name = next((known for known in _COLUMNS if known.startswith(word)), word)
        if name in columns and name in _COLUMNS:
            raise FrequencyResponseError(f'{path}: its head has two columns {name}: leave one.')
        columns[name], units[name] = k, unit
    parts = ('real', 'imaginary') if 'real' in columns else ('magnitude', 'phase')
    for name in ('frequency', *parts):
        if name not in columns:
            raise FrequencyResponseError(
                f'{path}: its head must name frequency, and real and imaginary or magnitude and '
                f'phase, and has no {name}.'
            )
    if not units[parts[0]]:
        raise FrequencyResponseError(
            f'{path}: its head gives no unit of {parts[0]}: it must be there in parentheses, '
            f'such as {parts[0]} (m/N).'
        )
    form, scale = _unit(units[parts[0]], path, parts[0])
    per_hertz = _PER_HERTZ.get(units['frequency'].lower())
    if per_hertz is None or (parts[0] == 'real' and units['imaginary'] not in {'', units['real']}):
        given = ', '.join(filter(None, units.values()))
        allowed = 'Hz, kHz or rad/s, and the imaginary part in the unit of the real one'
        raise FrequencyResponseError(
            f'{path}: its head has the units {given}: the frequency must be in {allowed}.'
        )
    table = np.array([_numbers(row, len(head), separator, f'{path}, line {k}') for k, row in rows])
    table = table.reshape(-1, len(head))
    first, second = (table[:, columns[name]] for name in parts)
    if parts[0] == 'magnitude':
        angle = second if units['phase'].lower().startswith('rad') else np.radians(second)
        first, second = first * np.cos(angle), first * np.sin(angle)
    frequency = table[:, columns['frequency']] / per_hertz
    coherence = table[:, columns['coherence']] if 'coherence' in columns else None
    yield FrequencyResponse(frequency, (first + 1j * second) * scale, form, coherence, str(path))


def _numbers(row: list[str], columns: int, separator: str, where: str) -> list[float]:
    """A row of the table; the comma of a decimal is a point."""
    if len(row) != columns:
        mark = {'\t': 'tabs'}.get(separator, repr(separator))
        said = f'it has {len(row)} of the {columns} columns that the head has, separated by {mark}'
        raise FrequencyResponseError(f'{where}: {said} as those of the head.')
    return [_number(cell, where) for cell in row]


def _number(cell: str, where: str) -> float:
    with contextlib.suppress(ValueError):
        if np.isfinite(value := float(cell.replace(',', '.'))):
            return value
    raise FrequencyResponseError(f'{where}: {cell!r} is no finite number.')


_COLUMNS = ('frequency', 'real', 'imaginary', 'magnitude', 'phase', 'coherence')
