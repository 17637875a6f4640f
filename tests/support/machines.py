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


def random_structure(rng: np.random.Generator, tool: int, workpiece: int) -> Machine:
    """A machine with so many modes a body, some of which are coupled by their directions."""

    def mode() -> Mode:
        chip, force, bearing = rng.uniform(-0.5, 1.0, 3)
        return Mode(
            rng.uniform(0.02, 0.2), rng.uniform(300.0, 3000.0), rng.uniform(0.01, 0.1),
            chip=chip, force=force, bearing=bearing,
        )  # fmt: skip

    return Machine(
        [mode() for _ in range(tool)],
        [mode() for _ in range(workpiece)],
        bearing_stiffness=rng.uniform(5e3, 5e4),
    )
