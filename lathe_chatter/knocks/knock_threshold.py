"""The smallest knock that turns a cut that is stable to small disturbances into lasting chatter.

The knocks that last need not be an interval, so they are looked for upwards in small steps from
the largest that is sure to die out, and the first that lasts is then bisected.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from lathe_chatter.errors import ParameterError
from lathe_chatter.knocks.knock_outcome import follow_knock, linear_reach
from lathe_chatter.model import Cut, Machine
from lathe_chatter.model.lathe_parameter_table import CUT_ROWS
from lathe_chatter.model.quantity_fields import Quantity
from lathe_chatter.stability import contact_at

_STEP = Quantity('ratio of one knock tried to the one before', low=1.001, high=2.0)
_REACH = Quantity('largest knock over the one that is sure to die out', low=1.0, high=1e4)
_TOLERANCE = Quantity('relative width of the bracket', low=1e-6, high=0.5)


class Margin(str, Enum):
    """What a cut has left."""

    UNSTABLE = 'unstable'
    """It chatters without any knock."""
    FINITE = 'finite'
    """A knock was found that makes it chatter for good."""
    NONE_FOUND = 'none found'
    """Every knock that was tried died out."""


@dataclass(frozen=True)
class KnockLimit:
    """The smallest knock that lasts.

    Attributes:
        margin: Whether there is one.
        impulse: Signed, N s: the smaller of both directions, and the upper end of its bracket,
            seen to last; 0 for an unstable cut, nan where none was found.
        survived: The magnitude below it that was seen to die out in its direction, N s.
        linear: The magnitude below which nothing can last, as the cut stays linear, N s.
        searched: The magnitude up to which both directions were looked through, N s: that of the
            first that lasted, before it was bisected, or up to which every one died out; 0 for an
            unstable cut, infinite where nothing is cut.
        amplitude: Of the tool in the chatter that it ends in, peak to peak, m.
        trials: Knocks that were simulated.
    """

    margin: Margin
    impulse: float
    survived: float
    linear: float
    searched: float
    amplitude: float
    trials: int


def smallest_lasting_knock(
    machine: Machine,
    cut: Cut,
    *,
    reach: float = 30.0,
    step: float = 1.12,
    tolerance: float = 0.01,
) -> KnockLimit:
    """Look for the smallest knock, forward or backward, that ends in lasting chatter.

    Args:
        machine: Tool, workpiece, bearing and material.
        cut: Steady and without noise.
        reach: How far to look, as a multiple of the knock that is sure to die out.
        step: Ratio of one knock tried to the next: an island of lasting knocks that is narrower
            may be missed.
        tolerance: Relative width to which the first that lasts is bisected.

    Raises:
        ParameterError: If the cut is not steady and quiet, or another argument not allowed.
    """
    ratio, far = _STEP.check('step', step), _REACH.check('reach', reach)
    close = _TOLERANCE.check('tolerance', tolerance)
    _check_steady(cut)
    if cut.depth_of_cut == 0.0:
        return KnockLimit(Margin.NONE_FOUND, math.nan, 0.0, math.inf, math.inf, 0.0, 0)
    if not contact_at(machine, cut).stable:
        return KnockLimit(Margin.UNSTABLE, 0.0, 0.0, 0.0, 0.0, math.nan, 0)
    forward, backward = linear_reach(machine, cut)
    linear, trials = min(forward, backward), 0
    survived = {1.0: forward, -1.0: backward}
    for impulse in _upwards(forward, backward, linear * far, ratio):
        trials += 1
        outcome = follow_knock(machine, cut, impulse)
        if not outcome.lasts:
            survived[math.copysign(1.0, impulse)] = abs(impulse)
            continue
        found = _bisected(machine, cut, survived, _Found(impulse, outcome.amplitude), close)
        low = survived[math.copysign(1.0, found.impulse)]
        trials += found.trials
        return KnockLimit(
            Margin.FINITE, found.impulse, low, linear, abs(impulse), found.amplitude, trials
        )
    searched = min(survived.values())
    return KnockLimit(Margin.NONE_FOUND, math.nan, searched, linear, searched, 0.0, trials)


class _Found(NamedTuple):
    """A knock that lasts, N s, the chatter that it ends in, m, and how many were tried."""

    impulse: float
    amplitude: float
    trials: int = 0


def _bisected(
    machine: Machine, cut: Cut, survived: dict[float, float], first: _Found, close: float
) -> _Found:
    """The smallest lasting knock below the first that was found, in either direction.

    Args:
        machine: Tool, workpiece, bearing and material.
        cut: Steady.
        survived: By direction, a magnitude that dies out; raised to the lower end of a bracket.
        first: The first that lasts.
        close: Relative width of the bracket.
    """
    best, trials = first, 0
    sign = math.copysign(1.0, first.impulse)
    for direction in (sign, -sign):
        # The other direction is worth a bracket only if it lasts where this one just does.
        trying = abs(best.impulse) if direction != sign else None
        while trying is not None or abs(best.impulse) - survived[direction] > close * abs(
            best.impulse
        ):
            low, high = survived[direction], abs(best.impulse)
            magnitude = trying if trying is not None else 0.5 * (low + high)
            trials += 1
            outcome = follow_knock(machine, cut, direction * magnitude)
            if outcome.lasts:
                best = _Found(direction * magnitude, outcome.amplitude)
            elif trying is not None:
                break
            else:
                survived[direction] = magnitude
            trying = None
    return best._replace(trials=trials)


def _upwards(forward: float, backward: float, largest: float, ratio: float) -> Iterator[float]:
    """Knocks of both directions by rising magnitude, each from what is sure to die out."""
    magnitude = min(forward, backward)
    while magnitude < largest:
        magnitude *= ratio
        for sign, sure in ((1.0, forward), (-1.0, backward)):
            if magnitude > sure:
                yield sign * magnitude


def _check_steady(cut: Cut) -> None:
    """See that nothing but the knock disturbs the cut."""
    for row in CUT_ROWS:
        value = getattr(cut, row.name)
        if (row.only_samples or row.name == 'speed_variation_amplitude') and value != 0.0:
            raise ParameterError(row.name, value, row.unit, '0, so that the knock is alone')
