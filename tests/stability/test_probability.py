from __future__ import annotations

import math

import numpy as np
import pytest

from lathe_chatter.errors import ParameterError
from lathe_chatter.model import BearingContact, Cut, Machine, Mode
from lathe_chatter.model.uncertainty import Uncertainty, uncertainty_from
from lathe_chatter.stability import rightmost_roots
from lathe_chatter.stability.probability import stability_probability

CUT = Cut(bearing_contact=BearingContact.NONE)
SPEEDS = np.linspace(2000.0, 4000.0, 41)
# A workpiece so stiff that the tool alone has a limit: b = 2 k zeta (1 + zeta)/C, the textbook's.
TEXTBOOK = Machine(
    Mode(1.0, 2000.0, 0.03), Mode(1e6, 1e5, 0.5), bearing_stiffness=0.0, cutting_coefficient=1e9
)


def test_an_uncertain_coefficient_alone_gives_the_lognormal_quantile() -> None:
    known = Uncertainty().with_error('cutting_coefficient', 0.15)
    chart = stability_probability(Machine(), known, CUT, SPEEDS, machines=4000, seed=1)
    exact = stability_probability(Machine(), Uncertainty(), CUT, SPEEDS, machines=1).limits[0]
    # The limit is inverse to C: its logarithm scatters by 0.15 about the exact one.
    quantile = np.exp(-1.6449 * 0.15)
    np.testing.assert_allclose(chart.safe_depth(0.95) / exact, quantile, rtol=0.015)
    np.testing.assert_allclose(chart.at(exact[:1])[0, 0], 0.5, atol=0.03)
    np.testing.assert_allclose(chart.shares, 1.0, atol=1e-6)


def test_the_textbook_limit_scatters_as_its_damping() -> None:
    limit = 2.0 * 4e6 * 0.03 * 1.03 / 1e9
    known = Uncertainty().with_mode('tool', 0, {'damping_ratio': 0.2})
    slow = np.array([60.0, 75.0, 90.0])  # many lobes: the minimum is at every speed, nearly
    chart = stability_probability(TEXTBOOK, known, CUT, slow, machines=2000)
    assert np.median(chart.limits) == pytest.approx(limit, rel=0.02)
    spread = np.log(chart.limits).std(axis=0)
    np.testing.assert_allclose(spread, 0.2 * (1.0 + 0.03 / 1.03), rtol=0.1)


def test_of_the_cuts_said_to_be_stable_with_95_percent_95_percent_are() -> None:
    known = uncertainty_from('frequency=1%,damping=15%,stiffness=4%,C=10%', Machine())
    chart = stability_probability(Machine(), known, CUT, SPEEDS[::8], machines=2000, seed=5)
    truths, _ = known.draw(Machine(), 400, seed=77)  # other machines than those of the chart
    roots = rightmost_roots(
        np.array(truths, object)[:, None],
        chart.spindle_speed_rpm,
        chart.safe_depth(0.95),
        seated=False,
    )
    stable = roots.real < 0.0
    assert np.mean(stable) == pytest.approx(0.95, abs=3.0 * math.sqrt(0.05 * 0.95 / 400))


def test_what_is_worth_measuring_again_is_what_makes_the_limit_uncertain() -> None:
    known = uncertainty_from('C=2%', Machine()).with_mode('tool', 0, {'damping_ratio': 0.3})
    chart = stability_probability(Machine(), known, CUT, SPEEDS, machines=600)
    name, share = chart.worth_repeating(3000.0)[0]
    assert name == 'tool.modes[0].damping_ratio'
    assert share > 0.8


def test_the_same_seed_draws_the_same_and_a_probability_is_one() -> None:
    known = uncertainty_from('C=10%', Machine())
    one, two = (
        stability_probability(Machine(), known, CUT, SPEEDS, machines=50, seed=9) for _ in range(2)
    )
    assert one.limits.tobytes() == two.limits.tobytes()
    with pytest.raises(ParameterError, match='probability'):
        one.safe_depth(1.5)
