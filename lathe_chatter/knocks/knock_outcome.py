"""One knock on one cut, followed until it has died out or plainly lasts."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lathe_chatter.arrays import Array
from lathe_chatter.errors import ParameterError
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import BearingContact, Cut, Machine
from lathe_chatter.stability import contact_at

SAMPLE_RATE = 1e4
_CHUNK, _TURNS = 0.25, 5.0
"""s that are looked at together, and turns at least."""
_LONGEST = 30.0
"""s after which what has not settled is judged by its trend."""
_STEADY, _IN_A_ROW = 1e-4, 3
_STILL = 1e-12
"""m, peak to peak."""
_TREND = 0.98
_LINEAR_RESPONSE = 2.0
"""s of the response to a knock in which it is largest."""


class Outcome(NamedTuple):
    """What became of a knock.

    Attributes:
        lasts: Whether it ended in lasting chatter.
        amplitude: Of the tool in the end, peak to peak, m.
        time: Simulated until it was clear, s.
    """

    lasts: bool
    amplitude: float
    time: float


def resting_state(machine: Machine, cut: Cut) -> Array:
    """The equilibrium under the mean cutting force C w f, from which a knock starts (4,).

    Tool displacement and velocity, workpiece displacement and velocity, m and m/s.
    """
    force = machine.cutting_stiffness(cut.depth_of_cut) * cut.feed
    seated = contact_at(machine, cut).seated
    bearing = machine.bearing_stiffness if seated else 0.0
    rest = (force + bearing * cut.bearing_clearance) / machine.workpiece_stiffness(seated=seated)
    return np.array([-force / machine.tool.stiffness, 0.0, rest, 0.0])


def follow_knock(machine: Machine, cut: Cut, impulse: float) -> Outcome:
    """Knock a cut at rest on its tool and follow it.

    Without an event (contact, loss of contact, tool out of the cut or back) the machine is
    linear; two such spells in a row, the second smaller, are a knock that dies out. A size that
    no longer changes while events go on is chatter that lasts.

    Args:
        machine: Tool, workpiece, bearing and material.
        cut: Steady and without noise, stable to small disturbances.
        impulse: On the tool, N s; of either sign.
    """
    lathe = VirtualLathe(
        machine, cut, sample_rate=SAMPLE_RATE, initial_state=resting_state(machine, cut)
    )
    lathe.knock(impulse)
    chunk = round(max(_CHUNK, _TURNS * cut.delay) * SAMPLE_RATE)
    sizes: list[float] = []
    was_quiet, steady = False, 0
    while lathe.time < _LONGEST:
        samples = lathe.advance(chunk)
        if lathe.guard:
            return Outcome(lasts=True, amplitude=math.inf, time=lathe.time)
        sizes.append(float(np.ptp(samples[:, 2])))
        size, before = sizes[-1], sizes[-2] if len(sizes) > 1 else math.inf
        quiet = not lathe.events
        if size < _STILL or (quiet and was_quiet and size < before):
            return Outcome(lasts=False, amplitude=size, time=lathe.time)
        steady = steady + 1 if not quiet and abs(size - before) <= _STEADY * before else 0
        if steady == _IN_A_ROW:
            return Outcome(lasts=True, amplitude=size, time=lathe.time)
        was_quiet = quiet
    # A beat of two frequencies never repeats: it lasts if its mean size does.
    quarter = len(sizes) // 4
    late, later = np.mean(sizes[-2 * quarter : -quarter]), np.mean(sizes[-quarter:])
    return Outcome(bool(later > _TREND * late), sizes[-1], lathe.time)


def linear_reach(machine: Machine, cut: Cut) -> tuple[float, float]:
    """The knocks below which a stable cut never leaves its linear regime, so that they die out.

    The response of the linear machine to a unit impulse is scaled until its largest workpiece
    displacement reaches the bearing (or leaves it), or its thinnest chip is none.

    Args:
        machine: Tool, workpiece, bearing and material.
        cut: Steady and without noise.

    Returns:
        For an impulse forward and one backward, N s, as magnitudes.

    Raises:
        ParameterError: If there is no feed, and so no chip to begin with.
    """
    if cut.feed <= 0.0:
        raise ParameterError('feed_speed', cut.feed_speed, 'm/s', 'above 0 for a knock to be met')
    seated = contact_at(machine, cut).seated
    contact = BearingContact.SEATED if seated else BearingContact.NONE
    lathe = VirtualLathe(
        machine,
        cut.with_changes(bearing_contact=contact, bearing_clearance=0.0),
        sample_rate=SAMPLE_RATE,
        tool_leaves_cut=False,
        initial_state=(0.0,) * 4,
        displacement_limit=1e12,
    )
    lathe.knock(1.0)
    duration = max(_LINEAR_RESPONSE, 4.0 * _TURNS * cut.delay)
    samples = lathe.advance(round(duration * SAMPLE_RATE))
    workpiece, chip = samples[:, 4], samples[:, 6]
    distance = math.inf
    if cut.bearing_contact is BearingContact.GAP:
        distance = abs(cut.bearing_clearance - float(resting_state(machine, cut)[2]))
    towards = -1.0 if seated else 1.0

    def least(sign: float) -> float:
        reach = float((sign * towards * workpiece).max())
        thinning = float((-sign * chip).max())
        to_bearing = distance / reach if reach > 0.0 else math.inf
        return min(to_bearing, cut.feed / thinning if thinning > 0.0 else math.inf)

    return least(1.0), least(-1.0)
