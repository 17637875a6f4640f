"""Stability of a cut: growth rates, limits, lobes and advice, one import for all of them.

`roots` finds and proves characteristic roots, `lobes` holds what is known in closed form,
`safe_limit` adds the bearing clearance, `speed_variation` the periodic spindle, and
`speed_search` turns roots and lobes into a spindle speed. None needs more than NumPy.
"""

from __future__ import annotations

from lathe_chatter.stability.characteristic import ProcessDamping
from lathe_chatter.stability.critical_depth import critical_depth, critical_depths
from lathe_chatter.stability.growth_map import GrowthMap, growth_map
from lathe_chatter.stability.lobes import LobeBoundary, lobe_boundary
from lathe_chatter.stability.periodic_map import SpeedLaw
from lathe_chatter.stability.root_count import count_roots_right_of
from lathe_chatter.stability.roots import leading_roots, rightmost_root, rightmost_roots, root_of
from lathe_chatter.stability.safe_limit import (
    ContactAt,
    SafeLimit,
    contact_at,
    lowest_limit,
    safe_limit,
    seating_depth,
)
from lathe_chatter.stability.speed_search import (
    CuttingAdvice,
    SpeedAdvice,
    recommend_speeds,
    stable_speed_intervals,
)
from lathe_chatter.stability.speed_variation import (
    Floquet,
    floquet,
    varied_growth_rates,
)

__all__ = [
    'ContactAt',
    'CuttingAdvice',
    'Floquet',
    'GrowthMap',
    'LobeBoundary',
    'ProcessDamping',
    'SafeLimit',
    'SpeedAdvice',
    'SpeedLaw',
    'contact_at',
    'count_roots_right_of',
    'critical_depth',
    'critical_depths',
    'floquet',
    'growth_map',
    'leading_roots',
    'lobe_boundary',
    'lowest_limit',
    'recommend_speeds',
    'rightmost_root',
    'rightmost_roots',
    'root_of',
    'safe_limit',
    'seating_depth',
    'stable_speed_intervals',
    'varied_growth_rates',
]
