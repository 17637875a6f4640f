"""Growth rates over speed and depth, each in the contact that the mean force leaves it in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lathe_chatter.arrays import Array
from lathe_chatter.model import Cut, Machine
from lathe_chatter.stability.characteristic import checked
from lathe_chatter.stability.roots import rightmost_roots
from lathe_chatter.stability.safe_limit import safe_limit
from lathe_chatter.stability.speed_variation import varied_growth_rates


@dataclass(frozen=True)
class GrowthMap:
    """How fast a small vibration grows.

    Attributes:
        spindle_speed_rpm: rev/min (n,).
        depth_of_cut: m (m,).
        growth_rate: Of the rightmost root, or with a varying speed that of the dominant
            multiplier, 1/s (m, n).
        seated: Whether the workpiece rests on its bearing at the mean force (m, n).
    """

    spindle_speed_rpm: Array
    depth_of_cut: Array
    growth_rate: Array
    seated: NDArray[np.bool_]


def growth_map(
    machine: Machine,
    cut: Cut,
    spindle_speed_rpm: ArrayLike,
    depth_of_cut: ArrayLike,
    *,
    tool_leaves_cut: bool = True,
) -> GrowthMap:
    """The growth rate at every speed and depth, at the clearance and feed speed of a cut.

    Args:
        machine: Tool, workpiece, bearing and material.
        cut: Clearance, contact, feed speed, and the variation of the speed where its amplitude
            is not 0; its own speed and depth are not used.
        spindle_speed_rpm: Speeds (n,), rev/min.
        depth_of_cut: Depths (m,), m.
        tool_leaves_cut: Whether the force has a mean, see `safe_limit`.

    Raises:
        ParameterError: If a speed or depth is not allowed.
    """
    speeds = np.atleast_1d(checked('spindle_speed_rpm', spindle_speed_rpm))
    depths = np.atleast_1d(checked('depth_of_cut', depth_of_cut))
    line = safe_limit(machine, cut, speeds, tool_leaves_cut=tool_leaves_cut).seating_line
    rests: NDArray[np.bool_] = depths[:, None] >= line
    growth = np.empty(rests.shape)
    for seated in (False, True):
        here = rests == seated
        if here.any():
            growth[here] = _growth(machine, cut, speeds, depths, here, seated=seated)
    return GrowthMap(speeds, depths, growth, rests)


def _growth(  # noqa: PLR0913 -- a map and the part of it that is wanted
    machine: Machine,
    cut: Cut,
    speeds: Array,
    depths: Array,
    here: NDArray[np.bool_],
    *,
    seated: bool,
) -> Any:
    """The growth rates where `here` (m, n) is true, in the order of NumPy's selection."""
    if cut.speed_variation_amplitude == 0.0:
        row, column = np.nonzero(here)
        return rightmost_roots(machine, speeds[column], depths[row], seated=seated).real
    # A column at a time shares its work, so whole columns are computed.
    growth = np.full(here.shape, np.nan)
    columns, rows = here.any(axis=0), here.any(axis=1)
    growth[np.ix_(rows, columns)] = varied_growth_rates(
        machine, cut, speeds[columns], depths[rows], seated=seated
    )
    return growth[here]
