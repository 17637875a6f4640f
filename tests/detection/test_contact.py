"""Whether the workpiece rests on its bearing is said where it is known, and there it is true."""

from __future__ import annotations

import math

import pytest

from lathe_chatter.detection import ChatterDetector
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import Cut, Machine, Mode

_TURN = 2.0 * math.pi
_SHAFT = Machine(
    Mode(1.2, _TURN * 1400.0, 0.03), Mode(6.0, _TURN * 800.0, 0.025), bearing_stiffness=1e8,
    cutting_coefficient=1.8e9,
)  # fmt: skip
_SHAFT_CUT = Cut(4000.0, 1e-3, feed_per_revolution=1e-4, force_noise=0.05)
_CUT = Cut(3000.0, 0.3e-3, force_noise=4.5e-4, sensor_noise=1e-7)


@pytest.mark.parametrize(
    ('machine', 'cut'), [(_SHAFT, _SHAFT_CUT), (Machine(), _CUT)], ids=['shaft', 'paper']
)
@pytest.mark.parametrize('contact', ['none', 'gap', 'seated'])
def test_a_contact_is_said_only_where_it_is_known(
    machine: Machine, cut: Cut, contact: str
) -> None:
    """In a quiet cut the bearing's part is often less than the noise."""
    lathe = VirtualLathe(machine, cut=cut.with_changes(bearing_contact=contact))
    detector = ChatterDetector(machine)
    for _ in range(120):
        told = detector.update(lathe.advance(1000), lathe.columns)
        touches = lathe.bearing_engaged
        assert told.bearing_engaged in {None, touches}
        if math.isfinite(told.workpiece_stiffness):
            off = told.workpiece_stiffness - machine.workpiece_stiffness(seated=touches)
            assert abs(off) < 0.5 * machine.bearing_stiffness


def test_on_its_bearing_the_workpiece_of_a_noisy_cut_is_said_to_rest() -> None:
    lathe = VirtualLathe(cut=_CUT.with_changes(bearing_contact='seated'))
    detector = ChatterDetector()
    said = [detector.update(lathe.advance(1000), lathe.columns).bearing_engaged for _ in range(60)]
    assert said[30:].count(True) > 20
    assert False not in said
