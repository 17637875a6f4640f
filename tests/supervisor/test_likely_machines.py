"""What is heard of a machine, and the machines that the truth may be."""

from __future__ import annotations

import numpy as np
import pytest

from lathe_chatter.model import BearingContact, Cut, Machine
from lathe_chatter.stability import critical_depth, leading_roots
from lathe_chatter.supervisor.likely_machines import as_heard, chance_of, fits, may_be

MACHINE = Machine()
DEEP = Cut(depth_of_cut=1e-3, bearing_contact=BearingContact.NONE)


def test_the_c_that_is_heard_counts_where_it_is_greater() -> None:
    told = MACHINE.cutting_stiffness(1e-3)
    for stiffness, factor in ((1.2, 1.2), (0.8, 1.0), (50.0, 1.0), (np.nan, 1.0), (np.inf, 1.0)):
        found = as_heard(MACHINE, DEEP, stiffness * told, np.nan)
        assert found.cutting_stiffness(1e-3) == pytest.approx(factor * told)


def test_the_tool_is_taken_as_it_is_heard() -> None:
    found = as_heard(MACHINE, DEEP, np.nan, 120.0)
    assert found.tool.modes[0].natural_frequency == pytest.approx(2.0 * np.pi * 120.0)
    assert found.tool.modes[0].mass == MACHINE.tool.modes[0].mass


def test_chatter_is_that_of_the_told_machine_or_of_another() -> None:
    at = DEEP.spindle_speed_rpm, DEEP.depth_of_cut
    root = max(leading_roots(MACHINE, *at, seated=False), key=lambda root: root.real)
    hertz = root.imag / (2.0 * np.pi)
    assert fits(MACHINE, DEEP, hertz, root.real)
    assert not fits(MACHINE, DEEP, 1.01 * hertz, root.real)
    assert not fits(MACHINE, DEEP, hertz, root.real + 6.0)
    assert not fits(MACHINE, DEEP, np.nan, root.real)


def test_the_chance_of_a_cut_falls_across_its_limit() -> None:
    limit = critical_depth(MACHINE, DEEP.spindle_speed_rpm, seated=False)
    machines = may_be(MACHINE, 0.03)
    cuts = [DEEP.with_changes(depth_of_cut=part * limit) for part in (0.5, 1.0, 2.0)]
    chances = [chance_of(machines, cut) for cut in cuts]
    assert chances[0] == 1.0
    assert 0.2 < chances[1] < 0.8
    assert chances[2] == 0.0
