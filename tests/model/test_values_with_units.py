from __future__ import annotations

import math

import pytest

from lathe_chatter.model.values_with_units import UNITS, number_in, units_of


@pytest.mark.parametrize(
    ('text', 'unit', 'value'),
    [
        ('5e6', 'N/m2', 5e6),
        ('5.0e6', 'N/m2', 5e6),
        ('5e-06', 'm', 5e-6),
        ('1500 MPa', 'N/m2', 1.5e9),
        ('1500 N/mm²', 'N/m2', 1.5e9),
        ('2.1e7 N/m', 'N/m', 2.1e7),
        ('21N/um', 'N/m', 2.1e7),
        ('21 N/µm', 'N/m', 2.1e7),
        ('312 Hz', 'Hz', 312.0),
        ('1961 rad/s', 'Hz', 1961.0 / (2.0 * math.pi)),
        ('100 Hz', 'rad/s', 200.0 * math.pi),
        ('3 %', '', 0.03),
        ('20 kg', 'kg', 20.0),
        ('50 g', 'kg', 0.05),
        ('2 g', 'm/s2', 2.0 * 9.80665),
        ('2 mm', 'm', 0.002),
        ('0.2 mm/rev', 'm/rev', 0.0002),
        ('0.2 mm', 'm/rev', 0.0002),
        ('3000 rpm', 'rev/min', 3000.0),
        ('50 Hz', 'rev/min', 3000.0),
        ('6 m/min', 'm/s', 0.1),
    ],
)
def test_a_value_with_its_unit(text: str, unit: str, value: float) -> None:
    assert number_in(text, unit) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    ('text', 'unit'),
    [('2 mm', 'kg'), ('MPa', 'N/m2'), ('1,5 mm', 'm'), ('1 2', ''), ('', 'm'), ('2 furlong', 'm'),
     ('3 m', 'N/m'), ('nan', 'm'), ('0.2 mm/rev', 'm')],
)  # fmt: skip
def test_what_is_no_such_value_is_none(text: str, unit: str) -> None:
    assert number_in(text, unit) is None


def test_every_unit_can_be_named_and_means_one_thing() -> None:
    for unit, names in UNITS.items():
        assert names.get(unit, 1.0) == 1.0
        assert all(name in units_of(unit) for name in names if name)
