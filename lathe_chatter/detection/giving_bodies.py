"""What of a machine can be identified: two bodies that give, at one pace, or the one that does.

The stand-in for a rigid body has a natural frequency far from the chatter. Taken for a mode, it
would widen the band in which force and chip are compared, and set the pace by vibration that
never comes: a slow chatter would be read from a fraction of its waves. Where both bodies give,
and are so far apart, none of one band is the pace of both.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from lathe_chatter.detection.estimate import Mode as WorksWith
from lathe_chatter.detection.filter_design import band_of
from lathe_chatter.model import Machine, Mode
from lathe_chatter.model.quantity_fields import limits_of

_GIVES = 1e-3
"""Of the other body's greatest compliance, below which a body does not give."""
_WIDEST = 9.0
"""Highest over lowest frequency of the band of a machine that is judged at one pace."""
_HEAVIEST = limits_of(Mode, 'mass').high
_WELL_DAMPED = 0.5


class Identifiable(NamedTuple):
    """A machine as the identification takes it.

    Attributes:
        machine: With the one body that gives as its tool, and beside it a heavy one of the same
            frequency; as told where both give, None where they are no plain modes.
        lone: `tool` or `workpiece` where that alone gives, else empty.
        without: What is said where there is none.
    """

    machine: Machine | None
    lone: str = ''
    without: WorksWith = WorksWith.NO_MACHINE


def identifiable(machine: Machine | None) -> Identifiable:
    """What is identified of a machine: a mode to each body, which moves as the force acts."""
    if machine is None:
        return Identifiable(None)
    modes = (*machine.tool.modes, *machine.workpiece.modes)
    if len(modes) > 2 or not all(m.chip == m.force == m.bearing == 1.0 for m in modes):
        return Identifiable(None, without=WorksWith.MANY_MODES)
    tool, workpiece = (_greatest_compliance(mode) for mode in modes)
    if max(tool, workpiece) * _GIVES < min(tool, workpiece):
        band = band_of(machine)
        if band.high > _WIDEST * band.low:
            return Identifiable(None, without=WorksWith.FAR_APART)
        return Identifiable(machine)
    body, lone = (modes[0], 'tool') if tool > workpiece else (modes[1], 'workpiece')
    still = Mode(_HEAVIEST, body.natural_frequency, _WELL_DAMPED)
    return Identifiable(Machine(body, still, 0.0, machine.cutting_coefficient), lone)


def _greatest_compliance(mode: Mode) -> float:
    """At any frequency, m/N."""
    ratio = max(mode.damping_ratio, 1e-9)
    resonance = 2.0 * ratio * math.sqrt(1.0 - ratio**2) if ratio < math.sqrt(0.5) else 1.0
    return 1.0 / (mode.stiffness * resonance)
