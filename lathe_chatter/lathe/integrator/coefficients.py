"""From a setup and its cut to the constants of the inner loop."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lathe_chatter.arrays import Array
from lathe_chatter.errors import ParameterError
from lathe_chatter.lathe.integrator import propagation
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.model import BearingContact, Cut, Machine
from lathe_chatter.model.lathe_setup import LatheSetup

_TURN_PER_STEP = 0.05
_MOST_STEPS = 200_000


class Constants(NamedTuple):
    """What the inner loop is given beside a lathe's memory.

    Attributes:
        settings: What machine and cut ask for (layout.SETTINGS_SIZE,).
        mechanics: The mechanical constants (propagation.MECHANICS_SIZE,).
        matrices: The response to a whole step (propagation.REGIMES, ROWS, 4).
    """

    settings: Array
    mechanics: Array
    matrices: Array


def constants_of(setup: LatheSetup, cut: Cut, steps: int) -> Constants:
    """The constants for a cut that takes so many steps a sample."""
    mechanics = mechanics_of(setup.machine, cut)
    matrices = propagation.step_matrices(1.0 / (setup.sample_rate * steps), mechanics)
    return Constants(settings_of(setup, cut), mechanics, matrices)


def settings_of(setup: LatheSetup, cut: Cut) -> Array:
    """What machine and cut ask of the inner loop (layout.SETTINGS_SIZE,)."""
    settings = np.empty(layout.SETTINGS_SIZE)
    settings[layout.SAMPLE_RATE] = setup.sample_rate
    settings[layout.TARGET_SPEED] = cut.spindle_speed_rpm / 60.0
    settings[layout.ACCELERATION] = setup.spindle_acceleration / 60.0
    settings[layout.VARIATION] = cut.speed_variation_amplitude
    settings[layout.VARIATION_FREQUENCY] = cut.speed_variation_frequency
    settings[layout.FEED_SPEED] = cut.feed_speed if setup.tool_leaves_cut else 0.0
    settings[layout.CUTTING_STIFFNESS] = setup.machine.cutting_stiffness(cut.depth_of_cut)
    settings[layout.NOMINAL_FEED_SPEED] = cut.feed_speed
    settings[layout.MAY_LEAVE_CUT] = setup.tool_leaves_cut
    settings[layout.HAS_CLEARANCE] = cut.bearing_contact is BearingContact.GAP
    settings[layout.FORCE_NOISE] = cut.force_noise
    settings[layout.SENSOR_NOISE] = cut.sensor_noise
    settings[layout.RUNOUT] = cut.runout
    settings[layout.LIMIT] = setup.displacement_limit
    return settings


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
