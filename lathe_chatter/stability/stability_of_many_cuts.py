"""The truth of many cuts on many machines: the rightmost root of each, in one call."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lathe_chatter.model import Cut, Machine
from lathe_chatter.stability.characteristic import Complex, ProcessDamping
from lathe_chatter.stability.roots import rightmost_roots
from lathe_chatter.stability.safe_limit import is_seated, on_the_edge


class OperatingPoints(NamedTuple):
    """What some cuts are at their mean force.

    Attributes:
        root: The rightmost in the contact that holds there, 1/s and rad/s (n,); nan where the
            workpiece stands exactly where its bearing begins, and no root tells.
        seated: Whether the workpiece rests on its bearing (n,).
        stable: Whether a small disturbance dies out (n,).
    """

    root: Complex
    seated: NDArray[np.bool_]
    stable: NDArray[np.bool_]


def operating_points(
    machines: Sequence[Machine],
    cuts: Sequence[Cut],
    *,
    tool_leaves_cut: bool | Sequence[bool] = True,
) -> OperatingPoints:
    """The rightmost root of each cut on its machine, at the mean speed of the cut.

    Args:
        machines: One for each cut (n,).
        cuts: Speed, depth, clearance, feed and process damping (n,).
        tool_leaves_cut: Whether the force has a mean, see `safe_limit`; of all, or of each.

    Raises:
        UnprovenError: If a root could not be proven to be the rightmost.
    """
    root = np.full(len(cuts), complex(np.nan, np.nan))
    seated = np.zeros(len(cuts), np.bool_)
    groups: dict[tuple[bool, ProcessDamping], list[int]] = {}
    leaves = np.broadcast_to(tool_leaves_cut, len(cuts)).tolist()
    for k, (machine, cut, mean) in enumerate(zip(machines, cuts, leaves, strict=True)):
        seated[k] = is_seated(machine, cut, tool_leaves_cut=mean)
        if not on_the_edge(cut, tool_leaves_cut=mean):
            groups.setdefault((bool(seated[k]), ProcessDamping.of(cut)), []).append(k)
    for (rests, process), places in groups.items():
        root[places] = rightmost_roots(
            [machines[k] for k in places],
            [cuts[k].spindle_speed_rpm for k in places],
            [cuts[k].depth_of_cut for k in places],
            seated=rests,
            process=process,
        )
    return OperatingPoints(root, seated, root.real < 0.0)
