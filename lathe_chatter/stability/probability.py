"""How probable it is that a cut is stable, on a machine that is known with errors.

Machines are drawn as the truth may be (`Uncertainty.draw`), and each has its own safe limit; the
probability at a depth is the share of the machines whose limit lies above it. With 1000 machines
that share is itself known to about 0.5 % where it is 95 %.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from lathe_chatter.array_types import Array, ShortRepr
from lathe_chatter.model import Cut, Machine
from lathe_chatter.model.quantity_fields import Quantity, count_of
from lathe_chatter.model.uncertainty import Uncertainty
from lathe_chatter.resumable_results import spread_into
from lathe_chatter.stability.characteristic import checked
from lathe_chatter.stability.safe_limit import safe_limit

_SHARE = Quantity('probability', low=0.0, high=1.0)


@dataclass(frozen=True, repr=False)
class StabilityProbability(ShortRepr):
    """The limits of many machines that the truth may be.

    Attributes:
        spindle_speed_rpm: rev/min (m,).
        limits: Safe depth of each machine at each speed, m (n, m), ascending along the first.
        names: Of the uncertain figures.
        shares: Of the variance of the logarithm of the limit, what each figure is the cause of,
            at each speed (m, number of names); what is left belongs to figures together.
    """

    spindle_speed_rpm: Array
    limits: Array = field(repr=False)
    names: tuple[str, ...] = ()
    shares: Array = field(default_factory=lambda: np.zeros((0, 0)), repr=False)

    def safe_depth(self, probability: float = 0.95) -> Array:
        """The depth that is stable with some probability at each speed, m (m,).

        Raises:
            ParameterError: If the probability is none.
        """
        share = _SHARE.check('probability', probability)
        # Of n limits in order the k-th is exceeded by the next with 1 - k/(n + 1).
        below = int((1.0 - share) * (len(self.limits) + 1)) - 1
        return np.asarray(self.limits[min(max(below, 0), len(self.limits) - 1)])

    def at(self, depth_of_cut: ArrayLike) -> Array:
        """The probability that a cut of some depths is stable (len(depth_of_cut), m)."""
        depths = np.atleast_1d(np.asarray(depth_of_cut, float))
        found = [np.searchsorted(column, depths, side='right') for column in self.limits.T]
        return 1.0 - np.array(found).T / len(self.limits)

    def worth_repeating(self, spindle_speed_rpm: float) -> list[tuple[str, float]]:
        """The figures that make the limit uncertain at a speed, the worst first, with shares."""
        place = int(np.argmin(np.abs(self.spindle_speed_rpm - spindle_speed_rpm)))
        pairs = zip(self.names, self.shares[place].tolist(), strict=True)
        return sorted(pairs, key=lambda pair: -pair[1])


def stability_probability(  # noqa: PLR0913 -- what is cut, how sure that is, and how often drawn
    machine: Machine,
    uncertainty: Uncertainty,
    cut: Cut,
    spindle_speed_rpm: ArrayLike,
    *,
    machines: int = 1000,
    seed: int = 0,
    tool_leaves_cut: bool = True,
    executor: Executor | None = None,
    kept_in: Path | str | None = None,
    progress: Callable[[int], object] = lambda _count: None,
) -> StabilityProbability:
    """Draw machines and find the safe limit of each.

    Args:
        machine: As it is told.
        uncertainty: How well.
        cut: Clearance, contact and feed.
        spindle_speed_rpm: rev/min (m,).
        machines: How many are drawn.
        seed: Of the random numbers: the same seed draws the same machines.
        tool_leaves_cut: See `safe_limit`.
        executor: Where it is computed, see `executors`; by default threads, one a core.
        kept_in: File that keeps what is computed, and is continued where it exists.
        progress: Is told, now and then, how many more machines are known.

    Raises:
        ParameterError: If a speed or a count is not allowed.
        ResultFileError: If the file is of something else, or cannot be written.
    """
    speeds = np.atleast_1d(checked('spindle_speed_rpm', spindle_speed_rpm))
    drawn, deviations = uncertainty.draw(machine, count_of('machines', machines, least=1), seed)
    found = spread_into(
        kept_in,
        {'kind': 'limits of machines', 'cut': repr((machine, cut, tool_leaves_cut))}
        | {'machines': machines, 'seed': seed, 'speeds': speeds.tolist()}
        | {'errors': uncertainty.covariance.tolist()},
        partial(_limits_of, cut, speeds, tool_leaves_cut=tool_leaves_cut),
        drawn,
        executor=executor,
        progress=progress,
    )
    limits = np.array(found)
    return StabilityProbability(
        speeds, np.sort(limits, axis=0), uncertainty.names, _shares(deviations, limits)
    )


def _limits_of(cut: Cut, speeds: Array, machine: Machine, *, tool_leaves_cut: bool) -> list[float]:
    """The safe depths of one machine (m,)."""
    depths = safe_limit(machine, cut, speeds, tool_leaves_cut=tool_leaves_cut).depth_of_cut
    return [float(depth) for depth in depths]


def _shares(deviations: Array, limits: Array) -> Array:
    """Of the variance of ln(limit), the part that a linear dependence on each figure explains.

    Squared correlations with figures made independent of those before them would depend on the
    order; these are the products of regression coefficient and covariance (Pratt), which add up
    to the explained part whatever the correlations.
    """
    with np.errstate(divide='ignore'):
        value = np.log(np.maximum(limits, 1e-300))
    finite = np.isfinite(value).all(axis=1)
    value, x = value[finite], deviations[finite]
    if len(x) <= x.shape[1] + 1:
        return np.zeros((limits.shape[1], deviations.shape[1]))
    value, x = value - value.mean(axis=0), x - x.mean(axis=0)
    slope, *_ = np.linalg.lstsq(x, value, rcond=None)
    variance = np.maximum((value**2).sum(axis=0), 1e-300)
    shares = np.clip((slope * (x.T @ value)) / variance, 0.0, 1.0)
    return np.asarray((shares / np.maximum(shares.sum(axis=0), 1.0)).T)
