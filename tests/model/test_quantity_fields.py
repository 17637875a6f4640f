"""Limits of a field: what is let through, what is refused and how the refusal reads."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from enum import Enum
from typing import Any

import numpy as np
import pytest

from lathe_chatter.errors import ParameterError
from lathe_chatter.model.quantity_fields import (
    Quantity,
    check_choice,
    check_fields,
    quantity,
    quantity_of,
)


class _Colour(Enum):
    RED = 'red'
    BLUE = 'blue'


@dataclass(frozen=True)
class _Part:
    length: float = quantity('length', 'm', default=1.0, high=2.0)
    mass: float = quantity('mass', 'kg', default=1.0, exclusive=True)
    label: str = ''


@pytest.mark.parametrize(
    'value', [1, 1.0, np.float32(1.0), np.float64(1.0), np.int64(1), np.array(1.0)]
)
def test_every_kind_of_number_becomes_a_float(value: Any) -> None:
    number = Quantity('length', 'm', high=2.0).check('length', value)
    assert type(number) is float
    assert number == 1.0


@pytest.mark.parametrize(
    'value', [True, '1', None, 1j, [1.0], math.nan, math.inf, -math.inf, np.array([1.0, 1.0])]
)
def test_what_is_no_finite_number_is_refused(value: Any) -> None:
    with pytest.raises(ParameterError):
        Quantity('length', 'm').check('length', value)


@pytest.mark.parametrize(
    ('limits', 'value', 'accepted'),
    [
        (Quantity('', low=1.0, high=2.0), 1.0, True),
        (Quantity('', low=1.0, high=2.0), 2.0, True),
        (Quantity('', low=1.0, high=2.0), math.nextafter(1.0, 0.0), False),
        (Quantity('', low=1.0, high=2.0), math.nextafter(2.0, 3.0), False),
        (Quantity('', exclusive=True), 0.0, False),
        (Quantity('', exclusive=True), 5e-324, True),
        (Quantity('', low=0.01, high=1.0, or_zero=True), 0.0, True),
        (Quantity('', low=0.01, high=1.0, or_zero=True), 0.005, False),
    ],
)
def test_limits_are_closed_unless_exclusive(
    limits: Quantity, value: float, *, accepted: bool
) -> None:
    if accepted:
        assert limits.check('x', value) == value
    else:
        with pytest.raises(ParameterError):
            limits.check('x', value)


@pytest.mark.parametrize(
    ('limits', 'sentence'),
    [
        (Quantity('', 'm', high=2.0), 'x is -3.0 m: it must be a finite number from 0 to 2 m.'),
        (Quantity('', 'm'), 'x is -3.0 m: it must be a finite number at least 0 m.'),
        (Quantity('', exclusive=True), 'x is -3.0: it must be a finite number greater than 0.'),
        (
            Quantity('', 'Hz', high=9.0, exclusive=True),
            'x is -3.0 Hz: it must be a finite number above 0 and up to 9 Hz.',
        ),
        (
            Quantity('', low=0.5, high=9.0, or_zero=True),
            'x is -3.0: it must be 0 or a finite number from 0.5 to 9.',
        ),
    ],
)
def test_a_refusal_names_field_value_unit_and_limit(limits: Quantity, sentence: str) -> None:
    with pytest.raises(ParameterError) as refusal:
        limits.check('x', -3.0)
    assert str(refusal.value) == sentence
    assert (refusal.value.name, refusal.value.value) == ('x', -3.0)
    assert (refusal.value.unit, refusal.value.allowed) == (limits.unit, limits.allowed)


def test_a_text_is_shown_as_one() -> None:
    with pytest.raises(ParameterError, match=r"^x is '3': .* m"):
        Quantity('', 'm').check('x', '3')


def test_fields_carry_their_limits_and_are_stored_as_floats() -> None:
    part = _Part(length=np.float32(0.5), mass=2)
    check_fields(part)
    assert (type(part.length), type(part.mass)) == (float, float)
    found = {entry.name: quantity_of(entry) for entry in fields(_Part)}
    assert found['length'] == Quantity('length', 'm', high=2.0)
    assert found['label'] is None


def test_the_first_wrong_field_is_named_with_its_prefix() -> None:
    with pytest.raises(ParameterError, match=r'^tool\.length is 3\.0 m'):
        check_fields(_Part(length=3.0, mass=-1.0), 'tool.')


def test_a_choice_is_a_member_or_its_value() -> None:
    assert check_choice('colour', 'red', _Colour) is _Colour.RED
    assert check_choice('colour', _Colour.BLUE, _Colour) is _Colour.BLUE
    with pytest.raises(ParameterError) as refusal:
        check_choice('colour', 'green', _Colour)
    assert str(refusal.value) == "colour is 'green': it must be one of red, blue."
