"""What becomes of a vibration when the cut changes: tried on a virtual lathe before.

Roots tell of small vibration. Where a bearing has clearance, or the tool leaves its cut, large
vibration may last in a cut that small vibration dies in.
"""

from __future__ import annotations

import math

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.knocks import resting_state
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import Cut, Machine
from lathe_chatter.model.lathe_parameter_table import CUT_ROWS
from lathe_chatter.model.machine_and_sampling import LatheSetup
from lathe_chatter.model.quantity_fields import limits_of

_RATE, _SPREAD = 12.0, 8.0
"""Samples in a radian of the highest mode, and how far above the lowest one it counts: the lathe
takes steps of its own between samples."""
_LOOK, _LOOKS = 2.0, 16
"""Periods of the lowest mode after which it is seen whether the vibration has its size, and how
often that is waited for."""
_SHORTEST, _LONGEST, _EFOLDS = 0.6, 3.0, 3.0
"""s in the new cut, by the decay that roots predict of it."""
_LEAST, _MOST = (30.0, 120.0), (150.0, 600.0)
"""Periods of the lowest mode between which the shortest and the longest of these times lie."""
_DIED, _FALLS = 0.1, 0.6
"""Part of the vibration at the end of the ramp at which it has died; and to which it falls in a
third of that time where it is dying."""
_LONGEST_RAMP = 20.0
"""s: one that takes longer is taken to be faster."""
_NOISE = {row.name: 0.0 for row in CUT_ROWS if row.only_samples}


def dies(  # noqa: PLR0913 -- a move, and in what it begins
    machine: Machine, cut: Cut, new: Cut, *, growth_rate: float, ramp: float, amplitude: float,
    amplitude_limit: float,
) -> bool:  # fmt: skip
    """Whether vibration dies where a cut becomes another, and keeps to its limit on the way.

    Args:
        machine: That cuts.
        cut: The present one.
        new: That is gone to.
        growth_rate: Of small vibration there, 1/s.
        ramp: Of the speed, rev/min per s.
        amplitude: Of the tool's vibration at present, m.
        amplitude_limit: That it may reach on the way, m.
    """
    each = [mode.natural_frequency for mode in (*machine.tool.modes, *machine.workpiece.modes)]
    period = 2.0 * math.pi / min(each)
    limits = limits_of(LatheSetup, 'sample_rate')
    rate = _RATE * min(max(each), _SPREAD * min(each))
    rate = min(max(rate, limits.low), limits.high)
    present = cut.with_changes(**_NOISE)
    start = resting_state(machine, present)
    start[0] -= 0.5 * amplitude
    away = abs(new.spindle_speed_rpm - cut.spindle_speed_rpm)
    ramp = max(ramp, away / _LONGEST_RAMP)
    lathe = VirtualLathe(
        machine, present, initial_state=start, sample_rate=rate, spindle_acceleration=ramp
    )
    for _ in range(_LOOKS):
        if np.ptp(_tool(lathe, _LOOK * period)) > 2.0 * amplitude:
            break
    lathe.retune(new.with_changes(**_NOISE))
    way = _tool(lathe, away / ramp + 0.1)
    shortest = np.clip(_SHORTEST / period, *_LEAST) * period
    longest = np.clip(_LONGEST / period, *_MOST) * period
    lasting = float(np.clip(_EFOLDS / max(-growth_rate, 1e-9), shortest, longest))
    rest = _tool(lathe, lasting)
    if lathe.guard or np.ptp(way) > 2.0 * amplitude_limit:
        return False
    part = len(rest) // 3
    before, end = np.std(rest[part : 2 * part]), np.std(rest[2 * part :])
    begun = max(float(np.std(way[-part:])), 0.7 * amplitude)
    return bool(end < max(_FALLS * before, _DIED * begun))


def _tool(lathe: VirtualLathe, seconds: float) -> Array:
    """Its displacement meanwhile, m."""
    return lathe.advance(round(seconds * lathe.sample_rate))[:, 2]
