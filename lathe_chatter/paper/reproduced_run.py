"""One run of the paper by three ways: its root, its time simulation, and equation (9) as printed.

The time simulation and the root share nothing but the model: the one steps through the delay
equation from the paper's history, the other solves the characteristic equation. A linear
vibration y obeys y[k] = 2 Re(z) y[k-1] - |z|^2 y[k-2] with z = e^(lambda T), so lambda is read
from the samples without a plot.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.lathe import EventKind, VirtualLathe
from lathe_chatter.model import BearingContact, Machine
from lathe_chatter.paper.published_runs import PaperRun
from lathe_chatter.stability import rightmost_root

SAMPLE_RATE = 1e4
_NO_LIMIT = 1e12
_SETTLING, _MEASURED = 1.2, 0.2
"""s until only the rightmost root is left, and s of what is then measured."""
_STRIDE = 10
"""Samples between those of the linear prediction: 1 ms, an eighth of a period."""
_VELOCITY = 5
AGREEMENT = 0.01
"""1/s by which a measured growth rate may miss the root."""


@dataclass(frozen=True)
class Literal:
    """A run with the screening function of equation (9) as printed.

    Attributes:
        reach: Largest displacement of the workpiece before the bearing is touched, m; over the
            whole simulation where it never is.
        touched_at: When it is touched first, s; None if never.
        growth_rate: Of the envelope at the end of the simulation, 1/s.
    """

    reach: float
    touched_at: float | None
    growth_rate: float

    @property
    def unstable(self) -> bool:
        """The verdict."""
        return self.growth_rate > 0.0


@dataclass(frozen=True)
class Reproduced:
    """A run of the paper as it comes out here.

    Attributes:
        run: The paper's.
        root: The rightmost characteristic root, 1/s + i rad/s.
        measured: The same, from the time simulation.
        literal: Equation (9) as printed; None for a run without bearing clearance.
    """

    run: PaperRun
    root: complex
    measured: complex
    literal: Literal | None

    @property
    def unstable(self) -> bool:
        """The verdict of the root."""
        return self.root.real > 0.0

    @property
    def agrees(self) -> bool:
        """Whether root and simulation say what the paper says, and the same as each other."""
        verdicts = {self.unstable, self.measured.real > 0.0, self.run.unstable}
        return len(verdicts) == 1 and abs(self.measured.real - self.root.real) <= AGREEMENT

    @property
    def literal_agrees(self) -> bool:
        """Whether equation (9) as printed says what the paper says."""
        return self.literal is None or self.literal.unstable == self.run.unstable


def reproduce_run(run: PaperRun, machine: Machine | None = None) -> Reproduced:
    """One run by all three ways, with the bearing seated where the paper has a clearance."""
    lathe_machine = machine or Machine()
    root = rightmost_root(
        lathe_machine, run.spindle_speed_rpm, run.depth_of_cut, seated=run.has_bearing
    )
    lathe = paper_lathe(run, BearingContact.SEATED, lathe_machine)
    lathe.advance(round(_SETTLING * SAMPLE_RATE))
    velocity = lathe.advance(round(_MEASURED * SAMPLE_RATE))[:, _VELOCITY]
    measured = vibration_root(velocity[::_STRIDE], _STRIDE / SAMPLE_RATE)
    literal = reproduce_literally(run, lathe_machine) if run.has_bearing else None
    return Reproduced(run, root, measured, literal)


def reproduce_literally(run: PaperRun, machine: Machine | None = None) -> Literal:
    """Equation (9) as printed, from the paper's history."""
    lathe = paper_lathe(run, BearingContact.GAP, machine)
    samples = lathe.advance(round(_SETTLING * SAMPLE_RATE))
    touches = [event.time for event in lathe.events if event.kind is EventKind.BEARING_ENGAGES]
    touched_at = touches[0] if touches else None
    before = samples if touched_at is None else samples[samples[:, 0] <= touched_at]
    # Both windows hold many vibrations; their ratio needs no single frequency to be there.
    half = round(_MEASURED * SAMPLE_RATE)
    sizes = [
        float(np.ptp(part[:, _VELOCITY])) for part in (samples[-2 * half : -half], samples[-half:])
    ]
    growth = math.log(sizes[1] / sizes[0]) / _MEASURED
    return Literal(float(before[:, 4].max()), touched_at, growth)


def paper_lathe(
    run: PaperRun, contact: BearingContact, machine: Machine | None = None
) -> VirtualLathe:
    """The paper's simulation of a run: linear force, equation (2), and its history."""
    return VirtualLathe(
        machine,
        run.cut(contact),
        sample_rate=SAMPLE_RATE,
        tool_leaves_cut=False,
        displacement_limit=_NO_LIMIT,
    )


def vibration_root(signal: Array, interval: float) -> complex:
    """The lambda of a signal that is one growing or decaying vibration, by linear prediction.

    Least squares on windows of three samples scaled to one size, so that each counts the same.

    Args:
        signal: (n,), of any unit.
        interval: Between its samples, s; less than half a period.

    Returns:
        1/s + i rad/s.
    """
    rows = np.lib.stride_tricks.sliding_window_view(signal, 3)
    rows = rows / np.abs(rows).max(axis=1, keepdims=True)
    (first, second), *_ = np.linalg.lstsq(rows[:, 1::-1], rows[:, 2], rcond=None)
    z = np.roots([1.0, -first, -second])
    return complex(np.log(z[np.argmax(z.imag)])) / interval
