"""The growth map against single roots and multipliers, in the contact that holds at each point."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from lathe_chatter.errors import ParameterError
from lathe_chatter.model import BearingContact, Cut, Machine
from lathe_chatter.stability import (
    SpeedLaw,
    contact_at,
    floquet,
    growth_map,
    rightmost_root,
    safe_limit,
)

MACHINE = Machine()
SPEEDS, DEPTHS = np.linspace(2000.0, 6000.0, 9), np.linspace(0.2e-3, 1.2e-3, 6)


def test_a_map_is_shown_on_a_line() -> None:
    shown = repr(growth_map(MACHINE, Cut(), np.linspace(2000.0, 6000.0, 30), DEPTHS))
    assert shown.startswith('GrowthMap(spindle_speed_rpm=<30, 2000 to 6000>, depth_of_cut=<6, ')
    assert 'growth_rate=<6 x 30, ' in shown
    assert 'of 180 true>' in shown
    assert len(shown) < 300


@pytest.mark.parametrize('contact', list(BearingContact))
def test_each_point_is_the_root_in_its_contact(contact: BearingContact) -> None:
    cut = Cut(bearing_contact=contact)
    found = growth_map(MACHINE, cut, SPEEDS, DEPTHS)
    assert found.growth_rate.shape == found.seated.shape == (6, 9)
    for row, depth in enumerate(DEPTHS.tolist()):
        for column, rpm in enumerate(SPEEDS.tolist()):
            here = cut.with_changes(spindle_speed_rpm=rpm, depth_of_cut=depth)
            seated = contact_at(MACHINE, here).seated
            assert found.seated[row, column] == seated
            root = rightmost_root(MACHINE, rpm, depth, seated=seated)
            assert found.growth_rate[row, column] == pytest.approx(root.real, abs=1e-9)
    if contact is BearingContact.GAP:
        assert found.seated.any()
        assert not found.seated.all()


def test_no_library_warns_of_it() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        growth_map(MACHINE, Cut(), [2800, 3000], [4e-4, 6e-4])


def test_its_zero_is_the_edge_of_the_safe_region() -> None:
    cut = Cut()
    edge = safe_limit(MACHINE, cut, SPEEDS).depth_of_cut
    for share, grows in ((0.99, False), (1.01, True)):
        for rpm, depth in zip(SPEEDS.tolist(), (share * edge).tolist(), strict=True):
            growth = growth_map(MACHINE, cut, rpm, min(depth, 0.01)).growth_rate
            assert (growth > 0.0) == (grows and depth < 0.01)


def test_with_a_varying_speed_each_point_is_a_multiplier() -> None:
    cut = Cut(speed_variation_amplitude=0.2, speed_variation_frequency=20.0)
    speeds, depths = SPEEDS[::4], DEPTHS[::2]
    found = growth_map(MACHINE, cut, speeds, depths)
    for row, depth in enumerate(depths.tolist()):
        for column, rpm in enumerate(speeds.tolist()):
            here = cut.with_changes(spindle_speed_rpm=rpm, depth_of_cut=depth)
            expected = floquet(MACHINE, here, seated=bool(found.seated[row, column]))
            assert found.growth_rate[row, column] == pytest.approx(expected.growth_rate, abs=1e-6)


def test_a_speed_that_no_spindle_has_is_refused() -> None:
    with pytest.raises(ParameterError, match=r'spindle_speed_rpm is 0\.5'):
        growth_map(MACHINE, Cut(), [0.5], [1e-3])


def test_a_law_may_be_a_text_and_one_that_is_none_is_refused() -> None:
    cut = Cut(speed_variation_amplitude=0.2, speed_variation_frequency=20.0)
    told = growth_map(MACHINE, cut, 3000.0, 5e-4, law='delay')
    assert told.law is SpeedLaw.DELAY
    assert told == growth_map(MACHINE, cut, 3000.0, 5e-4, law=SpeedLaw.DELAY)
    for varied in (cut, Cut()):
        with pytest.raises(ParameterError, match="law is 'rubbish': it must be one of speed, del"):
            growth_map(MACHINE, varied, 3000.0, 5e-4, law='rubbish')
