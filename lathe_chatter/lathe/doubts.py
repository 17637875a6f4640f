"""What of a lathe can be computed but means little: sentences for who started it."""

from __future__ import annotations

import math

import numpy as np

from lathe_chatter.lathe.integrator.coefficients import constants_of
from lathe_chatter.lathe.integrator.step_size import steps_per_sample
from lathe_chatter.model import Cut
from lathe_chatter.model.machine_and_sampling import LatheSetup

_SHOWN = 3.0
"""Samples that a vibration has in a period, at least, where a spectrum shows it."""
_STEPS_A_SECOND = 5e6
"""That one core takes of a machine of two modes, with events; of more modes accordingly fewer."""


def doubts(setup: LatheSetup, cut: Cut) -> list[str]:
    """Why samples of this lathe may not be what was meant, each in one sentence.

    A vibration of the machine, in or out of the cut and on or off its bearing, with fewer than
    three samples a period; and steps so short that a core falls behind real time.

    Raises:
        ParameterError: If the machine with this cut is too fast for any step.
    """
    steps = steps_per_sample(setup, cut, cut.spindle_speed_rpm / 60.0)
    bases = constants_of(setup, cut, steps).bases
    rate = setup.sample_rate
    turns = [float(np.linalg.eigvals(basis.generator).imag.max()) for basis in bases.values()]
    highest = max(turns) * rate * steps / (2.0 * math.pi)
    modes = len(next(iter(bases.values())).vectors) // 2
    most = _STEPS_A_SECOND * 2.0 / max(modes, 2)
    found = []
    if rate * steps > most:
        found.append(
            f'The machine moves at up to {highest:.3g} Hz, for which {rate * steps:.2g} steps a '
            f'second are taken at any sample rate: that is slower than real time, which modes and '
            f'a bearing of up to {highest * most / (rate * steps):.2g} Hz would keep.'
        )
    elif highest * _SHOWN > rate:
        enough = math.ceil(_SHOWN * highest / 100.0) * 100
        found.append(
            f'The machine vibrates at up to {highest:.4g} Hz, more than a third of the sample '
            f'rate of {rate:g} Hz: a sample_rate of {enough} Hz shows it.'
        )
    return found
