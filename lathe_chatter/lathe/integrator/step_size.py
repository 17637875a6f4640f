"""How short a step of the integrator is: so short that its series converge."""

from __future__ import annotations

import math

from lathe_chatter.errors import ParameterError
from lathe_chatter.lathe.integrator import state_layout as layout
from lathe_chatter.lathe.integrator.coefficients import (
    acting_in,
    basis_in,
    regimes_of,
    settings_of,
)
from lathe_chatter.lathe.integrator.propagation import RATE_STEP
from lathe_chatter.model import Cut
from lathe_chatter.model.machine_and_sampling import LatheSetup

_TURN_PER_STEP = 0.05
_TURN_PER_STEP_UNBALANCED = 0.02
"""The force of an unbalance turns with the spindle, and is held by a quintic too."""
_MOST_STEPS = 200_000
_MOST_STEPS_A_TURN = 50_000_000


def steps_per_sample(setup: LatheSetup, cut: Cut, speed: float) -> int:
    """Steps so short that the series converge and that a turn has many of them.

    Args:
        setup: Machine, force law and sampling.
        cut: The cut.
        speed: The spindle speed now, rev/s, without its variation.

    Raises:
        ParameterError: If a sample would take more steps than anyone could wait for, or a turn
            more than there is memory for.
    """
    rate = setup.sample_rate
    fastest = _fastest(setup, cut, speed) * rate
    turning = max(cut.spindle_speed_rpm / 60.0, speed) * (1.0 + cut.speed_variation_amplitude)
    a_step = _TURN_PER_STEP if cut.unbalance == 0.0 else _TURN_PER_STEP_UNBALANCED
    needed = max(fastest / RATE_STEP, turning / a_step)
    if not needed <= _MOST_STEPS * rate:
        allowed = (
            f'at least {needed / _MOST_STEPS:.0f} Hz for a machine with motions of up to '
            f'{fastest:.0f} rad/s'
        )
        raise ParameterError('sample_rate', rate, 'Hz', allowed)
    steps = max(1, math.ceil(needed / rate))
    slowest = min(cut.spindle_speed_rpm / 60.0, speed) * (1.0 - cut.speed_variation_amplitude)
    if rate * steps > _MOST_STEPS_A_TURN * slowest:
        least = rate * steps / _MOST_STEPS_A_TURN * 60.0
        allowed = f'at least {least:.3g} rev/min where a second has {rate * steps:.0f} steps'
        raise ParameterError('spindle_speed_rpm', cut.spindle_speed_rpm, 'rev/min', allowed)
    return steps


def _fastest(setup: LatheSetup, cut: Cut, speed: float) -> float:
    """The largest |lambda| of any regime at any speed to come, per sample."""
    slowest = min(cut.spindle_speed_rpm / 60.0, speed) * (1.0 - cut.speed_variation_amplitude)
    settings = settings_of(setup, cut, 1)
    if slowest * 60.0 < cut.spindle_speed_rpm:
        settings[layout.PROCESS_DAMPING] *= cut.spindle_speed_rpm / (60.0 * slowest)
    return max(
        basis_in(setup.machine, regime, *acting_in(settings, regime)[:3]).rate
        for regime in regimes_of(setup, cut)
    )
