"""The safe region against time simulation: below its edge a small disturbance dies, above grows.

The simulation knows only the equations of motion and equation (9): neither which contact the
mean force leaves the workpiece in, nor any limit.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import Cut, Machine
from lathe_chatter.stability import growth_map, rightmost_root, safe_limit

MACHINE = Machine()
RATE = 1e4
_IMPULSE = 1e-11
"""N s: the motion stays below 10 nm, nearer to rest than the bearing is."""


def _simulated_growth(cut: Cut) -> float:
    """1/s, between 0.9 s and 1.3 s after a knock, from a start that is let come to rest."""
    # Rest is found by simulation too: with this damping nothing chatters, and the deflection
    # under the mean force is the same.
    quiet = Machine(
        type(MACHINE.tool)(0.05, 775.0, 1.0),
        type(MACHINE.workpiece)(0.05, 650.0, 1.0),
        bearing_stiffness=MACHINE.bearing_stiffness,
    )
    rest = VirtualLathe(quiet, cut, initial_state=(0.0,) * 4).advance(30_000)[-1]
    start = (rest[2], 0.0, rest[4], 0.0)
    lathe = VirtualLathe(MACHINE, cut, initial_state=start)
    lathe.knock(_IMPULSE)
    lathe.advance(round(0.8 * RATE))
    sizes = [float(np.ptp(lathe.advance(round(0.2 * RATE))[:, 3])) for _ in range(3)]
    assert not lathe.events
    return math.log(sizes[2] / sizes[0]) / 0.4


@pytest.mark.parametrize('clearance', [3e-6, 5e-6])
@pytest.mark.parametrize('rpm', [2000.0, 2850.0, 3000.0, 4500.0, 9000.0])
def test_the_edge_of_the_safe_region_is_where_disturbances_begin_to_grow(
    rpm: float, clearance: float
) -> None:
    cut = Cut(rpm, 1e-3, clearance)
    edge = float(safe_limit(MACHINE, cut).depth_of_cut)
    for share in (0.97, 1.03):
        here = cut.with_changes(depth_of_cut=share * edge)
        expected = growth_map(MACHINE, here, rpm, share * edge)
        growth = float(expected.growth_rate[0, 0])
        assert (growth < 0.0) == (share < 1.0)
        root = rightmost_root(MACHINE, rpm, share * edge, seated=bool(expected.seated[0, 0]))
        assert growth == root.real
        assert _simulated_growth(here) == pytest.approx(growth, abs=0.3)
