"""The depth that is safe with a bearing clearance: open limit, seated limit and seating line.

The mean cutting force C w f pushes the workpiece at its bearing by C w f / k_wp. As long as that
is less than the clearance gamma the workpiece floats and the open limit holds; from the seating
line

    w = k_wp gamma / (C f)

on it rests on its bearing and the seated limit holds, which may be lower or higher. Of several
modes 1/k_wp is the sum of phi_B phi_F / k. This judges small disturbances: a hard knock can drive
a floating workpiece against its bearing.

Without a mean force and without clearance the workpiece stands exactly where its bearing begins:
the smallest vibration touches it in every cycle, and what holds then is neither limit, nor the
smaller of the two. Nothing is then said to be safe.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lathe_chatter.array_types import Array, ShortRepr
from lathe_chatter.model import BearingContact, Cut, Machine
from lathe_chatter.model.quantity_fields import Quantity
from lathe_chatter.stability.characteristic import (
    Machines,
    ProcessDamping,
    checked,
    machine_array,
)
from lathe_chatter.stability.critical_depth import critical_depth, critical_depths

_CLEARANCE = Quantity('bearing clearance gamma', 'm')
_AS_LOW = 1.005
_FEED = Quantity('feed per revolution f', 'm')


@dataclass(frozen=True, repr=False)
class SafeLimit(ShortRepr):
    """The limits of depth at some spindle speeds; all arrays have one shape.

    Attributes:
        spindle_speed_rpm: rev/min.
        depth_of_cut: Every smaller depth is stable, m; 0 where no depth is known to be.
        open_limit: Critical depth while the workpiece floats, m.
        seated_limit: Critical depth while it rests on its bearing, m.
        seating_line: Depth from which on it rests, m; infinite where it never does.
    """

    spindle_speed_rpm: Array
    depth_of_cut: Array
    open_limit: Array
    seated_limit: Array
    seating_line: Array


def lowest_limit(spindle_speed_rpm: Array, limits: Array) -> tuple[float, float, float]:
    """The lowest of some limits, and the speeds between which it is reached.

    Every lobe has the same lowest limit: then there are several speeds, and which of them a chart
    happens to come closest to says nothing.

    Args:
        spindle_speed_rpm: Rising speeds, rev/min (n,).
        limits: At each, m (n,).

    Returns:
        The limit, m, and the lowest and highest speed of the minima within half a percent of it,
        rev/min.
    """
    lowest = float(limits.min())
    padded = np.concatenate(([math.inf], limits, [math.inf]))
    minima = (limits <= padded[:-2]) & (limits <= padded[2:]) & (limits <= _AS_LOW * lowest)
    speeds = spindle_speed_rpm[minima]
    return lowest, float(speeds[0]), float(speeds[-1])


class ContactAt(NamedTuple):
    """What a cut is at its mean force: whether the workpiece is seated, and the limit then.

    Attributes:
        seated: Whether the workpiece rests on its bearing.
        limit: The critical depth in this regime, m; 0 where no depth is known to be stable.
        stable: Whether the depth of the cut is below it.
    """

    seated: bool
    limit: float
    stable: bool


def seating_depth(machine: Machine, bearing_clearance: float, feed: float) -> float:
    """The seating line w = k_wp gamma / (C f): from here on the mean force closes the clearance.

    Beyond it the workpiece rests on its bearing and the seated limit holds.

    Args:
        machine: Workpiece and material.
        bearing_clearance: gamma, m.
        feed: f per revolution, m.

    Returns:
        The depth of cut, m; infinite without feed or force.

    Raises:
        ParameterError: If clearance or feed is negative or not finite.
    """
    clearance = _CLEARANCE.check('bearing_clearance', bearing_clearance)
    force_per_depth = machine.cutting_coefficient * _FEED.check('feed', feed)
    if force_per_depth == 0.0:
        return math.inf
    compliance = sum(m.bearing * m.force / m.stiffness for m in machine.workpiece.modes)
    # A force that lifts the workpiece off its bearing never seats it.
    return clearance / (force_per_depth * compliance) if compliance > 0.0 else math.inf


def on_the_edge(cut: Cut, *, tool_leaves_cut: bool) -> bool:
    """Whether the workpiece stands exactly where its bearing begins, on one side."""
    without_mean = not tool_leaves_cut or cut.feed == 0.0
    gap = cut.bearing_contact is BearingContact.GAP
    return gap and without_mean and cut.bearing_clearance == 0.0


def _seats(cut: Cut) -> bool:
    """Whether the mean force can close a clearance."""
    return cut.bearing_contact in {'gap', 'both_sides'}


def _always_seated(cut: Cut) -> bool:
    """Whether the bearing carries at any force: without clearance on either side too."""
    both = cut.bearing_contact == 'both_sides' and cut.bearing_clearance == 0.0
    return both or cut.bearing_contact is BearingContact.SEATED


def safe_limit(
    machine: Machines,
    cut: Cut,
    spindle_speed_rpm: ArrayLike | None = None,
    *,
    tool_leaves_cut: bool = True,
) -> SafeLimit:
    """The edge of the safe region at the clearance and feed of a cut.

    Args:
        machine: Tool, workpiece, bearing and material; or machines, of a shape that broadcasts
            with the speeds.
        cut: Clearance, contact, feed; its own speed where none are given.
        spindle_speed_rpm: Speeds of any shape, rev/min. A feed per revolution is one at all of
            them; a feed speed is less per revolution the faster the spindle turns.
        tool_leaves_cut: Whether the force has a mean; the paper's linear force has none, and
            a workpiece that moves little then floats at any depth.

    Returns:
        The limits at each speed.

    Raises:
        ParameterError: If a speed is not allowed.
    """
    given = cut.spindle_speed_rpm if spindle_speed_rpm is None else spindle_speed_rpm
    speeds = checked('spindle_speed_rpm', given)
    process = ProcessDamping.of(cut)
    floating = critical_depths(machine, speeds, seated=False, process=process)
    seated = critical_depths(machine, speeds, seated=True, process=process)
    line = np.full(floating.shape, math.inf)
    if _always_seated(cut):
        line = np.zeros(floating.shape)
    elif _seats(cut) and tool_leaves_cut:
        # The line is inverse to the feed, which is one, or else inverse to the speed.
        feed, per_feed = cut.feed_per_revolution, np.ones_like(speeds)
        if not feed:
            feed, per_feed = 60.0 * cut.feed_speed, speeds
        each = machine_array(machine)
        at_one = [seating_depth(one, cut.bearing_clearance, feed) for one in each.ravel()]
        line = np.broadcast_to(np.reshape(at_one, each.shape) * per_feed, floating.shape)
    depth = np.where(floating <= line, floating, np.maximum(line, seated))
    if on_the_edge(cut, tool_leaves_cut=tool_leaves_cut):
        depth = np.zeros(floating.shape)
    return SafeLimit(np.broadcast_to(speeds, floating.shape), depth, floating, seated, line)


def is_seated(machine: Machine, cut: Cut, *, tool_leaves_cut: bool = True) -> bool:
    """Whether the mean force of a cut leaves the workpiece on its bearing."""
    if _always_seated(cut) or not (_seats(cut) and tool_leaves_cut):
        return _always_seated(cut)
    return cut.depth_of_cut >= seating_depth(machine, cut.bearing_clearance, cut.feed)


def contact_at(machine: Machine, cut: Cut, *, tool_leaves_cut: bool = True) -> ContactAt:
    """Which of the two limits holds for a cut as it is, and whether the cut keeps it.

    Args:
        machine: Tool, workpiece, bearing and material.
        cut: The operating point.
        tool_leaves_cut: Whether the force has a mean, see `safe_limit`.

    Returns:
        The contact at the mean force, the critical depth in that contact, and the verdict for
        small disturbances.
    """
    seated = is_seated(machine, cut, tool_leaves_cut=tool_leaves_cut)
    limit = critical_depth(
        machine, cut.spindle_speed_rpm, seated=seated, process=ProcessDamping.of(cut)
    )
    if on_the_edge(cut, tool_leaves_cut=tool_leaves_cut):
        limit = 0.0
    return ContactAt(seated, limit, cut.depth_of_cut < limit)
