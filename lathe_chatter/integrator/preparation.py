"""From a machine and its cut to the constants of the inner loop."""

from __future__ import annotations

import math

import numpy as np

from lathe_chatter.errors import ParameterError
from lathe_chatter.integrator import propagation
from lathe_chatter.model import Array, Cut, Machine

_TURN_PER_STEP = 0.05
_MOST_STEPS = 200_000


def mechanics_of(machine: Machine, cut: Cut) -> Array:
    """The mechanical constants (propagation.MECHANICS_SIZE,), per unit of mass."""
    tool, workpiece = machine.tool, machine.workpiece
    cutting = machine.cutting_stiffness(cut.depth_of_cut)
    mechanics = np.empty(propagation.MECHANICS_SIZE)
    mechanics[propagation.TOOL_STIFFNESS] = tool.natural_frequency**2
    mechanics[propagation.TOOL_DAMPING] = tool.damping / tool.mass
    mechanics[propagation.TOOL_CUTTING] = cutting / tool.mass
    mechanics[propagation.TOOL_COMPLIANCE] = 1.0 / tool.mass
    mechanics[propagation.WORKPIECE_STIFFNESS] = workpiece.natural_frequency**2
    mechanics[propagation.WORKPIECE_DAMPING] = workpiece.damping / workpiece.mass
    mechanics[propagation.WORKPIECE_CUTTING] = cutting / workpiece.mass
    mechanics[propagation.BEARING_STIFFNESS] = machine.bearing_stiffness / workpiece.mass
    mechanics[propagation.CLEARANCE] = cut.bearing_clearance
    return mechanics


def steps_per_sample(machine: Machine, cut: Cut, speed: float, sample_rate: float) -> int:
    """Steps so short that the series converge and that a turn has many of them.

    Args:
        machine: The machine.
        cut: The cut.
        speed: The greatest spindle speed to come, rev/s, without its variation.
        sample_rate: Hz.

    Raises:
        ParameterError: If a sample would take more steps than anyone could wait for.
    """
    cutting = machine.cutting_stiffness(cut.depth_of_cut)
    on_workpiece = machine.workpiece_stiffness(seated=True) + 2.0 * cutting
    on_tool = machine.tool.stiffness + 2.0 * cutting
    # A bound of every natural frequency: the largest row of the stiffness matrix (Gershgorin).
    fastest = math.sqrt(max(on_tool / machine.tool.mass, on_workpiece / machine.workpiece.mass))
    turning = speed * (1.0 + cut.speed_variation_amplitude)
    needed = max(fastest / propagation.RATE_STEP, turning / _TURN_PER_STEP)
    if needed > _MOST_STEPS * sample_rate:
        allowed = (
            f'at least {needed / _MOST_STEPS:.0f} Hz for a machine with motions of up to '
            f'{fastest:.0f} rad/s'
        )
        raise ParameterError('sample_rate', sample_rate, 'Hz', allowed)
    return max(1, math.ceil(needed / sample_rate))
