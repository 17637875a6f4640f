"""Where a function first becomes negative, against polynomials whose roots are known."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from numpy.polynomial import Polynomial, polynomial
from support.python_entry import with_entry

from lathe_chatter.array_types import Array
from lathe_chatter.lathe.integrator import first_crossing as module
from lathe_chatter.lathe.integrator.first_crossing import NEVER
from lathe_chatter.lathe.integrator.propagation import TERMS

first_crossing = with_entry(module.first_crossing)
may_turn_back = with_entry(module.may_turn_back)


def _crossing(series: Array, sign: float) -> float:
    margin = sign * series
    p = Polynomial(margin)
    return first_crossing(margin, TERMS, float(p(1.0)), float(p.deriv()(1.0)))


def _series(coefficients: Sequence[float] | Array) -> Array:
    series = np.zeros(TERMS + 1)
    series[: len(coefficients)] = coefficients
    return series


@pytest.mark.parametrize('sign', [1.0, -1.0])
@pytest.mark.parametrize('root', [1e-9, 0.1, 0.5, 0.999999])
def test_a_single_crossing(sign: float, root: float) -> None:
    series = _series(sign * polynomial.polymul([root, -1.0], [1.0, 0.2, 0.3]))
    assert _crossing(series, sign) == pytest.approx(root, abs=1e-15)


@pytest.mark.parametrize('sign', [1.0, -1.0])
@pytest.mark.parametrize('distance', [0.4, 1e-2, 1e-4, 1e-6])
def test_the_first_of_two_crossings_in_one_piece(sign: float, distance: float) -> None:
    middle = 0.37
    roots = [middle - distance / 2.0, middle + distance / 2.0]
    series = _series(sign * polynomial.polyfromroots(roots))
    # At the root the slope is `distance`, so rounding moves it by its inverse.
    assert _crossing(series, sign) == pytest.approx(roots[0], abs=2e-16 / distance)


@pytest.mark.parametrize('margin', [1e-3, 1e-12])
def test_a_near_miss_is_no_crossing(margin: float) -> None:
    series = _series(polynomial.polyadd(polynomial.polyfromroots([0.4, 0.4]), [margin]))
    assert _crossing(series, 1.0) == NEVER


def test_a_margin_that_grows_from_zero_is_no_crossing() -> None:
    """As just after an event, where rounding may leave it a trifle negative."""
    assert _crossing(_series([0.0, 1.0]), 1.0) == NEVER
    assert _crossing(_series([-1e-20, 1.0]), 1.0) == NEVER


def test_a_margin_that_falls_from_zero_crosses_at_once() -> None:
    assert _crossing(_series([0.0, -1.0]), 1.0) == 0.0


def test_a_margin_that_rises_from_zero_and_falls_below_it_crosses_once() -> None:
    series = _series(polynomial.polymul([0.0, 1.0], [0.6, -1.0]))
    assert _crossing(series, 1.0) == pytest.approx(0.6, abs=1e-15)


def test_a_piece_of_a_vibration() -> None:
    """cos(a + 0.12 s) by its Taylor series: the zero is known in closed form."""
    start, rate = 0.5 * math.pi - 0.07, 0.12
    derivatives = [math.cos(start + 0.5 * math.pi * k) * rate**k for k in range(TERMS + 1)]
    series = _series([each / math.factorial(k) for k, each in enumerate(derivatives)])
    assert _crossing(series, 1.0) == pytest.approx(0.07 / 0.12, abs=1e-14)


def test_a_margin_that_may_not_turn_back_never_crosses() -> None:
    """Whatever `may_turn_back` passes over has no crossing in pieces of a vibration."""
    rng = np.random.default_rng(5)
    crossings = 0
    for _ in range(2000):
        phase = rng.uniform(0.0, 2.0 * math.pi)
        offset = math.cos(phase + rng.uniform(-0.02, 0.14))
        s = np.linspace(0.0, 1.0, 201)
        margin = np.cos(phase + 0.12 * s) - offset
        if margin[0] <= 0.0:
            continue
        slope = -0.12 * np.sin(phase + 0.12 * s)
        crosses = bool((margin < 0.0).any())
        crossings += crosses
        if not may_turn_back(margin[0], slope[0], margin[-1], slope[-1], 1.0):
            assert not crosses
    assert crossings > 200
