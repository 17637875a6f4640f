"""Hours of stable cutting, in which a supervisor that may act should do nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from support.supervised_lathe import SupervisedLathe
from trials import random_trial

from lathe_chatter.model import BearingContact, Machine
from lathe_chatter.stability import critical_depth

STRETCH, CHANGES = 60.0, 4
"""s on one machine, and changes from one stable depth to another meanwhile."""
_SHALLOWEST, _DEEPEST = 0.3, 0.95
"""Of the smallest depth that is not stable: across a clearance neither floating, nor seated, nor
seated for half of a cycle, for a vibration that was stirred up may last there by one of them."""


def _carried(machine: Machine, part: float) -> Machine:
    """With a part of its bearing's stiffness."""
    return replace(machine, bearing_stiffness=part * machine.bearing_stiffness)


def stretch(seed: int) -> tuple[int, int, list[str]]:
    """One machine: how many actions there were, how many alarms, and what was said."""
    trial = random_trial(seed)
    machine, rpm = trial.machine, trial.cut.spindle_speed_rpm
    limit = trial.limit
    if trial.cut.bearing_contact is BearingContact.GAP:
        limit = min(
            critical_depth(_carried(machine, part), rpm, seated=True) for part in (0.0, 0.5, 1.0)
        )
    rng = np.random.default_rng([22, seed])
    parts = rng.uniform(_SHALLOWEST, _DEEPEST, CHANGES) * limit
    cut = trial.cut.with_changes(depth_of_cut=float(parts[0]))
    there = SupervisedLathe(cut, trial.machine, limits=trial.limits, seed=seed)
    alarms = 0
    for depth in parts.tolist():
        there.set_by_hand(told=False, depth_of_cut=depth)
        end = there.time + STRETCH / CHANGES
        while there.time < end - 1e-6:
            there.run(end - there.time, lambda: there.known.chatter)
            if there.known.chatter:
                alarms += 1
                there.run(end - there.time, lambda: not there.known.chatter)
    acted = [move for _, move, _ in there.moves]
    return len(acted), alarms, there.said
