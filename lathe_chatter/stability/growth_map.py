"""Growth rates over speed and depth, each in the contact that the mean force leaves it in."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lathe_chatter.array_types import Array, ShortRepr
from lathe_chatter.model import Cut, Machine
from lathe_chatter.model.quantity_fields import check_choice
from lathe_chatter.resumable_results import spread_into
from lathe_chatter.stability.characteristic import ProcessDamping, checked
from lathe_chatter.stability.periodic_map import SpeedLaw
from lathe_chatter.stability.roots import rightmost_roots
from lathe_chatter.stability.safe_limit import safe_limit
from lathe_chatter.stability.speed_variation import varied_growth_rates


@dataclass(frozen=True, repr=False)
class GrowthMap(ShortRepr):
    """How fast a small vibration grows.

    Attributes:
        spindle_speed_rpm: rev/min (n,).
        depth_of_cut: m (m,).
        growth_rate: Of the rightmost root, or with a varying speed that of the dominant
            multiplier, 1/s (m, n).
        seated: Whether the workpiece rests on its bearing at the mean force (m, n).
        law: What swings where the speed is varied.
    """

    spindle_speed_rpm: Array
    depth_of_cut: Array
    growth_rate: Array
    seated: NDArray[np.bool_]
    law: SpeedLaw = SpeedLaw.SPEED


def growth_map(  # noqa: PLR0913 -- a cut, the points, and who is told
    machine: Machine,
    cut: Cut,
    spindle_speed_rpm: ArrayLike,
    depth_of_cut: ArrayLike,
    *,
    tool_leaves_cut: bool = True,
    law: SpeedLaw | str = SpeedLaw.SPEED,
    executor: Executor | None = None,
    kept_in: Path | str | None = None,
    progress: Callable[[int], object] = lambda _count: None,
) -> GrowthMap:
    """The growth rate at every speed and depth, at the clearance and feed speed of a cut.

    Args:
        machine: Tool, workpiece, bearing and material.
        cut: Clearance, contact, feed speed, and the variation of the speed where its amplitude
            is not 0; its own speed and depth are not used.
        spindle_speed_rpm: Speeds (n,), rev/min.
        depth_of_cut: Depths (m,), m.
        tool_leaves_cut: Whether the force has a mean, see `safe_limit`.
        law: What swings where the speed is varied, `SpeedLaw` or its value, 'speed' or 'delay'.
        executor: Where it is computed, see `executors`; by default threads, one a core.
        kept_in: File that keeps what is computed, and is continued where it exists.
        progress: Is told, now and then, how many more points are known.

    Raises:
        ParameterError: If a speed, depth or law is not allowed, or the answer would take minutes.
        ResultFileError: If the file is of something else, or cannot be written.
    """
    swings: SpeedLaw = check_choice('law', law, SpeedLaw)
    speeds = np.atleast_1d(checked('spindle_speed_rpm', spindle_speed_rpm))
    depths = np.atleast_1d(checked('depth_of_cut', depth_of_cut))
    line = safe_limit(machine, cut, speeds, tool_leaves_cut=tool_leaves_cut).seating_line
    rests: NDArray[np.bool_] = depths[:, None] >= line
    column = partial(_column, machine, cut, swings, depths)
    columns = spread_into(
        kept_in,
        {
            'kind': 'growth rates',
            'cut': repr((machine, cut, swings.value)),
            'depths': depths.tolist(),
        }
        | {'speeds': speeds.tolist(), 'rests': rests.tolist()},
        column,
        list(zip(speeds.tolist(), rests.T.tolist(), strict=True)),
        executor=executor,
        progress=lambda count: progress(count * depths.size),
    )
    growth = np.array(columns, float).reshape(speeds.size, depths.size).T
    return GrowthMap(speeds, depths, growth, rests, swings)


def _column(
    machine: Machine, cut: Cut, law: SpeedLaw, depths: Array, at: tuple[float, list[bool]]
) -> list[float]:
    """The growth rates at a speed: a varied one shares its work among the depths."""
    speed, rests = at[0], np.array(at[1])
    growth = np.empty(len(depths))
    for seated in (False, True):
        here = rests == seated
        if here.any():
            growth[here] = _growth(machine, cut, speed, depths[here], law, seated=seated)
    return [float(rate) for rate in growth]


def _growth(  # noqa: PLR0913 -- a column of a map
    machine: Machine, cut: Cut, speed: float, depths: Array, law: SpeedLaw, *, seated: bool
) -> Array:
    """The growth rates at some depths (n,)."""
    if cut.speed_variation_amplitude == 0.0:
        process = ProcessDamping.of(cut)
        roots = rightmost_roots(machine, speed, depths, seated=seated, process=process)
        return np.asarray(roots.real)
    return varied_growth_rates(machine, cut, speed, depths, seated=seated, law=law)[:, 0]
