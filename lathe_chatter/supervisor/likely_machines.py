"""The machines that the truth may be, where one was told and something is heard of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lathe_chatter.model import BearingContact, Cut, Machine
from lathe_chatter.model.uncertainty import equally_uncertain
from lathe_chatter.stability import ProcessDamping, critical_depths, rightmost_roots

_MACHINES = 32
_MOST_HEARD = 2.0
"""Times the told C w that may be heard."""
_FIT, _FIT_GROWTH = 0.004, 4.0
"""Part of the frequency of chatter, and 1/s of its growth, within which it is that of the told
machine: of machines told 5 % off a tenth fit so well."""


def as_heard(
    machine: Machine, cut: Cut, cutting_stiffness: float, tool_frequency: float
) -> Machine:
    """The machine with what is heard of it; nan where nothing is.

    Chatter that leaves the cut makes C w look less than it is, and much more than was told is an
    error: a cut begun a moment ago, or not this one.

    Args:
        machine: As told.
        cut: That is heard.
        cutting_stiffness: C w, N/m.
        tool_frequency: Natural frequency of a tool with one mode, Hz.
    """
    told = machine.cutting_stiffness(cut.depth_of_cut)
    if 0.0 < told < cutting_stiffness < _MOST_HEARD * told:
        machine = replace(machine, cutting_coefficient=cutting_stiffness / cut.depth_of_cut)
    if math.isfinite(tool_frequency) and len(machine.tool.modes) == 1:
        omega = 2.0 * math.pi * tool_frequency
        machine = replace(machine, tool=replace(machine.tool.modes[0], natural_frequency=omega))
    return machine


def fits(machine: Machine, cut: Cut, frequency: float, growth_rate: float) -> bool:
    """Whether chatter that is heard, Hz and 1/s, is that of the machine as told."""
    each = [carried(machine, part) for part in contacts_of(cut)[0][0]]
    roots = rightmost_roots(
        each, cut.spindle_speed_rpm, cut.depth_of_cut, seated=True, process=ProcessDamping.of(cut),
        proven=False,
    )  # fmt: skip
    near = np.abs(roots.imag - 2.0 * math.pi * frequency) < _FIT * roots.imag
    return bool((near & (np.abs(roots.real - growth_rate) < _FIT_GROWTH)).any())


def may_be(machine: Machine, error: float) -> list[Machine]:
    """Machines that the truth may be, the told one first.

    Args:
        machine: As told.
        error: Relative standard error of every figure of it.
    """
    drawn, _ = equally_uncertain(machine, error).draw(machine, _MACHINES - 1 if error else 0)
    parts = np.exp(error * np.random.default_rng(1).standard_normal(len(drawn)))
    return [machine, *(carried(each, part) for each, part in zip(drawn, parts, strict=True))]


def carried(machine: Machine, part: float) -> Machine:
    """The machine with a part of its bearing's stiffness."""
    return replace(machine, bearing_stiffness=float(part) * machine.bearing_stiffness)


def chance_of(machines: Sequence[Machine], cut: Cut) -> float:
    """The share of some machines on which a cut is stable, whatever its bearing does."""
    parts, _ = contacts_of(cut)[0]
    each = np.array([[carried(m, part) for part in parts] for m in machines], dtype=object)
    depths = critical_depths(
        each, cut.spindle_speed_rpm, seated=True, process=ProcessDamping.of(cut)
    )
    return float(np.mean(depths.min(axis=1) > cut.depth_of_cut))


def contacts_of(cut: Cut) -> list[tuple[tuple[float, ...], int]]:
    """What a cut may be on its bearing.

    Returns:
        The parts of the bearing's stiffness that carry: 0 while the workpiece floats, 1 while it
        is seated, and some where it is seated for a part of each cycle; and the side of the
        seating line, -1 below it, 1 above it, 0 for either.
    """
    if cut.bearing_contact in {BearingContact.NONE, BearingContact.SEATED}:
        return [((float(cut.bearing_contact is BearingContact.SEATED),), 0)]
    return [((0.0, 0.5, 1.0), 0), ((0.0,), -1), ((1.0,), 1)]
