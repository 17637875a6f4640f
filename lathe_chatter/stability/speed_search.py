"""Which spindle speed to change to, or which depth, so that a cut is stable.

At one depth the roots cross the imaginary axis at few frequencies, each at a series of delays. A
machine without delay is stable, so counting which way the roots cross on the way from tau = 0
gives every stable interval of speed exactly, without a scan.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.errors import ParameterError
from lathe_chatter.model import Machine
from lathe_chatter.model.quantity_fields import Quantity
from lathe_chatter.stability.axis_crossings import axis_crossings
from lathe_chatter.stability.characteristic import (
    LEAST_DAMPING,
    NO_DAMPING,
    Complex,
    ProcessDamping,
    checked,
    sections_of,
)
from lathe_chatter.stability.compiled_characteristic import STIFFNESS
from lathe_chatter.stability.critical_depth import critical_depth
from lathe_chatter.stability.roots import rightmost_roots

_SAMPLES = 9
_ZOOMS = 2
_INTERVALS = 8
"""Intervals looked into, widest first: those of the highest lobes are slivers."""
_HALVINGS = 14
_COUNT = Quantity('number of recommended speeds', low=1.0, high=1000.0)
_MARGIN = Quantity('relative distance from an edge of stability', high=0.5)


@dataclass(frozen=True)
class SpeedAdvice:
    """A stable spindle speed.

    Attributes:
        spindle_speed_rpm: rev/min.
        growth_rate: Real part of the rightmost root there, negative, 1/s.
        angular_frequency: Of the slowest decaying vibration, rad/s.
        low_rpm: Where the stable interval around the speed begins, rev/min.
        high_rpm: Where it ends, rev/min.
    """

    spindle_speed_rpm: float
    growth_rate: float
    angular_frequency: float
    low_rpm: float
    high_rpm: float


@dataclass(frozen=True)
class CuttingAdvice:
    """What to do about chatter.

    Attributes:
        speeds: Stable speeds at the present depth, the best damped first; empty if none is.
        stable_depth: A depth, not above the present one, that is stable at `stable_speed_rpm`:
            the present depth where `speeds` is not empty, m.
        stable_speed_rpm: The speed that goes with it, rev/min. Where `speeds` is empty, any in
            `stable_range_rpm` does: equally deep lobes are one answer, not one speed.
        depth_at_current_speed: The critical depth at the present speed, m; None where no
            present speed was given.
        stable_range_rpm: Where `speeds` is empty, from where to where `stable_depth` is stable
            around `stable_speed_rpm`, rev/min.
    """

    speeds: tuple[SpeedAdvice, ...]
    stable_depth: float
    stable_speed_rpm: float
    depth_at_current_speed: float | None
    stable_range_rpm: tuple[float, float] | None = None


def recommend_speeds(  # noqa: PLR0913 -- a cut, a range and how careful to be
    machine: Machine,
    depth_of_cut: float,
    *,
    seated: bool,
    process: ProcessDamping = NO_DAMPING,
    low_rpm: float = 1000.0,
    high_rpm: float = 12000.0,
    current_rpm: float | None = None,
    count: int = 3,
    margin: float = 0.02,
) -> CuttingAdvice:
    """The best damped spindle speeds at a depth, one for each stable interval of speed.

    Args:
        machine: Tool, workpiece, bearing and material, given or identified.
        depth_of_cut: w, m.
        seated: Whether the workpiece rests on its bearing.
        process: Process damping.
        low_rpm: Slowest speed to consider, rev/min.
        high_rpm: Fastest speed to consider, rev/min.
        current_rpm: The present speed, for `CuttingAdvice.depth_at_current_speed`; the stable
            interval nearest to it is always considered.
        count: How many speeds at most.
        margin: How far a speed stays from the edges of its interval, as a fraction of the
            speed; half of the interval where it is too narrow for that.

    Returns:
        The speeds, or the depth to fall back to where there is none.

    Raises:
        ParameterError: If an argument is not allowed or the range of speeds is empty.
    """
    at_most = int(_COUNT.check('count', count))
    apart = _MARGIN.check('margin', margin)
    depth = float(checked('depth_of_cut', depth_of_cut))
    present = None
    if current_rpm is not None:
        present = float(checked('spindle_speed_rpm', current_rpm))
    search = _Search(machine, seated, process)
    slow, fast = _range(low_rpm, high_rpm)
    intervals = search.stable_intervals(depth, slow, fast)
    here = None
    if present is not None:
        here = critical_depth(machine, present, seated=seated, process=process)
    if intervals.size:
        considered = _worth_a_look(intervals, present)
        speeds = search.best_speeds(depth, considered, apart)
        speeds = sorted(speeds, key=lambda advice: advice.growth_rate)[:at_most]
        return CuttingAdvice(tuple(speeds), depth, speeds[0].spindle_speed_rpm, here)
    shallower, low, high = search.deepest_stable(depth, slow, fast)
    rpm = float(np.sqrt(low * high))
    return CuttingAdvice((), shallower, rpm, here, (low, high))


def stable_speed_intervals(  # noqa: PLR0913 -- a cut and a range
    machine: Machine,
    depth_of_cut: float,
    *,
    seated: bool,
    process: ProcessDamping = NO_DAMPING,
    low_rpm: float,
    high_rpm: float,
) -> Array:
    """Every interval of spindle speed in which a cut of this depth is stable.

    Args:
        machine: Tool, workpiece, bearing and material.
        depth_of_cut: w, m.
        seated: Whether the workpiece rests on its bearing.
        process: Process damping.
        low_rpm: Where to begin, rev/min.
        high_rpm: Where to end, rev/min.

    Returns:
        Lower and upper ends (n, 2), rev/min, rising.

    Raises:
        ParameterError: If an argument is not allowed or the range of speeds is empty.
    """
    slow, fast = _range(low_rpm, high_rpm)
    depth = float(checked('depth_of_cut', depth_of_cut))
    return _Search(machine, seated, process).stable_intervals(depth, slow, fast)


def _range(low_rpm: float, high_rpm: float) -> tuple[float, float]:
    """A range of speeds, rev/min.

    Raises:
        ParameterError: If it is none.
    """
    slow = float(checked('spindle_speed_rpm', low_rpm))
    fast = float(checked('spindle_speed_rpm', high_rpm))
    if not slow < fast:
        raise ParameterError(
            'high_rpm', high_rpm, 'rev/min', f'above low_rpm, {low_rpm:g} rev/min'
        )
    return slow, fast


def _worth_a_look(intervals: Array, present: float | None) -> Array:
    """The relatively widest intervals, and the one nearest to the present speed."""
    width = np.log(intervals[:, 1] / intervals[:, 0])
    chosen = set(np.argsort(-width)[:_INTERVALS].tolist())
    if present is not None:
        outside = np.maximum(intervals[:, 0] - present, present - intervals[:, 1])
        chosen.add(int(np.argmin(outside)))
    return intervals[sorted(chosen)]


class _Search(NamedTuple):
    """A machine whose stable speeds are looked for."""

    machine: Machine
    seated: bool
    process: ProcessDamping

    def stable_intervals(self, depth: float, slow: float, fast: float) -> Array:
        """`stable_speed_intervals`."""
        longest = 60.0 / slow
        sections = sections_of(self.machine, seated=self.seated, least_damping=LEAST_DAMPING)
        stiffness = self.machine.cutting_stiffness(depth)
        per_delay = self.process.per_width_and_delay * depth
        crossings = axis_crossings(sections, stiffness, per_delay, longest)
        delay = np.concatenate((np.zeros(1), crossings.delay))
        way = np.concatenate((np.zeros(1, np.int64), crossings.outward))
        order = np.argsort(delay, kind='stable')
        unstable = np.cumsum(way[order])
        following = np.append(delay[order], longest)
        stable = np.flatnonzero(unstable == 0)
        ends = np.array([following[stable + 1], following[stable]]).T
        with np.errstate(divide='ignore'):
            speeds = np.clip(60.0 / ends, slow, fast)[::-1]
        intervals: Array = speeds[speeds[:, 1] > speeds[:, 0]]
        return intervals

    def best_speeds(self, depth: float, intervals: Array, margin: float) -> list[SpeedAdvice]:
        """The best damped speed of each interval (n, 2), by a scan and two finer ones."""
        low, high = intervals[:, 0], intervals[:, 1]
        # A range limit is no edge of stability, but to stay as far from it costs little.
        inset = np.minimum(margin * np.sqrt(low * high), 0.25 * (high - low))
        shortest, longest = 60.0 / (high - inset), 60.0 / (low + inset)
        # One piece for each lobe that an interval spans: each may hold a best speed.
        sections = sections_of(self.machine, seated=self.seated)
        turn = 2.0 * np.pi / np.sqrt(sections[:, STIFFNESS].max())
        pieces = np.ceil((longest - shortest) / turn).astype(np.int64)
        owner = np.repeat(np.arange(pieces.size), pieces)
        place = np.arange(owner.size) - np.repeat(np.cumsum(pieces) - pieces, pieces)
        length = ((longest - shortest) / pieces)[owner]
        start = shortest[owner] + place * length
        scan = self._scan(depth, start, start + length)
        order = np.argsort(-scan.roots.real, kind='stable')
        best = np.zeros(pieces.size, np.int64)
        best[owner[order]] = order
        scan = _Scan(scan.delays[best], scan.roots[best], scan.shorter[best], scan.longer[best])
        for _ in range(_ZOOMS):
            scan = self._scan(depth, scan.shorter, scan.longer)
        speeds = 60.0 / scan.delays
        roots = rightmost_roots(
            self.machine, speeds, depth, seated=self.seated, process=self.process
        )
        return [
            SpeedAdvice(rpm, root.real, root.imag, slow, fast)
            for rpm, root, slow, fast in zip(
                speeds.tolist(), roots.tolist(), low.tolist(), high.tolist(), strict=True
            )
        ]

    def _scan(self, depth: float, start: Array, end: Array) -> _Scan:
        """Look for the best damped delay in each of n intervals."""
        delay = start[:, None] + (end - start)[:, None] * np.linspace(0.0, 1.0, _SAMPLES)
        roots = rightmost_roots(
            self.machine, 60.0 / delay, depth, seated=self.seated, process=self.process,
            proven=False,
        )  # fmt: skip
        best = np.argmin(roots.real, axis=1)
        rows = np.arange(best.size)
        return _Scan(
            delay[rows, best],
            roots[rows, best],
            delay[rows, np.maximum(best - 1, 0)],
            delay[rows, np.minimum(best + 1, _SAMPLES - 1)],
        )

    def deepest_stable(self, depth: float, low: float, high: float) -> tuple[float, float, float]:
        """The deepest cut, to 1e-4 of it, below an unstable depth that some speed keeps stable.

        Returns:
            The depth, m, and the widest range of speeds in which it is, rev/min.
        """
        stable, unstable, speeds = 0.0, depth, (low, high)
        for _ in range(_HALVINGS):
            middle = 0.5 * (stable + unstable)
            found = self.stable_intervals(middle, low, high)
            if found.size:
                widest = found[np.argmax(found[:, 1] / found[:, 0])]
                stable, speeds = middle, (float(widest[0]), float(widest[1]))
            else:
                unstable = middle
        return stable, *speeds


class _Scan(NamedTuple):
    """The best of some evenly spaced delays (n,), its root, and its neighbours."""

    delays: Array
    roots: Complex
    shorter: Array
    longer: Array
