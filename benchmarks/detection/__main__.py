"""The figures of the chatter detector: how late, how often wrong, what it knows, what it costs.

    python benchmarks/detection [--quick] [--plot FILE] [--json] [PART ...]

Parts: check onsets benign limit advice cpu (all by default). Thresholds of the rivals, and the
detector's own, belong to one set of seeds (calibration); what is printed is from another.
Delays are counted from the change that makes the cut unstable. --quick is a smoke test.
"""

from __future__ import annotations

import os

# One thread a process: the cores are shared out by the case.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

import argparse
import json
import multiprocessing
import platform
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import scenarios
from advice import advice_figures
from rich.progress import Progress
from rivals import HOP, RIVALS
from scenarios import MACHINE, NOISES, STATES, Case
from scipy.stats import chi2
from simulator import COLUMNS, RATE, Stretch, Surroundings, simulate

from lathe_chatter.detection import ChatterDetector
from lathe_chatter.model import Array
from lathe_chatter.stability import rightmost_root

DETECTOR = 'this detector'
ASKED = 2.0
"""False alarms an hour at which delays are compared."""
DEAD = 1.0
"""s in which one false alarm counts once."""
CALIBRATION, REPORTED = 1_000_000, 0
"""Where the seeds of the two sets begin."""
PARTS = ('check', 'onsets', 'benign', 'limit', 'advice', 'cpu')


class Traces(NamedTuple):
    """What a recording gave.

    Attributes:
        case: What was recorded.
        scores: Of each detector, one value a hop.
        growth: The detector's growth rate, 1/s, a value a hop.
        frequency: Its frequency, Hz.
        states: Its states.
        cpu: What the detector took, s.
    """

    case: Case
    scores: dict[str, Array]
    growth: Array
    frequency: Array
    states: list[str]
    cpu: float


def record(case: Case) -> Traces:
    """Simulate and watch; the detector never alarms, so that every threshold can be tried."""
    samples = simulate(case.plan, case.around, case.seed)
    samples = samples[round(case.skipped * RATE) :]
    detector = ChatterDetector(strictness=np.inf)
    begin = time.process_time()
    estimates = [
        detector.update(samples[start : start + HOP], COLUMNS)
        for start in range(0, len(samples) - HOP + 1, HOP)
    ]
    cpu = time.process_time() - begin
    scores = {name: rival(samples) for name, rival in RIVALS.items()}
    scores[DETECTOR] = np.nan_to_num(np.array([e.score for e in estimates]))
    return Traces(
        case,
        scores,
        np.array([e.growth_rate for e in estimates]),
        np.array([e.frequency for e in estimates]),
        [e.state for e in estimates],
        cpu,
    )


def run(cases: Sequence[Case], label: str, processes: int) -> list[Traces]:
    """Record all cases on all cores."""
    with (
        multiprocessing.Pool(processes) as pool,
        Progress(transient=True, disable=not sys.stderr.isatty()) as progress,
    ):
        bar = progress.add_task(label, total=len(cases))
        found = []
        for traces in pool.imap_unordered(record, cases, chunksize=2):
            found.append(traces)
            progress.advance(bar)
    return sorted(found, key=lambda traces: traces.case.seed)


# -- how often, and how late ---------------------------------------------------------------


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
    return float(ordered[len(ordered) // 2]), float(ordered[int(0.95 * len(ordered))])


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


# -- parts -----------------------------------------------------------------------------------


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


def onsets(options: Any) -> list[str]:
    """S0 to S3: delay, misses, false alarms, beside the limit and the rivals."""
    lines, curves = [], {}
    count, hours = (24, 0.1) if options.quick else (240, 10.5)
    for noise in options.scenarios:
        stepped = noise in {'S0', 'S3'}
        make = scenarios.steps if stepped else scenarios.stable
        watched = max(
            4, round(hours * (600.0 if stepped else 3600.0) / (44.0 if stepped else 60.0))
        )
        calm = {
            name: run(
                [make(noise, seed + k) for k in range(n)], f'{noise} stable', options.processes
            )
            for name, seed, n in (
                ('calibration', CALIBRATION, max(4, watched // 4)),
                ('reported', REPORTED, watched),
            )
        }
        shaken = run(
            [scenarios.onset(noise, REPORTED + k) for k in range(count)],
            f'{noise} onsets',
            options.processes,
        )
        lines += [
            f'{noise}: {count} onsets, {rate(calm["reported"], DETECTOR, 1.0)[1]:.2f} h stable'
        ]
        pace = turns(shaken)
        asked = ASKED
        if stepped:
            asked = 0.01 * 3600.0 / scenarios.STEP
            lines[-1] += f' in steps every {scenarios.STEP:g} s; asked: 1 % false alarms a step'
        pairs = [rates_of(traces.case) for traces in shaken]
        formula = np.array([limit_formula(*pair, asked / 3600.0) for pair in pairs])
        lines.append(_line('  limit, mean delays by the formula', formula, pace, ''))
        if not stepped:
            rng = np.random.default_rng(0)
            informed = np.array([informed_cusum(*pair, asked / 3600.0, rng) for pair in pairs])
            lines.append(_line('  limit, single runs of that CUSUM', informed, pace, ''))
        curves[noise] = {}
        for name in (DETECTOR, *RIVALS):
            threshold = (
                1.0 if name == DETECTOR else threshold_for(calm['calibration'], name, asked)
            )
            number, watched_hours = rate(calm['reported'], name, threshold)
            low, high = confidence(number, watched_hours)
            false = f'{number} false = {number / watched_hours:.2f}/h ({low:.2f}-{high:.2f})'
            if stepped:
                events = sum(len(t.case.events) for t in calm['reported'])
                false = f'{number} false in {events} steps = {100.0 * number / events:.2f} %'
            lines.append(_line(f'  {name}', delays(shaken, name, threshold), pace, false))
            curves[noise][name] = _curve(calm['reported'], shaken, name, pace)
        lines.append('  ' + _estimates(shaken))
    if options.plot:
        _plot(curves, options.plot)
        lines.append(f'delay against false-alarm rate: {options.plot}')
    return lines


def _line(name: str, delay: Array, pace: Array, false: str) -> str:
    half, most = quantiles(delay * pace)
    half_ms, most_ms = (1e3 * value for value in quantiles(delay))
    missed = int(np.isinf(delay).sum())
    return (
        f'{name:36s} {half:6.1f} /{most:6.1f} rev  {half_ms:6.0f} /{most_ms:6.0f} ms  '
        f'missed {missed}  {false}'
    )


def _estimates(onsets_: Sequence[Traces]) -> str:
    """Errors 0.1 s after the alarm."""
    errors = []
    for traces, delay in zip(onsets_, delays(onsets_, DETECTOR, 1.0), strict=True):
        if np.isinf(delay):
            continue
        place = round((traces.case.onset + delay + 0.1) * RATE / HOP) - 1
        if place >= len(traces.growth):
            continue
        last = traces.case.plan[-1]
        root = rightmost_root(MACHINE, last.rpm, last.depth, seated=last.seated)
        errors.append(
            (traces.frequency[place] - root.imag / (2.0 * np.pi), traces.growth[place] - root.real)
        )
    hertz, growth = np.nanmedian(np.abs(np.array(errors)), axis=0)
    return f'100 ms after the alarm, median error: {hertz:.3f} Hz, growth {growth:.2f} 1/s'


def _curve(stable: Sequence[Traces], shaken: Sequence[Traces], name: str, pace: Array) -> Array:
    """False alarms an hour and median delay in turns, over thresholds (n, 2)."""
    tried = np.quantile(
        np.concatenate([t.scores[name] for t in stable]), 1.0 - np.geomspace(1e-7, 1e-2, 24)
    )
    points = []
    for threshold in np.unique(tried):
        number, hours = rate(stable, name, float(threshold))
        points.append((number / hours, np.median(delays(shaken, name, float(threshold)) * pace)))
    return np.array(points)


def _plot(curves: dict[str, dict[str, Array]], file: str) -> None:
    import matplotlib as mpl

    mpl.use('Agg')
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(1, len(curves), figsize=(4.2 * len(curves), 3.8), squeeze=False)
    for axis, (noise, of_names) in zip(axes[0], curves.items(), strict=True):
        for name, points in of_names.items():
            kept = points[np.isfinite(points[:, 1]) & (points[:, 0] > 0.0)]
            axis.plot(kept[:, 0], kept[:, 1], 'o-', ms=3, label=name)
        axis.axvline(ASKED, color='0.6', lw=1)
        axis.set(xscale='log', yscale='log', title=noise, xlabel='false alarms per hour')
    axes[0, 0].set_ylabel('median delay, revolutions')
    axes[0, 0].legend(frameon=False, fontsize=8)
    figure.tight_layout()
    figure.savefig(file, dpi=120)


def benign(options: Any) -> list[str]:
    """What only looks like chatter: share of events with an alarm within 2 s."""
    number = 8 if options.quick else 200
    lines = ['events without chatter that raise an alarm (rivals at their S1 threshold)']
    calm = run(
        [scenarios.stable('S1', CALIBRATION + k) for k in range(4 if options.quick else 60)],
        'S1 stable',
        options.processes,
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
        found = run([make(k) for k in range(repeats)], label, options.processes)
        events = sum(len(traces.case.events) for traces in found)
        shares = []
        for name, threshold in limits.items():
            wrong = sum(_wrong(traces, name, threshold) for traces in found)
            shares.append(f'{name} {100.0 * wrong / events:.1f} %')
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
    with multiprocessing.Pool(options.processes) as pool:
        found = np.array(pool.map(limit_cycle, cases, chunksize=2))
    half, most = quantiles(found)
    line = (
        f'switched on in saturated chatter: {len(cases)} cases, said after {1e3 * half:.0f} / '
        f'{1e3 * most:.0f} ms, {int(np.isinf(found).sum())} not'
    )
    return [line]


def advice(options: Any) -> list[str]:
    """Recommended speeds."""
    return advice_figures(16 if options.quick else 200, options.processes)


def cpu(options: Any) -> list[str]:
    """What the detector takes, in batches of 0.1 s and as the node gets them."""
    seconds = 3.0 if options.quick else 20.0
    samples = simulate((Stretch(seconds + 1.0, 3000.0, 0.4e-3),), NOISES['S1'], 0)
    lines = []
    for size in (1000, HOP, 20):
        detector = ChatterDetector()
        detector.update(samples[:10000], COLUMNS)
        begin = time.process_time()
        for start in range(10000, len(samples), size):
            detector.update(samples[start : start + size], COLUMNS)
        spent = (time.process_time() - begin) / seconds
        lines.append(
            f'CPU in batches of {size:4d} samples: {1e3 * spent:.2f} ms a simulated second'
        )
    return lines


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        prog='python benchmarks/detection',
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('parts', nargs='*', metavar='PART', help=f'of {", ".join(PARTS)}')
    parser.add_argument('--quick', action='store_true', help='few cases: a smoke test')
    parser.add_argument('--scenarios', nargs='+', default=sorted(NOISES), choices=sorted(NOISES))
    parser.add_argument('--processes', type=int, default=os.cpu_count())
    parser.add_argument('--plot', metavar='FILE', help='draw delay against false-alarm rate')
    parser.add_argument('--json', action='store_true', help='print JSON')
    options = parser.parse_args(arguments)
    unknown = [part for part in options.parts if part not in PARTS]
    if unknown:
        parser.error(f'{unknown[0]} is no part: it must be one of {", ".join(PARTS)}')
    begin = time.monotonic()
    found: dict[str, list[str]] = {}
    for part in options.parts or PARTS:
        found[part] = globals()[part](options)
        if not options.json:
            print('\n'.join(found[part]), flush=True)
    machine = f'{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}'
    if options.json:
        print(json.dumps(found, indent=2))
    else:
        print(f'{machine}; {time.monotonic() - begin:.0f} s')
    return 0


if __name__ == '__main__':
    sys.exit(main())
