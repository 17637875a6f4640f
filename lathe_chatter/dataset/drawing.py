"""Machines and runs of a plan, each drawn from a stream of random numbers of its own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from lathe_chatter.dataset.plan import OF_FILE, Event, Plan
from lathe_chatter.model import Cut
from lathe_chatter.model.distribution import Distribution
from lathe_chatter.model.lathe_setup import LatheSetup
from lathe_chatter.model.machine_file import MachineDescription, load_machine
from lathe_chatter.model.parameters import MACHINE_FILE
from lathe_chatter.model.quantities import limits_of
from lathe_chatter.model.uncertainty import uncertainty_from
from lathe_chatter.samples.columns import ACCELERATION_COLUMNS
from lathe_chatter.stability import safe_limit

_RAMP = 20
"""Steps in which a value that takes its time changes."""
_DEEPEST = limits_of(Cut, 'depth_of_cut').high
_OF_MACHINE, _OF_RUN = 0, 1


@dataclass(frozen=True)
class DrawnMachine:
    """One machine of a plan."""

    number: int
    described: MachineDescription
    tool_leaves_cut: bool


@dataclass(frozen=True)
class DrawnRun:
    """One run: what is cut from which sample on, and the knocks on the tool, N s, by sample."""

    machine: int
    number: int
    setup: LatheSetup
    cuts: dict[int, Cut]
    knocks: dict[int, float]


def drawn_machine(plan: Plan, number: int) -> DrawnMachine:
    """The machine of a number, which is the same in whatever order they are drawn."""
    rng = np.random.default_rng([plan.seed, _OF_MACHINE, number])
    values = {name: how.draw(rng) for name, how in plan.machine.items()}
    source, leaves = values.pop(MACHINE_FILE.name, None), values.pop('tool_leaves_cut', True)
    described = load_machine(plan.files[source]) if source else MachineDescription()
    if not source:
        values.setdefault('bearing_stiffness', None)  # the paper's follows the workpiece
    machine = described.machine
    for name, value in values.items():
        part, _, inner = name.rpartition('.')
        changed = replace(getattr(machine, part), **{inner: value}) if part else value
        machine = replace(machine, **{part or name: changed})
    if plan.errors:
        file = described.uncertainty if plan.errors == OF_FILE else None
        known = file or uncertainty_from(plan.errors, machine)
        ((machine,), _) = known.draw(machine, 1, int(rng.integers(2**31)))
    return DrawnMachine(number, replace(described, machine=machine), leaves)


def drawn_run(plan: Plan, machine: DrawnMachine, number: int) -> DrawnRun:
    """One run of a machine."""
    rng = np.random.default_rng([plan.seed, _OF_RUN, machine.number, number])
    setup = LatheSetup(
        machine.described.machine,
        plan.sample_rate,
        machine.tool_leaves_cut,
        seed=int(rng.integers(2**31)),
        accelerometers=any(name in ACCELERATION_COLUMNS for name in plan.columns),
    )
    cut = _changed(setup, machine.described.cut, plan.cut, rng)
    cuts, knocks = {0: cut}, dict[int, float]()
    events = [(event.at.draw(rng), event) for event in plan.events if rng.random() < event.share]
    for at, event in sorted(events, key=lambda pair: pair[0]):
        if event.knock is not None:
            knocks[round(at * plan.sample_rate)] = event.knock.draw(rng)
        after = _changed(setup, cut, event.changes, rng)
        for time, mixed in _on_the_way(at, event, cut, after):
            cuts[round(time * plan.sample_rate)] = mixed
        cut = after
    return DrawnRun(machine.number, number, setup, dict(sorted(cuts.items())), knocks)


def _on_the_way(at: float, event: Event, cut: Cut, after: Cut) -> Iterator[tuple[float, Cut]]:
    """What is cut from which time on, s, while an event takes place."""
    for step in range(1, _RAMP if event.over else 0):
        pairs = ((name, getattr(cut, name), getattr(after, name)) for name in event.changes)
        mixed = {name: old + step / _RAMP * (new - old) for name, old, new in pairs}
        yield at + event.over * (step - 1) / (_RAMP - 1), cut.with_changes(**mixed)
    if after != cut:
        yield at + event.over, after


def _changed(
    setup: LatheSetup, cut: Cut, changes: Mapping[str, Distribution], rng: np.random.Generator
) -> Cut:
    """A cut with values drawn; a depth that is a multiple of the safe one comes last."""
    found = {name: how.draw(rng) for name, how in changes.items()}
    if 'depth_of_cut' not in found or not changes['depth_of_cut'].of_limit:
        return cut.with_changes(**found)
    factor = found.pop('depth_of_cut')
    cut = cut.with_changes(**found)
    limit = safe_limit(setup.machine, cut, tool_leaves_cut=setup.tool_leaves_cut).depth_of_cut
    return cut.with_changes(depth_of_cut=min(factor * float(limit), _DEEPEST))
