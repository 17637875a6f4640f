"""Windows of simulated cuts, each with its truth; each machine and each run is drawn by itself."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.dataset.plan import OF_FILE, Drawn, Plan
from lathe_chatter.lathe import EventKind
from lathe_chatter.lathe.config import LatheConfig, config_from
from lathe_chatter.model import Cut
from lathe_chatter.model.lathe_parameter_table import LATHE
from lathe_chatter.model.quantity_fields import limits_of
from lathe_chatter.model.uncertainty import uncertainty_from
from lathe_chatter.samples.columns import ACCELERATION_COLUMNS, UNITS
from lathe_chatter.stability import safe_limit
from lathe_chatter.stability.stability_of_many_cuts import OperatingPoints, operating_points

Table = dict[str, Array]
"""Columns of windows: (n,), and (n, samples) where they are signals."""
_UNIT = UNITS | {'start': 's', 'growth_rate': '1/s', 'frequency': 'Hz', 'seconds_since_onset': 's'}
_REGIMES = np.array(['free', 'rattling', 'seated'])
_ON_BEARING = {EventKind.BEARING_ENGAGES: True, EventKind.BEARING_RELEASES: False}
_OUT_OF_CUT = {EventKind.TOOL_LEAVES_CUT: True, EventKind.TOOL_ENTERS_CUT: False}
_RAMP = 20
"""Steps in which a value that takes its time changes."""
_OF_MACHINE, _OF_RUN = 0, 1


def unit_of(column: str) -> str:
    """The unit of a column of windows; empty for a pure number or a word."""
    return _UNIT.get(column, LATHE[column].unit if column in LATHE else '')


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
    config = config_from({**values, 'sample_rate': plan.sample_rate, 'spindle_acceleration': 0.0})
    file = config.description.uncertainty if plan.errors == OF_FILE else None
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
    cuts = {sample: cuts[sample] for sample in sorted(cuts) if sample < plan.samples}
    knocks = {sample: knock for sample, knock in knocks.items() if sample < plan.samples}
    return DrawnRun(machine, number, config, cuts, knocks)


def _changed(config: LatheConfig, cut: Cut, changes: Drawn, rng: np.random.Generator) -> Cut:
    """A cut with values drawn; a depth that is a multiple of the safe one comes last."""
    found = {name: how.draw(rng) for name, how in changes.items()}
    if 'depth_of_cut' in found and changes['depth_of_cut'].of_limit:
        factor, leaves = found.pop('depth_of_cut'), config.setup.tool_leaves_cut
        cut = cut.with_changes(**found)
        limit = safe_limit(config.machine, cut, tool_leaves_cut=leaves).depth_of_cut
        found = {'depth_of_cut': min(factor * float(limit), limits_of(Cut, 'depth_of_cut').high)}
    return cut.with_changes(**found)


def windows_of(plan: Plan, machines: dict[int, LatheConfig]) -> tuple[Table, list[DrawnRun]]:
    """The windows of some machines, and the runs that they are cut from."""
    runs = [drawn_run(plan, *one, k) for one in machines.items() for k in range(plan.runs)]
    setups = [run.config.setup for run in runs for _ in run.cuts]
    cuts = [cut for run in runs for cut in run.cuts.values()]
    leaves = [setup.tool_leaves_cut for setup in setups]
    points = operating_points([setup.machine for setup in setups], cuts, tool_leaves_cut=leaves)
    ends = np.cumsum([len(run.cuts) for run in runs])[:-1]
    parts = zip(runs, *(np.split(each, ends) for each in points), strict=True)
    tables = [_windows(plan, run, OperatingPoints(*own)) for run, *own in parts]
    return {name: np.concatenate([t[name] for t in tables]) for name in tables[0]}, runs


def _windows(plan: Plan, run: DrawnRun, points: OperatingPoints) -> Table:
    """The windows of a run, with the truth of each of its cuts."""
    samples, contacts = _simulated(plan, run)
    last = len(samples['time']) - plan.length
    starts = np.array([start for start in plan.starts if start <= last], np.int64)
    inside = starts[:, None] + np.arange(plan.length)
    signals = {name: samples[name][inside].astype('f4') for name in plan.columns}
    changes, ends, rate = np.array([*run.cuts]), starts + plan.length, plan.sample_rate
    now = np.searchsorted(changes, ends - 1, side='right') - 1
    # The change that made it unstable: the first after the last stable cut.
    calm = np.maximum.accumulate(np.where(points.stable, np.arange(len(changes)), -1))
    onset = np.where(points.stable, np.nan, changes[np.minimum(calm + 1, len(changes) - 1)])
    # Time spent on the bearing and out of the cut, at the ends of each window, as a share of it.
    times, lasted = contacts[:, 0], np.diff(contacts[:, 0])
    spent = [np.concatenate(([0.0], np.cumsum(lasted * s))) for s in contacts[:-1, 1:].T]
    edges = np.array([starts, ends]) / rate
    within = [np.diff(np.interp(edges, times, total), axis=0)[0] for total in spent]
    on_bearing, out_of_cut = np.round(np.array(within) * rate / plan.length, 9)
    drawn = [LatheConfig(run.config.setup, cut).parameters() for cut in run.cuts.values()]
    values = {name: np.array([each[name] for each in drawn])[now] for name in plan.drawn}
    facts = {  # card.md.j2 says what they are
        'machine': run.machine,
        'run': run.number,
        'seed': run.config.setup.seed,
        'start': starts / rate,
        'growth_rate': points.root.real[now],
        'frequency': points.root.imag[now] / (2.0 * np.pi),
        'stable': points.stable[now],
        'regime': _REGIMES[(on_bearing > 0.0).astype(int) + (on_bearing >= 1.0)],
        'share_out_of_cut': out_of_cut,
        'share_on_bearing': on_bearing,
        'seconds_since_onset': (ends - onset[now]) / rate,
    }
    return {n: np.resize(v, len(starts)) for n, v in facts.items()} | signals | values


def _simulated(plan: Plan, run: DrawnRun) -> tuple[Table, Array]:
    """The samples of a run, and its contacts.

    Returns:
        Samples by column (n,), and rows of time, s, whether the workpiece touches its bearing from
        then on, and whether the tool is out of the cut (m, 3).
    """
    lathe, blocks, contacts = run.config.lathe(), [], []
    for here, stop in itertools.pairwise(sorted({*run.cuts, *run.knocks, plan.samples})):
        lathe.retune(run.cuts.get(here, lathe.cut))
        if here in run.knocks:
            lathe.knock(run.knocks[here])
        contacts.append((lathe.time, lathe.bearing_engaged, not lathe.tool_in_cut))
        blocks.append(lathe.advance(stop - here))
        for time, kind in lathe.events:
            _, bears, out = contacts[-1]
            contacts.append((time, _ON_BEARING.get(kind, bears), _OUT_OF_CUT.get(kind, out)))
    samples = dict(zip(lathe.columns, np.concatenate(blocks).T, strict=True))
    return samples, np.array([*contacts, (plan.duration + 1.0, False, False)])
