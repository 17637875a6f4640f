"""Pictures that the paper does not have: what decides its verdicts, at a glance."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.model import BearingContact, Cut, Machine
from lathe_chatter.paper.open_questions import Findings
from lathe_chatter.paper.reproduced_run import SAMPLE_RATE, Reproduced, paper_lathe
from lathe_chatter.plot_style import OPEN, SAFE, SEATED, grid, new_figure, save
from lathe_chatter.report.stability_chart import chart_limits, chart_speeds, draw_limits

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SHOWN = 0.6
"""s of simulation in the picture of growth."""
_WINDOW = 75
"""Samples, 7.5 ms: a vibration, whose largest velocity is a point of the envelope."""
_MILLI = 1e3


def draw_growth(results: list[Reproduced], path: Path) -> None:
    """The envelope of each run's workpiece velocity, and the slope that the root gives it."""
    figure = new_figure(11.0, 8.0)
    figure.suptitle('Growth in time: simulation (lines) and rightmost root (dots)')
    cells = figure.subplots(2, 2, sharex=True)
    conditions = [(3000.0, 0.5e-3), (10000.0, 0.5e-3), (3000.0, 1e-3), (10000.0, 1e-3)]
    for axes, (speed, depth) in zip(cells.ravel(), conditions, strict=True):
        axes.set_title(f'{speed:g} rpm, {depth * 1e3:g} mm', fontsize=10)
        here = [
            r for r in results if (r.run.spindle_speed_rpm, r.run.depth_of_cut) == (speed, depth)
        ]
        for result in sorted(here, key=lambda r: r.run.bearing_clearance or 0.0):
            _draw_envelope(axes, result)
        axes.set_yscale('log')
        axes.legend(fontsize=8, loc='upper left' if depth > 0.7e-3 else 'best')
        grid(axes)
    for axes in cells[:, 0]:
        axes.set_ylabel('workpiece velocity / (mm/s)')
    for axes in cells[1]:
        axes.set_xlabel('time / s')
    save(figure, path)


def _draw_envelope(axes: Axes, result: Reproduced) -> None:
    """One run: its envelope, and its root through the last point."""
    lathe = paper_lathe(result.run, BearingContact.SEATED)
    velocity = np.abs(lathe.advance(round(_SHOWN * SAMPLE_RATE))[:, 5]) * _MILLI
    peaks = np.lib.stride_tricks.sliding_window_view(velocity, _WINDOW).max(axis=1)
    time = (np.arange(peaks.size) + _WINDOW) / SAMPLE_RATE
    clearance = result.run.bearing_clearance
    label = 'no BC' if clearance is None else f'BC {clearance * 1e6:g} µm'
    (line,) = axes.plot(
        time, peaks, lw=1.3, color=_colour(clearance),
        label=f'{label}: {result.root.real:+.3f} s$^{{-1}}$',
    )  # fmt: skip
    until = time[peaks.size // 3 :: peaks.size // 12]
    slope = peaks[-1] * np.exp(result.root.real * (until - time[-1]))
    axes.plot(until, slope, '.', color=line.get_color())


def _colour(clearance: float | None) -> str:
    """Blue without a bearing, then from light to dark with the clearance."""
    shades = {None: OPEN, 5e-6: '#F0B27A', 60e-6: SEATED, 80e-6: '#A04000', 110e-6: '#4A1F00'}
    return shades[clearance]


def draw_conditions(results: list[Reproduced], path: Path) -> None:
    """The 14 conditions on the chart: between the two limits the bearing decides."""
    figure = new_figure(11.0, 5.5)
    axes = figure.subplots()
    # The paper's force has no mean, so nothing seats the workpiece: there is no seating line.
    cut = Cut(bearing_contact=BearingContact.GAP)
    speeds = chart_speeds(1500.0, 12000.0)
    limits = chart_limits(Machine(), cut, speeds, tool_leaves_cut=False)
    draw_limits(axes, limits, cut.bearing_contact, 1.6e-3, shade=False)
    for has_bearing, colour, marker in ((False, OPEN, 'o'), (True, SEATED, 's')):
        for result in results:
            run = result.run
            if run.has_bearing is has_bearing:
                shift = 60.0 if has_bearing else -60.0
                axes.plot(
                    run.spindle_speed_rpm + shift, run.depth_of_cut * 1e3, marker, color=colour,
                    mfc=colour if result.unstable else 'white', ms=8, mew=1.6,
                )  # fmt: skip
    axes.plot([], [], 'o', color=OPEN, mfc='white', label='run without BC')
    axes.plot([], [], 's', color=SEATED, mfc='white', label='run with BC')
    axes.plot([], [], 'D', color='k', label='filled: unstable')
    axes.legend(loc='upper left', ncols=3, fontsize=9)
    axes.set_title('The 14 runs on the stability chart (pairs drawn side by side)', fontsize=11)
    save(figure, path)


def draw_findings(findings: Findings, path: Path) -> None:
    """Verdicts over C, and what the bearing's stiffness does to the limit."""
    figure = new_figure(11.0, 4.6)
    coefficient, stiffness = figure.subplots(1, 2)
    values = np.array([reading.coefficient for reading in findings.readings])
    verdicts = np.array([reading.verdicts for reading in findings.readings])
    coefficient.semilogx(values, verdicts, 'o', color=OPEN, label='3.5 times a power of ten')
    found = findings.coefficient
    coefficient.axvspan(found.low, found.high, color=SAFE, alpha=0.4, label='all verdicts hold')
    coefficient.set_ylim(0, 15)
    coefficient.axhline(14, color='k', lw=0.8, ls=':')
    coefficient.set_xlabel('cutting force coefficient C / (N/m$^2$)')
    coefficient.set_ylabel('verdicts of the paper that hold, of 14')
    coefficient.legend(loc='center left', fontsize=9)
    effect = findings.stiffness
    _draw_stiffness(stiffness, effect.shares, effect.limits * 1e3)
    at = (effect.tool_frequency / effect.workpiece_frequencies[0]) ** 2 - 1.0
    stiffness.axvline(at, color='k', lw=1.0, ls=':', label='workpiece tuned to the tool')
    stiffness.legend(loc='upper left', fontsize=9)
    for axes in (coefficient, stiffness):
        grid(axes)
    save(figure, path)


def _draw_stiffness(axes: Axes, shares: Array, limits: Array) -> None:
    axes.plot(shares, limits, color=SEATED, lw=1.5, label='limit, on its bearing')
    axes.axhline(limits[0], color=OPEN, lw=1.2, label='limit, open')
    axes.axvline(0.5, color='k', lw=1.0, label='the paper, k_bc = 0.5 k_wp')
    axes.set_xlabel('bearing stiffness k_bc / k_wp')
    axes.set_ylabel('critical depth at 3000 rpm / mm')
