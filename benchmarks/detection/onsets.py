"""S0 to S3: delay, misses and false alarms, beside the limit and the rivals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import scenarios
from delays import (
    confidence,
    delays,
    informed_cusum,
    limit_formula,
    quantiles,
    rate,
    rates_of,
    threshold_for,
    turns,
)
from recording import DETECTOR, Traces, run
from rivals import HOP, RIVALS
from scenarios import MACHINE
from simulator import RATE

from lathe_chatter.array_types import Array
from lathe_chatter.plot_style import NEUTRAL, SAFE, TOOL, WORKPIECE
from lathe_chatter.stability import rightmost_root

ASKED = 2.0
"""False alarms an hour at which delays are compared."""
_COLOURS = (WORKPIECE, TOOL, NEUTRAL, SAFE)
_MEANING = {
    'S0': 'hardly any noise, steps',
    'S1': 'force noise',
    'S2': 'sensor noise',
    'S3': 'force noise, steps',
}
_FEWEST_DRAWN = 0.1
"""False alarms an hour at which a rate of none is drawn."""
CALIBRATION, REPORTED = 1_000_000, 0
"""Where the seeds of the two sets begin."""


def onsets(options: Any) -> list[str]:
    """S0 to S3: delay, misses, false alarms, beside the limit and the rivals."""
    lines, curves = [], {}
    count, hours = (24, 0.1) if options.quick else (240, 10.5)
    count, hours = options.onsets or count, options.hours or hours
    for noise in options.scenarios:
        stepped = noise in {'S0', 'S3'}
        make = scenarios.steps if stepped else scenarios.stable
        watched = max(
            4, round(hours * (600.0 if stepped else 3600.0) / (44.0 if stepped else 60.0))
        )
        calm = {
            name: run(
                [make(noise, seed + k) for k in range(n)], f'{noise} stable', options.executor
            )
            for name, seed, n in (
                ('calibration', CALIBRATION, max(4, watched // 4)),
                ('reported', REPORTED, watched),
            )
        }
        shaken = run(
            [scenarios.onset(noise, REPORTED + k) for k in range(count)],
            f'{noise} onsets',
            options.executor,
        )
        lines += [
            f'{noise}: {count} onsets, {rate(calm["reported"], DETECTOR, 1.0)[1]:.2f} h stable'
        ]
        pace = turns(shaken)
        asked = _asked(noise)
        if stepped:
            lines[-1] += f' in steps every {scenarios.STEP:g} s; asked: 1 % false alarms a step'
        pairs = [rates_of(traces.case) for traces in shaken]
        formula = np.array([limit_formula(*pair, asked / 3600.0) for pair in pairs])
        lines.append(_line('  limit without noise of sensors, mean', formula, pace, ''))
        if not stepped:
            rng = np.random.default_rng(0)
            informed = np.array([informed_cusum(t.case, asked / 3600.0, rng) for t in shaken])
            lines.append(_line('  a CUSUM that knows everything', informed, pace, ''))
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


def _asked(noise: str) -> float:
    """False alarms an hour at which the delays of the table are compared."""
    return 0.01 * 3600.0 / scenarios.STEP if noise in {'S0', 'S3'} else ASKED


def _plot(curves: dict[str, dict[str, Array]], file: str) -> None:
    import matplotlib as mpl

    mpl.use('Agg')
    from matplotlib import pyplot as plt
    from matplotlib.ticker import LogLocator, NullFormatter, ScalarFormatter

    figure, axes = plt.subplots(1, len(curves), figsize=(3.6 * len(curves), 4.0), squeeze=False)
    for axis, (noise, of_names) in zip(axes[0], curves.items(), strict=True):
        for (name, points), colour in zip(of_names.items(), _COLOURS, strict=True):
            kept = points[np.isfinite(points[:, 1])]
            # On a logarithmic axis none is drawn at the left edge, as an open mark.
            rates = np.maximum(kept[:, 0], _FEWEST_DRAWN)
            axis.plot(rates, kept[:, 1], '-', color=colour, label=name)
            some = kept[:, 0] > 0.0
            axis.plot(rates[some], kept[some, 1], 'o', ms=3.5, color=colour)
            axis.plot(rates[~some], kept[~some, 1], 'o', ms=4, mfc='white', color=colour)
        axis.axvline(_asked(noise), color='0.6', lw=1, zorder=0)
        axis.set(xscale='log', yscale='log', title=f'{noise}: {_MEANING[noise]}')
        axis.set(
            xlabel='false alarms per hour (open: none seen)', xlim=(0.8 * _FEWEST_DRAWN, None)
        )
        axis.title.set_fontsize(9)
        axis.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.yaxis.set_major_formatter(ScalarFormatter())
        axis.yaxis.set_minor_formatter(NullFormatter())
    axes[0, 0].set_ylabel('median delay, revolutions')
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc='lower center', ncols=len(labels), frameon=False)
    figure.tight_layout(rect=(0.0, 0.08, 1.0, 1.0))
    figure.savefig(file, dpi=120)
