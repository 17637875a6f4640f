"""How often a detector is wrong, how late it is, and what the limit is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from recording import Traces
from rivals import HOP
from scenarios import MACHINE, Case
from scipy.stats import beta, chi2
from simulator import RATE

from lathe_chatter.array_types import Array
from lathe_chatter.stability import rightmost_root

DEAD = 1.0
"""s in which one false alarm counts once."""


def alarms(score: Array, threshold: float, begin: float) -> Array:
    """Times of alarms, s; one that goes on or returns within a second counts once."""
    times = (np.flatnonzero(score >= threshold) + 1) * HOP / RATE
    times = times[times > begin]
    new = np.diff(times, prepend=-np.inf) > DEAD
    result: Array = times[new]
    return result


def rate(stable: Sequence[Traces], name: str, threshold: float) -> tuple[int, float]:
    """False alarms, and hours watched."""
    count, hours = 0, 0.0
    for traces in stable:
        score = traces.scores[name]
        count += len(alarms(score, threshold, traces.case.begin))
        hours += (len(score) * HOP / RATE - traces.case.begin) / 3600.0
    return count, hours


def threshold_for(stable: Sequence[Traces], name: str, asked: float) -> float:
    """The lowest threshold with no more than `asked` false alarms an hour."""
    low, high = 0.0, max(float(t.scores[name].max()) for t in stable) * (1.0 + 1e-9)
    for _ in range(40):
        middle = 0.5 * (low + high)
        count, hours = rate(stable, name, middle)
        low, high = (middle, high) if count > asked * hours else (low, middle)
    return high


def confidence(count: int, hours: float) -> tuple[float, float]:
    """95 % limits of a Poisson rate."""
    low = 0.5 * chi2.ppf(0.025, 2 * count) if count else 0.0
    return low / hours, 0.5 * chi2.ppf(0.975, 2 * count + 2) / hours


def share_limits(count: int, events: int) -> tuple[float, float]:
    """95 % limits of a share by Clopper and Pearson."""
    low = beta.ppf(0.025, count, events - count + 1) if count else 0.0
    high = beta.ppf(0.975, count + 1, events - count) if count < events else 1.0
    return float(low), float(high)


def delays(onsets: Sequence[Traces], name: str, threshold: float) -> Array:
    """Delay of each onset, s; infinite where it is missed."""
    found = []
    for traces in onsets:
        onset = traces.case.onset or 0.0
        times = (np.flatnonzero(traces.scores[name] >= threshold) + 1) * HOP / RATE
        late = times[times > onset + 1e-9]
        found.append(late[0] - onset if late.size else np.inf)
    return np.array(found)


def turns(onsets: Sequence[Traces]) -> Array:
    """Spindle speeds, rev/s."""
    return np.array([traces.case.plan[-1].rpm / 60.0 for traces in onsets])


def quantiles(values: Array) -> tuple[float, float]:
    """Median and 95 %, of values that may be infinite."""
    ordered = np.sort(values)
    return float(np.median(ordered)), float(ordered[int(0.95 * len(ordered))])


def rates_of(case: Case) -> tuple[float, float]:
    """Growth rate before and after the onset, 1/s."""
    before, after = (
        rightmost_root(MACHINE, s.rpm, s.depth, seated=s.seated).real for s in case.plan
    )
    return before, after


def limit_formula(before: float, after: float, alarm_rate: float) -> float:
    """Mean delay of a CUSUM that knows everything, by detection.md's formula, s."""
    d0 = (after - before) ** 2 / (2.0 * abs(before))
    h = np.log(d0 / alarm_rate)
    gained = 4.0 * after**2 * abs(before) * h / (after - before) ** 3
    return float(np.log1p(gained) / (2.0 * after))


def informed_cusum(
    before: float, after: float, alarm_rate: float, rng: np.random.Generator
) -> float:
    """Delay of one run of that CUSUM on the complex amplitude itself, s.

    dA = s A dt + dW with E|dW|^2 = 2 dt; it sees A exactly, without noise of a sensor.
    """
    step = 5e-4
    d0 = (after - before) ** 2 / (2.0 * abs(before))
    h = np.log(d0 / alarm_rate)
    root, half = np.sqrt(step), 0.5 * (after**2 - before**2)
    amplitude = complex(*rng.standard_normal(2)) * np.sqrt(0.5 / abs(before))
    total, now, kicks = 0.0, -1.0, rng.standard_normal((16000, 2)) * root
    for kick in kicks:
        s = after if now >= 0.0 else before
        change = s * amplitude * step + complex(kick[0], kick[1])
        gain = (after - before) * (amplitude.conjugate() * change).real
        total = max(0.0, total + gain - half * abs(amplitude) ** 2 * step)
        amplitude += change
        now += step
        if total > h:
            if now >= 0.0:
                return float(now)
            total = 0.0
    return np.inf
