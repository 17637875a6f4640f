"""Machines that differ from the paper's at random, for tests."""

from __future__ import annotations

import numpy as np

from lathe_chatter.model import Machine, Mode


def random_machine(
    rng: np.random.Generator, spread: float = 0.5, damping: float = 0.05
) -> Machine:
    """The paper's machine with every modal number scaled by 1 - spread .. 1 + spread."""
    scale = 1.0 + spread * rng.uniform(-1.0, 1.0, 6)
    return Machine(
        Mode(0.05 * scale[0], 775.0 * scale[1], damping * scale[2]),
        Mode(0.05 * scale[3], 650.0 * scale[4], damping * scale[5]),
    )
