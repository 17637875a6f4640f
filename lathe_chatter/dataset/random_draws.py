"""Machines and runs of a plan, each drawn from a stream of random numbers of its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from lathe_chatter.dataset.plan import OF_FILE, Plan
from lathe_chatter.lathe.config import LatheConfig, config_from
from lathe_chatter.model import Cut
from lathe_chatter.model.distribution import Distribution
from lathe_chatter.model.lathe_parameter_table import MACHINE_FILE
from lathe_chatter.model.quantity_fields import limits_of
from lathe_chatter.model.uncertainty import uncertainty_from
from lathe_chatter.samples.columns import ACCELERATION_COLUMNS
from lathe_chatter.stability import safe_limit

_RAMP = 20
"""Steps in which a value that takes its time changes."""
_DEEPEST = limits_of(Cut, 'depth_of_cut').high
_OF_MACHINE, _OF_RUN = 0, 1


@dataclass(frozen=True)
class DrawnRun:
    """One run of a machine: what is cut, and the knocks on the tool, N s, from which sample on."""

    machine: int
    number: int
    config: LatheConfig  # as the run begins
    cuts: dict[int, Cut]
    knocks: dict[int, float]


def drawn_machine(plan: Plan, number: int) -> LatheConfig:
    """The machine of a number, which is the same in whatever order they are drawn."""
    rng = np.random.default_rng([plan.seed, _OF_MACHINE, number])
    values = {name: how.draw(rng) for name, how in plan.machine.items()}
    if MACHINE_FILE.name in values:
        values[MACHINE_FILE.name] = plan.files[values[MACHINE_FILE.name]]
    config = config_from({**values, 'sample_rate': plan.sample_rate, 'spindle_acceleration': 0.0})
    if not plan.errors:
        return config
    file = config.described.uncertainty if config.described and plan.errors == OF_FILE else None
    known = file or uncertainty_from(plan.errors, config.machine)
    ((machine,), _) = known.draw(config.machine, 1, int(rng.integers(2**31)))
    return replace(config, setup=replace(config.setup, machine=machine))


def drawn_run(plan: Plan, machine: int, config: LatheConfig, number: int) -> DrawnRun:
    """One run of a machine."""
    rng = np.random.default_rng([plan.seed, _OF_RUN, machine, number])
    seed, moving = int(rng.integers(2**31)), {*plan.columns} & {*ACCELERATION_COLUMNS}
    setup = replace(config.setup, seed=seed, accelerometers=bool(moving))
    config = LatheConfig(setup, _changed(config, config.cut, plan.cut, rng))
    cut, cuts, knocks = config.cut, {0: config.cut}, dict[int, float]()
    events = [(event.at.draw(rng), event) for event in plan.events if rng.random() < event.share]
    for at, event in sorted(events, key=lambda pair: pair[0]):
        if event.knock is not None:
            knocks[round(at * plan.sample_rate)] = event.knock.draw(rng)
        after = _changed(config, cut, event.changes, rng)
        for step in range(1, _RAMP if event.over else 0):
            pairs = [(name, getattr(cut, name), getattr(after, name)) for name in event.changes]
            mixed = {name: old + step / _RAMP * (new - old) for name, old, new in pairs}
            time = at + event.over * (step - 1) / (_RAMP - 1)
            cuts[round(time * plan.sample_rate)] = cut.with_changes(**mixed)
        if after != cut:
            cuts[round((at + event.over) * plan.sample_rate)] = after
        cut = after
    return DrawnRun(machine, number, config, dict(sorted(cuts.items())), knocks)


def _changed(
    config: LatheConfig, cut: Cut, changes: Mapping[str, Distribution], rng: np.random.Generator
) -> Cut:
    """A cut with values drawn; a depth that is a multiple of the safe one comes last."""
    found = {name: how.draw(rng) for name, how in changes.items()}
    if 'depth_of_cut' in found and changes['depth_of_cut'].of_limit:
        factor, leaves = found.pop('depth_of_cut'), config.setup.tool_leaves_cut
        cut = cut.with_changes(**found)
        limit = safe_limit(config.machine, cut, tool_leaves_cut=leaves).depth_of_cut
        found = {'depth_of_cut': min(factor * float(limit), _DEEPEST)}
    return cut.with_changes(**found)
