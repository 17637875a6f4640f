"""Windows of simulated cuts, each with its truth."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from lathe_chatter.arrays import Array
from lathe_chatter.dataset.drawing import DrawnMachine, DrawnRun, drawn_run
from lathe_chatter.dataset.plan import CUT, Plan
from lathe_chatter.lathe import EventKind
from lathe_chatter.lathe.config import LatheConfig
from lathe_chatter.samples import sample_columns
from lathe_chatter.stability.characteristic import Complex
from lathe_chatter.stability.operating_points import operating_points

TRUTH = {
    'growth_rate': ('1/s', 'of the rightmost root of the cut at the end of the window'),
    'frequency': ('Hz', 'of that root'),
    'stable': ('', 'whether small disturbances of that cut die out'),
    'regime': ('', 'free, seated or rattling: whether the workpiece touches its bearing'),
    'share_out_of_cut': ('', 'of the window, in which the tool is out of the cut'),
    'share_on_bearing': ('', 'of the window, in which the workpiece touches its bearing'),
    'seconds_since_onset': ('s', 'since when, at the end, the cut has been unstable; nan: stable'),
}
"""The columns of the truth, with units and meanings."""
PLACE = {
    'machine': ('', 'number of the machine'),
    'run': ('', 'number of the run of that machine'),
    'seed': ('', 'of the noise of that run'),
    'start': ('s', 'simulated time at which the window begins'),
}
Table = dict[str, Array]
"""Columns of windows: (n,), and (n, samples) where they are signals."""


def windows_of(plan: Plan, machines: Iterable[DrawnMachine]) -> tuple[Table, list[DrawnRun]]:
    """The windows of some machines, and the runs that they are cut from."""
    runs = [drawn_run(plan, each, number) for each in machines for number in range(plan.runs)]
    pairs = [(run.setup, cut) for run in runs for cut in run.cuts.values()]
    points = operating_points(
        [setup.machine for setup, _ in pairs],
        [cut for _, cut in pairs],
        tool_leaves_cut=[setup.tool_leaves_cut for setup, _ in pairs],
    )
    bounds = itertools.pairwise(itertools.accumulate([0, *(len(run.cuts) for run in runs)]))
    tables = [
        _windows(plan, run, points.root[slice(*here)], points.stable[slice(*here)])
        for run, here in zip(runs, bounds, strict=True)
    ]
    return {name: np.concatenate([t[name] for t in tables]) for name in tables[0]}, runs


def _windows(plan: Plan, run: DrawnRun, roots: Complex, stable: NDArray[np.bool_]) -> Table:
    """The windows of a run, with the truth of each of its cuts."""
    samples, contacts = _simulated(plan, run)
    starts = np.array([s for s in plan.starts if s + plan.length <= len(samples)], np.int64)
    names = sample_columns(accelerometers=run.setup.accelerometers)
    signals = {
        name: samples[starts[:, None] + np.arange(plan.length), names.index(name)].astype('f4')
        for name in plan.columns
    }
    changes, ends = np.array([*run.cuts]), starts + plan.length
    now = np.searchsorted(changes, ends - 1, side='right') - 1
    # The change that made it unstable: the first after the last stable cut.
    calm = np.maximum.accumulate(np.where(stable, np.arange(len(stable)), -1))
    onset = np.where(stable, np.nan, changes[np.minimum(calm + 1, len(changes) - 1)])
    rate = plan.sample_rate
    on_bearing, out_of_cut = _shares(contacts, starts / rate, ends / rate)
    regimes = np.array(['free', 'rattling', 'seated'])
    facts = (
        *(run.machine, run.number, run.setup.seed, starts / rate),
        *(roots.real[now], roots.imag[now] / (2.0 * np.pi), stable[now]),
        *(regimes[(on_bearing > 0.0).astype(int) + (on_bearing >= 1.0)], out_of_cut, on_bearing),
        (ends - onset[now]) / rate,
    )
    told = {n: np.resize(v, len(starts)) for n, v in zip((*PLACE, *TRUTH), facts, strict=True)}
    return {**told, **signals, **{name: _values(run, name)[now] for name in plan.drawn}}


def _values(run: DrawnRun, name: str) -> Array:
    """A parameter at each cut of a run (cuts,)."""
    owner = run.setup if name in vars(run.setup) else run.setup.machine
    found = [attrgetter(name)(cut if name in CUT else owner) for cut in run.cuts.values()]
    return np.array([getattr(value, 'value', value) for value in found])


def _simulated(plan: Plan, run: DrawnRun) -> tuple[Array, Array]:
    """The samples of a run, and its contacts.

    Returns:
        Samples (n, columns), and rows of time, s, whether the workpiece touches its bearing from
        then on, and whether the tool is out of the cut (m, 3).
    """
    lathe, blocks, contacts = LatheConfig(run.setup, run.cuts[0]).lathe(), [], []
    inside = {k for k in (*run.cuts, *run.knocks) if k < plan.samples}
    for here, stop in itertools.pairwise(sorted({0, *inside, plan.samples})):
        lathe.retune(run.cuts.get(here, lathe.cut))
        if here in run.knocks:
            lathe.knock(run.knocks[here])
        now = {'touches': lathe.bearing_engaged, 'out': not lathe.tool_in_cut}
        contacts.append((lathe.time, *now.values()))
        blocks.append(lathe.advance(stop - here))
        for time, kind in lathe.events:
            name, value = _AFTER[kind]
            now[name] = value
            contacts.append((time, *now.values()))
    return np.concatenate(blocks), np.array([*contacts, (plan.duration + 1.0, False, False)])


_AFTER = {
    EventKind.BEARING_ENGAGES: ('touches', True),
    EventKind.BEARING_RELEASES: ('touches', False),
    EventKind.TOOL_LEAVES_CUT: ('out', True),
    EventKind.TOOL_ENTERS_CUT: ('out', False),
}


def _shares(contacts: Array, begins: Array, ends: Array) -> Iterator[Array]:
    """The shares of some intervals, s, spent on the bearing and out of the cut."""
    times, lasted = contacts[:, 0], np.diff(contacts[:, 0])
    for states in contacts[:-1, 1:].T:
        total = np.concatenate(([0.0], np.cumsum(lasted * states)))
        spent = np.interp(ends, times, total) - np.interp(begins, times, total)
        whole = np.interp(ends, times, times) - np.interp(begins, times, times)
        yield np.where(np.isclose(spent, whole, 1e-9, 0.0), 1.0, np.maximum(spent / whole, 0.0))
