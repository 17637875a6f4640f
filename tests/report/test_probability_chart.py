from __future__ import annotations

import numpy as np
import pytest

from lathe_chatter.model import BearingContact, Cut, Machine, Mode
from lathe_chatter.report.probability_chart import interpolation_speeds
from lathe_chatter.report.stability_chart import chart_limits, chart_speeds


def test_a_line_between_these_speeds_is_nowhere_above_the_limit() -> None:
    """Of a mode of 20 Hz, whose lobes are narrower than a pixel at 10 and wide at 1000 rev/min."""
    machine = Machine(Mode(500.0, 40.0 * np.pi, 0.03), Mode(2e3, 70.0 * np.pi, 0.03), 0.0, 1.5e9)
    cut = Cut(bearing_contact=BearingContact.NONE)
    limits = chart_limits(machine, cut, chart_speeds(10.0, 1000.0))
    speeds = interpolation_speeds(limits)
    assert len(speeds) < 0.7 * len(limits.spindle_speed_rpm)
    assert (speeds[0], speeds[-1]) == (10.0, 1000.0)
    kept = np.searchsorted(limits.spindle_speed_rpm, speeds)
    line = np.interp(limits.spindle_speed_rpm, speeds, limits.depth_of_cut[kept])
    assert (line / limits.depth_of_cut).max() <= 1.01 + 1e-9
    # Where lobes are wide the line is the limit, but for the very tips of the narrower ones.
    share = (line / limits.depth_of_cut)[limits.spindle_speed_rpm > 200.0]
    assert (share.min() > 0.8, np.median(share) > 0.995) == (True, True)


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize(('damping', 'coefficient'), [(0.03, 0.0), (0.0, 1.5e9)])
def test_no_limit_and_a_limit_of_nothing_are_charts_too(
    damping: float, coefficient: float
) -> None:
    body = Mode(500.0, 40.0 * np.pi, damping)
    cut = Cut(bearing_contact=BearingContact.NONE)
    limits = chart_limits(Machine(body, body, 0.0, coefficient), cut, chart_speeds(10.0, 1000.0))
    speeds = interpolation_speeds(limits)
    assert (speeds[0], speeds[-1]) == (10.0, 1000.0)
    assert np.diff(speeds).max() < 10.0
