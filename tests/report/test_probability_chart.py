from __future__ import annotations

import numpy as np

from lathe_chatter.model import BearingContact, Cut, Machine, Mode
from lathe_chatter.report.probability_chart import probable_speeds
from lathe_chatter.report.stability_chart import chart_limits, chart_speeds
from lathe_chatter.stability import critical_depth


def test_a_chart_of_few_speeds_meets_the_lowest_depth_of_narrow_lobes() -> None:
    """Of a mode of 20 Hz below 200 rev/min, whose lobes all have the same lowest depth."""
    machine = Machine(Mode(500.0, 40.0 * np.pi, 0.03), Mode(2e3, 70.0 * np.pi, 0.03), 0.0, 1.5e9)
    cut = Cut(bearing_contact=BearingContact.NONE)
    speeds = probable_speeds(chart_limits(machine, cut, chart_speeds(10.0, 200.0)), 200)
    assert (len(speeds), speeds[0], speeds[-1]) == (200, 10.0, 200.0)
    assert (np.diff(speeds) > 0.0).all()
    depths = np.array([critical_depth(machine, speed, seated=False) for speed in speeds])
    lobes = 60.0 * 20.7 / speeds  # turns in a period of chatter
    lowest = depths.min()
    # Up to here lobes are narrower than the speeds are apart.
    assert lobes[17] - lobes[18] > 1.0
    assert depths[1:19].max() < 1.01 * lowest
    even = np.linspace(10.0, 200.0, 200)
    missed = [critical_depth(machine, speed, seated=False) for speed in even[1:19]]
    assert max(missed) > 1.03 * lowest
