"""What the paper leaves open, derived again: C, the screening function, the clearance, the time.

Nothing here is asserted. Each finding is computed from the paper's own verdicts and the model,
so a reader who doubts one can change a number and run it again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.model import BearingContact, Machine
from lathe_chatter.paper.figures import WINDOWS
from lathe_chatter.paper.published_runs import AXES, PAPER_RUNS, run_named
from lathe_chatter.paper.reproduced_run import SAMPLE_RATE, paper_lathe
from lathe_chatter.paper.screening_function_variants import (
    ScreeningReading,
    axes_without_bearing,
    screening_readings,
)
from lathe_chatter.stability import critical_depth, rightmost_roots

MANTISSA = 3.5
"""Of the cutting force coefficient, as printed."""
_EXPONENTS = range(-9, 12)
_PER_DECADE = 20
_DIGITS = 1e-7
_LONGEST_FIGURE = 0.5
_BEARING_SHARES: Array = np.linspace(0.0, 2.0, 81, dtype=np.float64)


@dataclass(frozen=True)
class CoefficientReading:
    """One reading of the printed cutting force coefficient.

    Attributes:
        coefficient: C, N/m2.
        verdicts: How many of the paper's hold with it.
    """

    coefficient: float
    verdicts: int


@dataclass(frozen=True)
class CoefficientRange:
    """The values of C with which all of the paper's verdicts hold, N/m2, and what bounds them."""

    low: float
    high: float
    too_low_for: str
    too_high_for: str


@dataclass(frozen=True)
class ClearanceEffect:
    """What a larger clearance does where the bearing carries throughout.

    Attributes:
        clearances: gamma, m (n,).
        growth_rates: Of the root, 1/s; gamma is not in the characteristic equation.
        amplitudes: Half the range of the tool's displacement at the end of the figure, m (n,).
    """

    clearances: tuple[float, ...]
    growth_rates: tuple[float, ...]
    amplitudes: tuple[float, ...]


@dataclass(frozen=True)
class StiffnessEffect:
    """What the bearing's stiffness does to the limit of depth at 3000 rev/min.

    Attributes:
        shares: k_bc / k_wp (n,).
        limits: Critical depth, m (n,).
        workpiece_frequencies: sqrt((k_wp + k_bc) / m_wp), rad/s (n,).
        worst: Of `shares`, the one with the lowest limit.
        tool_frequency: rad/s.
    """

    shares: Array
    limits: Array
    workpiece_frequencies: Array
    worst: float
    tool_frequency: float


@dataclass(frozen=True)
class Window:
    """For how long the paper simulated at a speed, as far as its legible axes tell, s."""

    spindle_speed_rpm: float
    shortest: float
    longest: float


@dataclass(frozen=True)
class Findings:
    """All of them."""

    readings: tuple[CoefficientReading, ...]
    coefficient: CoefficientRange
    screening: tuple[ScreeningReading, ...]
    axes_without_bearing: tuple[float, float] | None
    clearance: ClearanceEffect
    stiffness: StiffnessEffect
    windows: tuple[Window, ...]


def find(
    machine: Machine | None = None, progress: Callable[[str], None] = lambda _: None
) -> Findings:
    """Derive every finding.

    Args:
        machine: The paper's, but for what is varied.
        progress: Is told what is looked into.
    """
    paper = machine or Machine()
    progress('the cutting force coefficient')
    readings = tuple(
        CoefficientReading(value, sum(verdicts_at(paper, value)))
        for value in (float(f'{MANTISSA}e{n}') for n in _EXPONENTS)
    )
    coefficient = coefficient_range(paper)
    progress('the screening function')
    screening = screening_readings(paper, WINDOWS)
    progress('clearance, stiffness and duration')
    return Findings(
        readings,
        coefficient,
        screening,
        axes_without_bearing(paper),
        clearance_effect(paper),
        stiffness_effect(paper),
        tuple(figure_window(rpm, paper) for rpm in (3000.0, 10000.0)),
    )


def verdicts_at(machine: Machine, coefficient: float) -> list[bool]:
    """Whether each of the paper's verdicts holds with a cutting force coefficient, N/m2.

    The bearing is seated where the paper has a clearance.
    """
    there = replace(machine, cutting_coefficient=coefficient)
    unstable: dict[str, bool] = {}
    for seated in (False, True):
        runs = [run for run in PAPER_RUNS if run.has_bearing == seated]
        speeds = np.array([run.spindle_speed_rpm for run in runs])
        depths = np.array([run.depth_of_cut for run in runs])
        roots = rightmost_roots(there, speeds, depths, seated=seated)
        unstable |= {r.name: root.real > 0.0 for r, root in zip(runs, roots.tolist(), strict=True)}
    return [unstable[run.name] == run.unstable for run in PAPER_RUNS]


def coefficient_range(machine: Machine) -> CoefficientRange:
    """Scan C over 20 decades for the verdicts, then bisect the two ends of where all hold.

    Raises:
        ArithmeticError: If they hold together nowhere, or in more than one interval.
    """
    decades = _EXPONENTS[-1] - _EXPONENTS[0]
    grid = MANTISSA * 10.0 ** np.linspace(_EXPONENTS[0], _EXPONENTS[-1], decades * _PER_DECADE + 1)
    holds = np.array([all(verdicts_at(machine, value)) for value in grid.tolist()])
    (edges,) = np.nonzero(holds[1:] != holds[:-1])
    if len(edges) != 2:
        raise ArithmeticError(f'all verdicts hold in {len(edges) / 2:g} intervals of C, not one')
    low, below = _edge(machine, float(grid[edges[0] + 1]), float(grid[edges[0]]))
    high, above = _edge(machine, float(grid[edges[1]]), float(grid[edges[1] + 1]))
    return CoefficientRange(low, high, below, above)


def _edge(machine: Machine, inside: float, outside: float) -> tuple[float, str]:
    """The C between two at which the first verdict fails, and the runs whose it is."""
    while abs(outside - inside) > _DIGITS * inside:
        middle = (inside * outside) ** 0.5
        if all(verdicts_at(machine, middle)):
            inside = middle
        else:
            outside = middle
    failed = [
        run.title
        for run, holds in zip(PAPER_RUNS, verdicts_at(machine, outside), strict=True)
        if not holds
    ]
    return inside, '; '.join(failed)


def clearance_effect(machine: Machine) -> ClearanceEffect:
    """The runs at 3000 rev/min and 0.5 mm that differ by their clearance alone."""
    runs = sorted(
        (
            run
            for run in PAPER_RUNS
            if run.has_bearing and (run.spindle_speed_rpm, run.depth_of_cut) == (3000.0, 0.5e-3)
        ),
        key=lambda run: run.bearing_clearance or 0.0,
    )
    roots = rightmost_roots(
        machine, [r.spindle_speed_rpm for r in runs], [r.depth_of_cut for r in runs], seated=True
    )
    amplitudes = []
    for run in runs:
        lathe = paper_lathe(run, BearingContact.SEATED, machine)
        samples = lathe.advance(round(_LONGEST_FIGURE * SAMPLE_RATE))
        amplitudes.append(0.5 * float(np.ptp(samples[-200:, 2])))
    return ClearanceEffect(
        tuple(run.bearing_clearance or 0.0 for run in runs),
        tuple(roots.real.tolist()),
        tuple(amplitudes),
    )


def stiffness_effect(machine: Machine) -> StiffnessEffect:
    """The limit of depth as the bearing gets stiffer, at the paper's slow speed."""
    own = machine.workpiece.stiffness
    machines = [replace(machine, bearing_stiffness=share * own) for share in _BEARING_SHARES]
    limits = np.array([critical_depth(m, 3000.0, seated=True) for m in machines])
    stiffness = own * (1.0 + _BEARING_SHARES)
    return StiffnessEffect(
        _BEARING_SHARES,
        limits,
        np.sqrt(stiffness / machine.workpiece.mass),
        float(_BEARING_SHARES[np.argmin(limits)]),
        machine.tool.natural_frequency,
    )


def figure_window(spindle_speed_rpm: float, machine: Machine | None = None) -> Window:
    """The durations with which the tool's velocity fits the axes of Table 4 that can be read.

    An axis ends at the first tick beyond what it shows, so each pair of ticks that survived the
    scan bounds the largest or smallest velocity from both sides, and so the time.
    """
    fits = np.ones(round(_LONGEST_FIGURE * SAMPLE_RATE), bool)
    for axis in AXES:
        run = run_named(axis.run)
        if run.spindle_speed_rpm != spindle_speed_rpm:
            continue
        lathe = paper_lathe(run, BearingContact.SEATED, machine)
        velocity = lathe.advance(fits.size)[:, 3]
        reached = np.maximum.accumulate(np.maximum(axis.sign * velocity, 0.0))
        fits &= (reached > axis.tick_before) & (reached <= axis.last_tick)
    times = (np.flatnonzero(fits) + 1) / SAMPLE_RATE
    if times.size == 0:
        return Window(spindle_speed_rpm, float('nan'), float('nan'))
    return Window(spindle_speed_rpm, float(times[0]), float(times[-1]))
