"""One knock on one cut, followed until it has died out or plainly lasts."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.errors import ParameterError
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import Cut, Machine
from lathe_chatter.model.machine_and_sampling import LatheSetup
from lathe_chatter.model.quantity_fields import limits_of
from lathe_chatter.stability import contact_at

_RATE = 1e4 / 775.0
"""Samples in a radian of the highest mode: 10 kHz for the paper's machine."""
_CHUNK, _TURNS = 0.25 * 650.0, 5.0
"""Radians of the lowest mode that are looked at together (of the paper's, 0.25 s), and turns at
least."""
_LONGEST, _MOST_CHUNKS = 120, 24
"""Such parts after which what has not settled is judged by its trend: of a spindle so slow that
its turns rule, fewer."""
_STEADY, _IN_A_ROW = 1e-4, 3
_STILL = 1e-12
"""m, peak to peak."""
_SETTLED = 1e-7
"""The same, in feeds per revolution."""
_TREND = 0.98
_LINEAR_RESPONSE = 8
"""Parts of the response to a knock in which it is largest."""
_REACH_TOLERANCE = 1e-4


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


class _Pace(NamedTuple):
    """How fast a cut on a machine is looked at.

    Attributes:
        rate: Samples a second, Hz.
        chunk: Samples that are looked at together.
        chunks: Such parts until what has not settled is judged by its trend.
        response: Samples of the response to a knock in which it is largest.
    """

    rate: float
    chunk: int
    chunks: int
    response: int


def _pace_of(machine: Machine, cut: Cut) -> _Pace:
    modes = (*machine.tool.modes, *machine.workpiece.modes)
    each = [mode.natural_frequency for mode in modes]
    limits = limits_of(LatheSetup, 'sample_rate')
    rate = min(max(round(_RATE * max(each), 6), limits.low), limits.high)
    part, turns = _CHUNK / min(each), _TURNS * cut.delay
    chunks = _LONGEST if turns <= part else max(math.ceil(_LONGEST * part / turns), _MOST_CHUNKS)
    response = max(_LINEAR_RESPONSE * part, 4.0 * turns)
    return _Pace(rate, round(max(part, turns) * rate), chunks, round(response * rate))


def resting_state(machine: Machine, cut: Cut) -> Array:
    """The equilibrium under the mean cutting force C w f, from which a knock starts (4,).

    Tool displacement and velocity, workpiece displacement and velocity, m and m/s.
    """
    force = machine.cutting_stiffness(cut.depth_of_cut) * cut.feed
    modes = machine.workpiece.modes
    rest = sum(mode.chip * mode.force / mode.stiffness for mode in modes) * force
    if contact_at(machine, cut).seated:
        at_bearing = sum(mode.bearing * mode.force / mode.stiffness for mode in modes) * force
        compliance = sum(mode.bearing**2 / mode.stiffness for mode in modes)
        stiffness = machine.bearing_stiffness / (1.0 + machine.bearing_stiffness * compliance)
        reaction = stiffness * (at_bearing - cut.bearing_clearance)
        rest -= sum(mode.chip * mode.bearing / mode.stiffness for mode in modes) * reaction
    return np.array([-force / machine.tool.stiffness, 0.0, rest, 0.0])


def _lathe_at_rest(machine: Machine, cut: Cut, pace: _Pace) -> VirtualLathe:
    """A lathe in equilibrium."""
    rest = resting_state(machine, cut)
    lathe = VirtualLathe(machine, cut, sample_rate=pace.rate, initial_state=rest)
    if len(machine.workpiece.modes) > 1 and contact_at(machine, cut).seated:
        # A lathe begins with its modes as by the cutting force alone; the bearing's share settles.
        for _ in range(pace.chunks):
            if np.ptp(lathe.advance(pace.chunk)[:, 2]) <= _SETTLED * cut.feed:
                break
    return lathe


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
    pace = _pace_of(machine, cut)
    lathe = _lathe_at_rest(machine, cut, pace)
    begun = lathe.time
    lathe.knock(impulse)
    sizes: list[float] = []
    was_quiet, steady = False, 0
    for _ in range(pace.chunks):
        samples = lathe.advance(pace.chunk)
        if lathe.guard:
            return Outcome(lasts=True, amplitude=math.inf, time=lathe.time - begun)
        sizes.append(float(np.ptp(samples[:, 2])))
        size, before = sizes[-1], sizes[-2] if len(sizes) > 1 else math.inf
        quiet = not lathe.events
        if size < _STILL or (quiet and was_quiet and size < before):
            return Outcome(lasts=False, amplitude=size, time=lathe.time - begun)
        steady = steady + 1 if not quiet and abs(size - before) <= _STEADY * before else 0
        if steady == _IN_A_ROW:
            return Outcome(lasts=True, amplitude=size, time=lathe.time - begun)
        was_quiet = quiet
    # A beat of two frequencies never repeats: it lasts if its mean size does.
    quarter = len(sizes) // 4
    late, later = np.mean(sizes[-2 * quarter : -quarter]), np.mean(sizes[-quarter:])
    return Outcome(bool(later > _TREND * late), sizes[-1], lathe.time - begun)


def linear_reach(machine: Machine, cut: Cut) -> tuple[float, float]:
    """The knocks below which a stable cut never leaves its linear regime, so that they die out.

    Smaller ones meet no event (contact, loss of contact, the tool out of its cut), larger ones
    do, so the edge is bracketed by knocking.

    Args:
        machine: Tool, workpiece, bearing and material.
        cut: Steady and without noise.

    Returns:
        For an impulse forward and one backward, N s, as magnitudes.

    Raises:
        ParameterError: If there is no feed, and so no chip to begin with.
    """
    if cut.feed <= 0.0:
        raise ParameterError('the feed', cut.feed, 'm/rev', 'above 0 for a knock to be met')
    pace = _pace_of(machine, cut)
    lathe = _lathe_at_rest(machine, cut, pace)
    rest = lathe.snapshot()

    def stays_linear(impulse: float) -> bool:
        lathe.restore(rest)
        lathe.knock(impulse)
        lathe.advance(pace.response)
        return not lathe.events

    def least(sign: float) -> float:
        low = high = cut.feed * math.sqrt(abs(machine.tool.stiffness) * machine.tool.modes[0].mass)
        while not stays_linear(sign * low):
            low *= 0.5
        while stays_linear(sign * high):
            low, high = high, 2.0 * high
        while high - low > _REACH_TOLERANCE * low:
            middle = 0.5 * (low + high)
            low, high = (middle, high) if stays_linear(sign * middle) else (low, middle)
        return low

    return least(1.0), least(-1.0)
