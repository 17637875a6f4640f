"""How often a detector is wrong, how late it is, and what the limit is."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from recording import Traces
from rivals import HOP
from scenarios import MACHINE, Case
from scipy.stats import beta, chi2
from simulator import RATE

from lathe_chatter.array_types import Array
from lathe_chatter.compiled import compiled
from lathe_chatter.stability import rightmost_root

DEAD = 1.0
"""s in which one false alarm counts once."""
_CUSUM_STEP, _LOW_LIMIT, _CALIBRATED = 1e-3, 5.0, 1000.0
"""s from look to look of the CUSUM that knows everything; the limit at which its false alarms are
counted, and for how many s, to know which limit has as few as are asked for."""


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


def _taken(case: Case) -> float:
    """What the vibration that grows takes of an impulse on the tool, m/(N s)."""
    last, machine = case.plan[-1], MACHINE
    root = rightmost_root(machine, last.rpm, last.depth, seated=last.seated)
    stiffness = machine.workpiece_stiffness(seated=last.seated)

    def bodies(s: complex) -> tuple[complex, complex]:
        tool = (machine.tool.mass * s + machine.tool.damping) * s + machine.tool.stiffness
        return tool, (machine.workpiece.mass * s + machine.workpiece.damping) * s + stiffness

    def whole(s: complex) -> complex:
        tool, workpiece = bodies(s)
        shift = 1.0 - np.exp(-s * 60.0 / last.rpm)
        cutting = machine.cutting_stiffness(last.depth)
        return tool * workpiece + cutting * shift * (tool + workpiece)

    slope = (whole(root + 1e-3) - whole(root - 1e-3)) / 2e-3
    return float(abs(bodies(root)[1] / slope))


@compiled()
def _cusum(normal: Array, growth: Array, blur: float, step: float, limit: float) -> Array:
    """Times of alarms, s, of the likelihood ratio of two Kalman filters, by steps.

    dA = s A dt + dW, E|dW|^2 = 2 dt, is seen in noise whose mean over dt has the power blur / dt.

    Args:
        normal: Random numbers (n, 4).
        growth: Rate in each step (n,); the first is that of the stable cut, the last the other.
        blur: As above.
        step: s.
        limit: Of the sum.
    """
    times = np.full(normal.shape[0], np.nan)
    before, after = growth[0], growth[-1]
    kick, spread = math.sqrt(step), blur / step
    root = math.sqrt(0.5 * spread)
    calm, wild = math.exp(before * step), math.exp(after * step)
    a = complex(normal[0, 0], normal[0, 1]) * math.sqrt(0.5 / abs(before))
    low = high = 0j
    low_power = high_power = 1.0 / abs(before)
    total, found = 0.0, 0
    for n in range(normal.shape[0]):
        a = a * (wild if growth[n] == after else calm)
        a += kick * complex(normal[n, 0], normal[n, 1])
        seen = a + root * complex(normal[n, 2], normal[n, 3])
        if total <= 0.0:  # as if it began now
            total, high, high_power = 0.0, low, low_power
        low, low_power = low * calm, low_power * calm**2 + 2.0 * step
        high, high_power = high * wild, high_power * wild**2 + 2.0 * step
        of_low, of_high = low_power + spread, high_power + spread
        total += abs(seen - low) ** 2 / of_low - abs(seen - high) ** 2 / of_high
        total += math.log(of_low / of_high)
        low = low + low_power / of_low * (seen - low)
        low_power = low_power * spread / of_low
        high = high + high_power / of_high * (seen - high)
        high_power = high_power * spread / of_high
        if total > limit:
            times[found] = (n + 1) * step
            found, total = found + 1, 0.0
    return times[:found]


def informed_cusum(case: Case, alarm_rate: float, rng: np.random.Generator) -> float:
    """Delay of one run of a CUSUM that knows both cuts and all noise, s.

    It sees the motion of the tool against the workpiece in the noise of the sensors. Its limit is
    that of `alarm_rate` in the stable cut, by the alarms that a lower one raises there.
    """
    before, after = rates_of(case)
    # The amplitude of a real signal has twice what the signal has of the force, and four times the
    # noise, which is that of two sensors.
    pushed = (2.0 * _taken(case)) ** 2 * case.around.force_noise
    blur = 8.0 * case.around.sensor_noise**2 / RATE * 2.0 / pushed
    quiet = rng.standard_normal((round(_CALIBRATED / _CUSUM_STEP), 4))
    growth = np.full(len(quiet), before)
    growth[-1] = after
    seen = len(_cusum(quiet, growth, blur, _CUSUM_STEP, _LOW_LIMIT))
    limit = _LOW_LIMIT + np.log(max(seen, 1) / _CALIBRATED / alarm_rate)
    count, settled = round(8.0 / _CUSUM_STEP), round(1.0 / _CUSUM_STEP)
    growth = np.where(np.arange(count) < settled, before, after)
    times = _cusum(rng.standard_normal((count, 4)), growth, blur, _CUSUM_STEP, limit) - 1.0
    late = times[times > 0.0]
    return float(late[0]) if late.size else np.inf
