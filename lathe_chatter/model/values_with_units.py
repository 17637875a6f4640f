"""Values as a shop writes them: `312 Hz`, `1500 MPa`, `0.2 mm/rev`, `3000 rpm`, `5e6`.

A table of the units of this field, by the SI unit (or rev/min) that the quantity has here. A
library of units would not do it better: none knows that `Hz` and `rad/s` are a turn apart, that a
feed may be per revolution, or that `rpm` is the unit in which the contract gives speeds.
"""

from __future__ import annotations

import math
import re
from decimal import Decimal

_TURN = 2.0 * math.pi
_G = 9.80665
_LENGTH = {'m': 1.0, 'mm': 1e-3, 'um': 1e-6, 'in': 0.0254}
_RATE = {'Hz': 1.0, 'kHz': 1e3, '1/s': 1.0}

UNITS: dict[str, dict[str, float]] = {
    '': {'': 1.0, '%': 0.01},
    'Hz': {**_RATE, 'rad/s': 1.0 / _TURN},
    'rad/s': {'rad/s': 1.0, **{name: _TURN * factor for name, factor in _RATE.items()}},
    'rev/min': {'rev/min': 1.0, 'rpm': 1.0, '1/min': 1.0, 'Hz': 60.0, 'rad/s': 60.0 / _TURN},
    'rev/min per s': {'rev/min per s': 1.0, 'rpm/s': 1.0, 'rev/min/s': 1.0},
    'kg': {'kg': 1.0, 'g': 1e-3, 't': 1e3, 'lb': 0.45359237},
    'm': _LENGTH,
    'm/rev': {**{f'{name}/rev': factor for name, factor in _LENGTH.items()}, **_LENGTH},
    'm/s': {'m/s': 1.0, 'mm/s': 1e-3, 'mm/min': 1e-3 / 60.0, 'm/min': 1.0 / 60.0},
    'm/s2': {'m/s2': 1.0, 'mm/s2': 1e-3, 'g': _G},
    'N/m': {
        'N/m': 1.0, 'N/mm': 1e3, 'N/um': 1e6, 'kN/mm': 1e6, 'kN/m': 1e3, 'MN/m': 1e6, 'GN/m': 1e9,
    },
    'N/m2': {
        'N/m2': 1.0, 'N/mm2': 1e6, 'Pa': 1.0, 'kPa': 1e3, 'MPa': 1e6, 'GPa': 1e9,
    },
    'kg m': {'kg m': 1.0, 'g mm': 1e-6, 'kg mm': 1e-3},
    'N s': {'N s': 1.0, 'kN s': 1e3, 'mN s': 1e-3, 'uN s': 1e-6},
    'N': {'N': 1.0, 'mN': 1e-3, 'kN': 1e3},
    'rev': {'rev': 1.0, 'deg': 1.0 / 360.0, 'rad': 1.0 / _TURN},
    's': {'s': 1.0, 'ms': 1e-3, 'us': 1e-6, 'min': 60.0},
    'N/sqrt(Hz)': {'N/sqrt(Hz)': 1.0},
}  # fmt: skip
"""By the unit of a quantity: what may be written behind a number, and its factor."""

_VALUE = re.compile(r'^\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*$')


def number_in(text: str, unit: str) -> float | None:
    """The number that a text is in a unit; None where it is none, or of another kind.

    Args:
        text: A number, alone or with one of the units of `UNITS[unit]`.
        unit: SI, or rev/min.
    """
    match = _VALUE.match(text)
    if match is None:
        return None
    number, written = Decimal(match[1]), _plain(match[2])
    if not written:
        return float(number)
    factors = UNITS.get(unit, {unit: 1.0})
    factor = next((f for name, f in factors.items() if _plain(name) == written), None)
    # Decimal: 5 um is 5e-6 m, not the next number below it.
    return None if factor is None else float(number * Decimal(repr(factor)))


def _plain(unit: str) -> str:
    """A unit without what people write in different ways."""
    for old, new in (('µ', 'u'), ('μ', 'u'), ('²', '2'), ('^', ''), ('·', ' '), ('*', ' ')):
        unit = unit.replace(old, new)
    return unit.replace(' ', '')


def units_of(unit: str) -> str:
    """The units that may be written for a quantity, as the end of a sentence."""
    return ', '.join(name for name in UNITS.get(unit, {unit: 1.0}) if name)
