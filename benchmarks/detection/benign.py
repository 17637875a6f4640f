"""What is no onset: events that only look like chatter, a late start, advice, and the CPU."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from statistics import median
from typing import Any

import numpy as np
import scenarios
from advice import advice_figures
from delays import quantiles, share_limits, threshold_for
from onsets import ASKED, CALIBRATION
from recording import DETECTOR, Traces, run
from rivals import HOP, RIVALS
from scenarios import MACHINE, NOISES, STATES, Case
from simulator import COLUMNS, RATE, Stretch, Surroundings, simulate

from lathe_chatter.array_types import Array
from lathe_chatter.detection import ChatterDetector
from lathe_chatter.executors import spread
from lathe_chatter.model import Machine
from lathe_chatter.stability import rightmost_root


def check(_options: Any) -> list[str]:
    """The simulator against the roots."""
    worst = 0.0
    quiet = Surroundings(0.0, 0.0, 0.0, 0.0, (), ())
    for rpm, seated in STATES:
        for depth in (0.4e-3, 0.8e-3):
            plan = (Stretch(3.5, rpm, depth, seated, knock=1e-4),)
            samples = simulate(plan, quiet, 0)[5000:33000:10]
            relative = samples[:, 2] - samples[:, 3]
            lags = np.column_stack((relative[1:-1], relative[:-2]))
            a, b = np.linalg.lstsq(lags, relative[2:], rcond=None)[0]
            root = np.log(np.roots([1.0, -a, -b])[0]) * RATE / 10.0
            worst = max(
                worst, abs(root.real - rightmost_root(MACHINE, rpm, depth, seated=seated).real)
            )
    return [f'simulator: largest error of the growth rate {worst:.3f} 1/s']


def benign(options: Any) -> list[str]:
    """What only looks like chatter: share of events with an alarm within 2 s."""
    number = options.onsets or (8 if options.quick else 200)
    minutes = round(60.0 * (options.hours or (0.1 if options.quick else 1.0)))
    lines = ['events without chatter that raise an alarm (rivals at their S1 threshold)']
    calm = run(
        [scenarios.stable('S1', CALIBRATION + k) for k in range(max(4, minutes))],
        'S1 stable',
        options.executor,
    )
    limits = {name: threshold_for(calm, name, ASKED) for name in RIVALS} | {DETECTOR: 1.0}
    kinds: dict[str, tuple[Callable[[int], Case], int]] = {
        'stable-to-stable steps (S3)': (
            lambda k: scenarios.steps('S3', k + 500),
            number // 10 + 1,
        ),
        'ramps through a resonance': (scenarios.ramp, number),
        'forced resonance': (scenarios.forced, number),
        'knocks that die out': (scenarios.knocks, number // 5 + 1),
        'contact changes, stable both ways': (scenarios.contact, number // 4 + 1),
    }
    for label, (make, repeats) in kinds.items():
        found = run([make(k) for k in range(repeats)], label, options.executor)
        events = sum(len(traces.case.events) for traces in found)
        shares = []
        for name, threshold in limits.items():
            wrong = sum(_wrong(traces, name, threshold) for traces in found)
            least, most = share_limits(wrong, events)
            shares.append(
                f'{name} {100.0 * wrong / events:.1f} ({100.0 * least:.1f}-{100.0 * most:.1f}) %'
            )
        lines.append(f'  {label:34s} {events} events: ' + ', '.join(reversed(shares)))
        if label.startswith('forced'):
            told = np.mean([traces.states[-1] == 'forced' for traces in found])
            lines.append(f'  {"":34s} told as forced: {100.0 * told:.0f} %')
    return lines


def _wrong(traces: Traces, name: str, threshold: float) -> int:
    """Events of a recording that are followed by an alarm before the next one."""
    times = (np.flatnonzero(traces.scores[name] >= threshold) + 1) * HOP / RATE
    marks = np.append(traces.case.events, np.inf)
    hit, _ = np.histogram(times, [*marks[:-1].tolist(), 1e9])
    return int((hit > 0).sum())


def limit_cycle(case: Case) -> float:
    """When a detector that is switched on in saturated chatter says so, s; and it stays."""
    samples = simulate(case.plan, case.around, case.seed)[round(case.skipped * RATE) :]
    detector, first = ChatterDetector(), np.inf
    for start in range(0, len(samples) - HOP + 1, HOP):
        estimate = detector.update(samples[start : start + HOP], COLUMNS)
        if estimate.chatter and np.isinf(first):
            first = estimate.time - samples[0, 0]
    return first if estimate.chatter else np.inf


def limit(options: Any) -> list[str]:
    """The monitor started late."""
    cases = [scenarios.saturated(k) for k in range(4 if options.quick else 40)]
    found = np.array(spread(limit_cycle, cases, executor=options.executor))
    half, most = quantiles(found)
    said = f'said after {1e3 * half:.0f} / {1e3 * most:.0f} ms, {int(np.isinf(found).sum())} not'
    return [f'switched on in saturated chatter: {len(cases)} cases, {said}']


def advice(options: Any) -> list[str]:
    """Recommended speeds."""
    return advice_figures(16 if options.quick else 200, options.executor)


def _spent(samples: Array, size: int, machine: Machine | None = MACHINE) -> float:
    """CPU time for all but the first second, s."""
    detector = ChatterDetector(machine)
    detector.update(samples[:10000], COLUMNS)
    begin = time.process_time()
    for start in range(10000, len(samples), size):
        detector.update(samples[start : start + size], COLUMNS)
    return time.process_time() - begin


def cpu(options: Any) -> list[str]:
    """What the detector takes, in batches of 0.1 s, as the node takes them, and one by one.

    The node lets samples come in for 40 ms, and for 10 ms while the vibration grows.
    """
    seconds = 3.0 if options.quick else 20.0
    stable = simulate((Stretch(seconds + 1.0, 3000.0, 0.4e-3),), NOISES['S1'], 0)
    loud = (Stretch(2.0, 3000.0, 0.4e-3), Stretch(seconds - 1.0, 3000.0, 1.1e-3))
    amid = simulate(loud, NOISES['S3'], 0)
    lines = []
    for label, samples in (('a stable cut', stable), ('chatter', amid)):
        for machine in (MACHINE, None):
            for size in (1000, 400, 100, 20):
                spent = median(_spent(samples, size, machine) for _ in range(5)) / seconds
                told = 'told' if machine is not None else 'not told'
                lines.append(
                    f'CPU, {label}, machine {told}, batches of {size:4d} samples: '
                    f'{1e3 * spent:.2f} ms a simulated second (median of 5)'
                )
    return [*lines, _advice_time(amid)]


def _advice_time(samples: Array) -> str:
    """What an answer takes when it is asked for."""
    detector, requests = ChatterDetector(), []
    for start in range(0, len(samples), HOP):
        request = detector.update(samples[start : start + HOP], COLUMNS).request
        if request is not None and request not in requests:
            requests.append(request)
    spent = []
    for request in requests:
        for _ in range(5):
            again = replace(request)
            begin = time.process_time()
            _ = again.answer
            spent.append(time.process_time() - begin)
    middle, most = 1e3 * np.median(spent), 1e3 * np.max(spent)
    return f'CPU, advice, each time it is asked for: {middle:.1f} ms, {most:.1f} ms at most'
