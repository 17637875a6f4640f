"""Random machines and cuts that chatter, and what is true of them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from support.machines import random_machine

from lathe_chatter.model import BearingContact, Cut, Machine
from lathe_chatter.stability import (
    critical_depths,
    floquet,
    rightmost_root,
    seating_depth,
)
from lathe_chatter.supervisor import Limits
from lathe_chatter.supervisor.move_search import removal_rate

SLOWEST, FASTEST = 1000.0, 12000.0
_SCAN = 60.0 / np.linspace(60.0 / SLOWEST, 60.0 / FASTEST, 400)
NOISE = {'force_noise': 4.5e-4, 'sensor_noise': 1e-7, 'runout': 5e-6}


@dataclass(frozen=True)
class Trial:
    """A cut that chatters on a machine, and what is told of the machine.

    Attributes:
        machine: The true one.
        told: What an impact test says.
        cut: That chatters.
        seed: Of the noise.
        limit: The smallest depth that is not stable, m.
    """

    machine: Machine
    told: Machine
    cut: Cut
    seed: int
    limit: float

    @property
    def limits(self) -> Limits:
        """Half of the depth may go."""
        return Limits(SLOWEST, FASTEST, smallest_depth=0.5 * self.cut.depth_of_cut)

    def best_rate(self) -> float:
        """Largest removal rate, up to the present one, of a stable cut in the limits, m2/s."""
        cut, asked = self.cut, removal_rate(self.cut)
        floating, seated = (critical_depths(self.machine, _SCAN, seated=s) for s in (False, True))
        line = np.full(_SCAN.shape, math.inf)
        if cut.bearing_contact is BearingContact.SEATED:
            line = np.zeros(_SCAN.shape)
        elif cut.bearing_contact is BearingContact.GAP:
            # Inverse to the feed a turn, which may be inverse to the speed.
            feeds = 60.0 * cut.feed_speed / _SCAN
            feeds = (
                np.full(_SCAN.shape, cut.feed_per_revolution) if cut.feed_per_revolution else feeds
            )
            at_one = seating_depth(self.machine, cut.bearing_clearance, 1e-3)
            line = at_one * 1e-3 / feeds
        present = cut.depth_of_cut
        depth = np.minimum(np.minimum(floating, line), present)
        on_bearing = np.minimum(seated, present)
        depth = np.where(on_bearing > line, np.maximum(depth, on_bearing), depth)
        depth[depth < self.limits.smallest_depth] = 0.0
        per_depth = asked / present
        if cut.feed_per_revolution:
            per_depth = per_depth * _SCAN / cut.spindle_speed_rpm
        return float(min((depth * per_depth).max(), asked))


def _is_seated(machine: Machine, cut: Cut) -> bool:
    """Whether the mean force holds the workpiece on its bearing."""
    if cut.bearing_contact is not BearingContact.GAP:
        return cut.bearing_contact is BearingContact.SEATED
    return cut.depth_of_cut >= seating_depth(machine, cut.bearing_clearance, cut.feed)


def true_growth(machine: Machine, cut: Cut) -> float:
    """Of small vibration, in the contact that the mean force makes, 1/s."""
    seated = _is_seated(machine, cut)
    if cut.speed_variation_amplitude:
        return floquet(machine, cut, seated=seated).growth_rate
    return rightmost_root(machine, cut.spindle_speed_rpm, cut.depth_of_cut, seated=seated).real


def random_trial(seed: int, off: float = 0.0) -> Trial:
    """A cut 10 to 80 % deeper than its limit.

    Args:
        seed: Of everything.
        off: Part by which every number that is told is wrong at most.
    """
    rng = np.random.default_rng([21, seed])
    machine = replace(random_machine(rng), cutting_coefficient=3.5e6 * rng.uniform(0.5, 1.5))
    contact = [BearingContact.NONE, BearingContact.GAP, BearingContact.SEATED][rng.integers(3)]
    rpm = float(rng.uniform(2000.0, 11000.0))
    cut = Cut(
        spindle_speed_rpm=rpm,
        bearing_contact=contact,
        bearing_clearance=float(rng.uniform(1e-6, 2e-5)),
        feed_per_revolution=float(rng.uniform(5e-5, 2e-4)),
        **NOISE,
    )
    if rng.integers(2):  # half of the lathes keep the speed of their feed
        cut = replace(
            cut, feed_speed=cut.feed_per_revolution * rpm / 60.0, feed_per_revolution=0.0
        )
    limit = _limit(machine, cut)
    depth = limit * float(rng.uniform(1.1, 1.8))
    cut = cut.with_changes(depth_of_cut=min(depth, 0.01))
    return Trial(machine, _told(machine, rng, off), cut, seed, limit)


def _limit(machine: Machine, cut: Cut) -> float:
    """The smallest depth that is not stable, m."""
    limits = [
        float(critical_depths(machine, np.array([cut.spindle_speed_rpm]), seated=s)[0])
        for s in (False, True)
    ]
    if cut.bearing_contact is not BearingContact.GAP:
        return limits[cut.bearing_contact is BearingContact.SEATED]
    line = seating_depth(machine, cut.bearing_clearance, cut.feed)
    return limits[0] if limits[0] <= line else max(line, limits[1])


def _told(machine: Machine, rng: np.random.Generator, off: float) -> Machine:
    """The machine with every number wrong by up to a part."""
    draw = 1.0 + off * rng.uniform(-1.0, 1.0, 8)
    tool, workpiece = (
        replace(
            mode,
            mass=mode.mass * part[0],
            natural_frequency=mode.natural_frequency * part[1],
            damping_ratio=mode.damping_ratio * part[2],
        )
        for mode, part in ((machine.tool, draw[:3]), (machine.workpiece, draw[3:6]))
    )
    return Machine(
        tool, workpiece, machine.bearing_stiffness * draw[6], machine.cutting_coefficient * draw[7]
    )
