from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from lathe_chatter.errors import ParameterError
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import BearingContact, Cut, Machine
from lathe_chatter.samples import SAMPLE_COLUMNS
from lathe_chatter.stability import (
    SpeedLaw,
    critical_depth,
    floquet,
    lobe_boundary,
    recommend_speeds,
    rightmost_root,
    varied_growth_rates,
)

SAMPLE_RATE = 1e4


def _cut(
    rpm: float, depth: float, amplitude: float, frequency: float, contact: str = 'none'
) -> Cut:
    return Cut(
        rpm,
        depth,
        bearing_contact=BearingContact(contact),
        speed_variation_amplitude=amplitude,
        speed_variation_frequency=frequency,
    )


def _multiplier_of_a_run(cut: Cut, periods: int, skipped: int) -> complex:
    """The multiplier mu in y(t + 2 T) - 2 Re(mu) y(t + T) + |mu|^2 y(t) = 0, fitted to a run.

    y is the relative velocity: a seated workpiece is displaced for good.
    """
    lathe = VirtualLathe(
        cut=cut, sample_rate=SAMPLE_RATE, tool_leaves_cut=False, displacement_limit=1e12
    )
    each = round(SAMPLE_RATE / cut.speed_variation_frequency)
    samples = lathe.advance(periods * each)[skipped * each :]
    first, second = (SAMPLE_COLUMNS.index(f'{body}_velocity') for body in ('tool', 'workpiece'))
    y = (samples[:, first] - samples[:, second]).reshape(-1, each)
    past = np.stack((y[1:-1].ravel(), y[:-2].ravel()), axis=1)
    weight = 1.0 / np.repeat(np.abs(y[:-2]).max(axis=1), each)
    solution = np.linalg.lstsq(past * weight[:, None], y[2:].ravel() * weight, rcond=None)[0]
    roots = np.roots([1.0, -solution[0], -solution[1]])
    best = roots[np.argmax(np.abs(roots))]
    return complex(best.real, abs(best.imag))


@pytest.mark.parametrize('rpm', [1000.0, 3000.0, 11000.0])
@pytest.mark.parametrize('seated', [False, True])
@pytest.mark.parametrize('frequency', [2.0, 37.0])
def test_at_constant_speed_the_growth_is_that_of_the_rightmost_root(
    rpm: float, frequency: float, *, seated: bool
) -> None:
    found = floquet(Machine(), _cut(rpm, 8e-4, 0.0, frequency), seated=seated)
    root = rightmost_root(Machine(), rpm, 8e-4, seated=seated)
    assert found.growth_rate == pytest.approx(root.real, abs=1e-8)
    turned = np.exp(root * found.period)
    assert found.multiplier.real == pytest.approx(turned.real, abs=1e-8 * abs(turned))


def test_without_depth_the_least_damped_mode_decides() -> None:
    found = floquet(Machine(), _cut(3000.0, 0.0, 0.3, 10.0), seated=False)
    assert found.growth_rate == pytest.approx(-32.5, abs=1e-8)


@pytest.mark.parametrize('rpm', [800.0, 3000.0, 9000.0])
@pytest.mark.parametrize('frequency', [1.0, 13.0])
def test_finer_elements_change_nothing(rpm: float, frequency: float) -> None:
    cut = _cut(rpm, 1e-3, 0.25, frequency)
    rates = [
        floquet(Machine(), cut, seated=True, refinement=refinement).growth_rate
        for refinement in (1, 2)
    ]
    assert rates[0] == pytest.approx(rates[1], abs=1e-8)


@pytest.mark.parametrize(
    ('rpm', 'amplitude', 'frequency', 'contact'),
    [
        (3000.0, 0.2, 10.0, 'none'),
        (3000.0, 0.1, 20.0, 'seated'),
        (5000.0, 0.3, 12.5, 'none'),
        (1500.0, 0.05, 8.0, 'seated'),
    ],
)
def test_the_virtual_lathe_grows_by_the_multiplier(
    rpm: float, amplitude: float, frequency: float, contact: str
) -> None:
    cut = _cut(rpm, 1e-3, amplitude, frequency, contact)
    expected = floquet(Machine(), cut, seated=contact == 'seated').multiplier
    measured = _multiplier_of_a_run(cut, periods=30, skipped=18)
    assert measured == pytest.approx(expected, rel=1e-4)


def test_variation_stabilises_a_slow_cut_that_chatters_at_constant_speed() -> None:
    cut = _cut(3000.0, 1e-3, 0.2, 5.0)
    assert rightmost_root(Machine(), 3000.0, 1e-3, seated=False).real > 10.0
    assert floquet(Machine(), cut, seated=False).growth_rate < -5.0


def test_a_chart_holds_the_growth_rate_of_each_point() -> None:
    speeds, depths = np.array([2000.0, 6000.0]), np.array([3e-4, 9e-4, 2e-3])
    cut = _cut(3000.0, 1e-3, 0.15, 15.0)
    chart = varied_growth_rates(Machine(), cut, speeds, depths, seated=False)
    assert chart.shape == (3, 2)
    for (row, column), rate in np.ndenumerate(chart):
        changed = cut.with_changes(spindle_speed_rpm=speeds[column], depth_of_cut=depths[row])
        single = floquet(Machine(), changed, seated=False).growth_rate
        assert rate == pytest.approx(single, abs=1e-8)


def test_a_chart_of_an_impossible_depth_is_refused() -> None:
    with pytest.raises(ParameterError, match='depth_of_cut'):
        varied_growth_rates(Machine(), Cut(), [3000.0], [-1.0], seated=False)


def test_a_law_may_be_a_text_and_one_that_is_none_is_refused() -> None:
    cut = _cut(3000.0, 8e-4, 0.2, 20.0)
    rates = {law: floquet(Machine(), cut, seated=False, law=law).growth_rate for law in SpeedLaw}
    assert abs(rates[SpeedLaw.SPEED] - rates[SpeedLaw.DELAY]) > 0.1
    for law, rate in rates.items():
        assert floquet(Machine(), cut, seated=False, law=law.value).growth_rate == rate
        varied = varied_growth_rates(Machine(), cut, 3000.0, 8e-4, seated=False, law=law.value)
        assert varied.item() == pytest.approx(rate, abs=1e-6)
    with pytest.raises(ParameterError, match="law is 'rubbish': it must be one of speed, delay"):
        floquet(Machine(), cut, seated=False, law='rubbish')


@pytest.mark.parametrize('call', [floquet, varied_growth_rates, critical_depth, rightmost_root,
                                  lobe_boundary, recommend_speeds])  # fmt: skip
def test_a_text_for_seated_is_refused(call: Callable[..., object]) -> None:
    """`'no'` would be taken as yes."""
    cut = _cut(3000.0, 8e-4, 0.2, 20.0)
    given: dict[Callable[..., object], tuple[object, ...]] = {
        floquet: (cut,), varied_growth_rates: (cut, 3000.0, 8e-4), critical_depth: (3000.0,),
        rightmost_root: (3000.0, 8e-4), lobe_boundary: (), recommend_speeds: (5e-4,),
    }  # fmt: skip
    with pytest.raises(ParameterError, match="seated is 'no': it must be True or False"):
        call(Machine(), *given[call], seated='no')
