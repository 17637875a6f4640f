from __future__ import annotations

import math

import numpy as np
import pytest

from lathe_chatter.errors import ParameterError
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import BearingContact, Cut, Machine
from lathe_chatter.samples import SAMPLE_COLUMNS
from lathe_chatter.stability import (
    contact_at,
    critical_depth,
    lowest_limit,
    rightmost_roots,
    safe_limit,
    seating_depth,
)


def test_the_seating_line() -> None:
    # The mean deflection C w f / k_wp equals the clearance there.
    cut = Cut(3000.0, bearing_clearance=5e-6, feed_speed=0.0025)
    depth = seating_depth(Machine(), cut.bearing_clearance, cut.feed)
    assert round(1e3 * depth, 4) == 0.6036
    deflection = Machine().cutting_stiffness(depth) * cut.feed / Machine().workpiece.stiffness
    assert deflection == pytest.approx(cut.bearing_clearance, rel=1e-15)
    assert seating_depth(Machine(), 5e-6, 0.0) == math.inf


@pytest.mark.parametrize(('clearance', 'feed'), [(-1e-6, 1e-4), (1e-6, math.nan)])
def test_impossible_clearances_and_feeds_are_refused(clearance: float, feed: float) -> None:
    with pytest.raises(ParameterError):
        seating_depth(Machine(), clearance, feed)


def test_without_clearance_in_the_model_the_open_limit_holds() -> None:
    cut = Cut(3000.0, 6e-4, bearing_contact=BearingContact.NONE)
    limit = safe_limit(Machine(), cut)
    assert limit.depth_of_cut == limit.open_limit
    assert contact_at(Machine(), cut) == (False, limit.open_limit, True)


def test_a_seated_workpiece_has_the_seated_limit() -> None:
    cut = Cut(3000.0, 6e-4, bearing_contact=BearingContact.SEATED)
    limit = safe_limit(Machine(), cut)
    assert limit.depth_of_cut == limit.seated_limit
    assert contact_at(Machine(), cut) == (True, limit.seated_limit, False)


def test_a_force_without_a_mean_never_closes_the_gap() -> None:
    limit = safe_limit(Machine(), Cut(3000.0), tool_leaves_cut=False)
    assert limit.seating_line == math.inf
    assert limit.depth_of_cut == limit.open_limit


def test_the_safe_region_is_the_union_of_depths_that_are_stable_from_zero_on() -> None:
    # The definition, by the sign of the rightmost root in the regime of each depth.
    cut = Cut(3000.0, bearing_clearance=8e-6, feed_speed=0.004)
    speeds = np.linspace(1500.0, 11000.0, 25)
    limit = safe_limit(Machine(), cut, speeds)
    depths = np.linspace(0.0, 3e-3, 300)
    kinds = set()
    for number, rpm in enumerate(speeds):
        feed = cut.with_changes(spindle_speed_rpm=rpm).feed
        rests = depths >= seating_depth(Machine(), cut.bearing_clearance, feed)
        growth = np.where(
            rests,
            rightmost_roots(Machine(), rpm, depths, seated=True).real,
            rightmost_roots(Machine(), rpm, depths, seated=False).real,
        )
        edge = np.append(depths, np.inf)[np.argmax(np.append(growth >= 0.0, True))]
        assert edge - depths[1] <= limit.depth_of_cut[number] <= edge
        candidates = (limit.open_limit, limit.seated_limit, limit.seating_line)
        kinds.add(
            int(np.argmin([abs(c[number] - limit.depth_of_cut[number]) for c in candidates]))
        )
    assert kinds == {0, 1, 2}


@pytest.mark.parametrize('contact', [BearingContact.GAP, BearingContact.BOTH_SIDES])
@pytest.mark.parametrize(('depth', 'lasts'), [(5.7e-4, False), (6.4e-4, True)])
def test_the_virtual_lathe_chatters_past_the_seating_line_though_below_the_open_limit(
    depth: float, contact: BearingContact, *, lasts: bool
) -> None:
    cut = Cut(3000.0, depth, 5e-6, contact, 0.0025)
    assert contact_at(Machine(), cut).stable is not lasts
    assert depth < critical_depth(Machine(), 3000.0, seated=False)
    lathe = VirtualLathe(Machine(), cut, initial_state=np.array([0.0, 0.0025, 0.0, 0.0]))
    lathe.advance(95000)
    end = lathe.advance(5000)[:, SAMPLE_COLUMNS.index('tool_displacement')]
    assert (np.ptp(end) > 10e-6) == lasts


def test_the_lowest_limit_is_reached_in_every_lobe() -> None:
    speeds = np.geomspace(800.0, 12000.0, 4000)
    limits = safe_limit(Machine(), Cut(bearing_contact=BearingContact.NONE), speeds).depth_of_cut
    lowest, low, high = lowest_limit(speeds, limits)
    assert lowest == limits.min()
    assert 1e3 * lowest == pytest.approx(0.5960, abs=2e-4)
    assert low < 900.0
    assert high > 4000.0
    for speed in (low, high):
        assert limits[speeds == speed] <= 1.005 * lowest
    assert lowest_limit(speeds, speeds) == (800.0, 800.0, 800.0)


def test_with_a_feed_per_revolution_the_seating_line_is_one_depth() -> None:
    cut = Cut(feed_per_revolution=4e-5, bearing_clearance=8e-6)
    found = safe_limit(Machine(), cut, [1000.0, 2500.0, 9000.0])
    expected = seating_depth(Machine(), 8e-6, 4e-5)
    assert found.seating_line.tolist() == [expected] * 3
    for speed, depth in ((1000.0, 0.99 * expected), (9000.0, 1.01 * expected)):
        at = cut.with_changes(spindle_speed_rpm=speed, depth_of_cut=depth)
        assert contact_at(Machine(), at).seated == (depth > expected)
