"""The findings against closed forms, and against other numbers than the paper's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lathe_chatter.model import Machine
from lathe_chatter.paper.open_questions import (
    clearance_effect,
    coefficient_range,
    figure_window,
    stiffness_effect,
    verdicts_at,
)
from lathe_chatter.stability import critical_depth

MACHINE = Machine()


def test_the_range_of_c_is_where_the_closed_form_limits_meet_the_depths() -> None:
    """C w is what chatters, so the limit of C is C times critical depth over depth."""
    found = coefficient_range(MACHINE)
    c = MACHINE.cutting_coefficient
    seated = max(critical_depth(MACHINE, rpm, seated=True) for rpm in (3000.0, 10000.0))
    floating = min(critical_depth(MACHINE, rpm, seated=False) for rpm in (3000.0, 10000.0))
    assert found.low == pytest.approx(c * seated / 0.5e-3, rel=1e-6)
    assert found.high == pytest.approx(c * floating / 0.5e-3, rel=1e-6)
    assert 3.26e6 < found.low < 3.28e6
    assert 4.30e6 < found.high < 4.31e6


def test_as_printed_c_leaves_only_the_stable_verdicts() -> None:
    assert sum(verdicts_at(MACHINE, 3.5e-9)) == 2
    assert all(verdicts_at(MACHINE, 3.5e6))
    assert sum(verdicts_at(MACHINE, 3.5e9)) == 12


def test_a_stiffer_bearing_moves_the_verdict_not_a_larger_clearance() -> None:
    effect = clearance_effect(MACHINE)
    assert len(set(effect.growth_rates)) == 1
    shares = np.array(effect.amplitudes) / np.array(effect.clearances)
    # The step to a third of the clearance dominates where it is much larger than the history.
    assert shares[-1] == pytest.approx(shares[-2], rel=1e-2)
    stiffness = stiffness_effect(MACHINE)
    assert stiffness.limits[0] == pytest.approx(critical_depth(MACHINE, 3000.0, seated=False))
    assert stiffness.limits.min() < 0.75 * stiffness.limits[0]
    assert stiffness.limits[stiffness.shares.searchsorted(1.0)] > stiffness.limits[0]


def test_the_legible_axes_are_those_of_whole_turns() -> None:
    slow, fast = figure_window(3000.0), figure_window(10000.0)
    assert slow.shortest <= 5 * 60.0 / 3000.0 <= slow.longest
    assert fast.shortest <= 20 * 60.0 / 10000.0 <= fast.longest


def test_with_another_coefficient_no_duration_fits() -> None:
    other = replace(MACHINE, cutting_coefficient=6e6)
    assert np.isnan(figure_window(10000.0, other).shortest)
