"""What the paper simulated and what it said of each run, and nothing that we computed."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from lathe_chatter.model import BearingContact, Cut


class Pace(Enum):
    """How the paper describes a run: stable, or how fast it diverges."""

    STABLE = 'stable'
    SLOW = 'slow'
    RAPID = 'rapid'
    UNSTABLE = 'unstable'
    """Without a word on how fast."""


@dataclass(frozen=True)
class PaperRun:
    """One run of the paper.

    Attributes:
        name: Short and unique, for file names.
        spindle_speed_rpm: Omega, rev/min.
        depth_of_cut: w, m.
        bearing_clearance: gamma, m; None where the paper says "without BC".
        places: The tables and figures that show it.
        words: What the paper says of it.
        pace: The same as a value.
    """

    name: str
    spindle_speed_rpm: float
    depth_of_cut: float
    bearing_clearance: float | None
    places: tuple[str, ...]
    words: str
    pace: Pace

    @property
    def has_bearing(self) -> bool:
        """Whether the paper says "with BC"."""
        return self.bearing_clearance is not None

    @property
    def unstable(self) -> bool:
        """The paper's verdict."""
        return self.pace is not Pace.STABLE

    @property
    def title(self) -> str:
        """The condition as a reader of the paper looks it up."""
        clearance = self.bearing_clearance
        bearing = 'no BC' if clearance is None else f'BC {clearance * 1e6:g} µm'
        return f'{self.spindle_speed_rpm:g} rpm, {self.depth_of_cut * 1e3:g} mm, {bearing}'

    def cut(self, contact: BearingContact) -> Cut:
        """The run as a cut, with the screening function read as `contact` says."""
        if self.bearing_clearance is None:
            return Cut(
                self.spindle_speed_rpm, self.depth_of_cut, bearing_contact=BearingContact.NONE
            )
        return Cut(self.spindle_speed_rpm, self.depth_of_cut, self.bearing_clearance, contact)


_TABLES = ('Table 2', 'Table 3', 'Table 4')
_SLOW, _FAST = 3000.0, 10000.0
_SHALLOW, _DEEP = 0.5e-3, 1e-3

PAPER_RUNS = (
    PaperRun(
        'no-bc-3000-0.5', _SLOW, _SHALLOW, None, (*_TABLES, 'Fig 3', 'Fig 9'),
        '"Stability is seen."', Pace.STABLE,
    ),
    PaperRun(
        'no-bc-10000-0.5', _FAST, _SHALLOW, None, _TABLES,
        '"stable when there is no bearing clearance"', Pace.STABLE,
    ),
    PaperRun(
        'no-bc-3000-1', _SLOW, _DEEP, None, (*_TABLES, 'Fig 6', 'Fig 12'),
        '"The turning process is unstable"; "rapid rate of divergence"', Pace.RAPID,
    ),
    PaperRun(
        'no-bc-10000-1', _FAST, _DEEP, None, _TABLES,
        '"the unstable ones diverge from the initial conditions"', Pace.UNSTABLE,
    ),
    PaperRun(
        'bc60-3000-0.5', _SLOW, _SHALLOW, 60e-6, _TABLES,
        '"introduction of bearing clearance destabilized the system"', Pace.UNSTABLE,
    ),
    PaperRun(
        'bc60-10000-0.5', _FAST, _SHALLOW, 60e-6, _TABLES,
        '"introduction of bearing clearance destabilized the system"', Pace.UNSTABLE,
    ),
    PaperRun(
        'bc60-3000-1', _SLOW, _DEEP, 60e-6, _TABLES,
        '"the unstable ones diverge"; "chatter is markedly expedited"', Pace.RAPID,
    ),
    PaperRun(
        'bc60-10000-1', _FAST, _DEEP, 60e-6, _TABLES,
        '"the unstable ones diverge"', Pace.RAPID,
    ),
    PaperRun(
        'bc80-3000-0.5', _SLOW, _SHALLOW, 80e-6, ('Fig 4', 'Fig 10'),
        '"the system reluctantly diverges": "slightly beyond the boundary"', Pace.SLOW,
    ),
    PaperRun(
        'bc110-3000-0.5', _SLOW, _SHALLOW, 110e-6, ('Fig 5', 'Fig 11'),
        '"The same goes"; "the slow rate of divergence"', Pace.SLOW,
    ),
    PaperRun(
        'bc80-3000-1', _SLOW, _DEEP, 80e-6, ('Fig 7', 'Fig 13'),
        '"develops chatter fast"; "steadily and rapidly diverge"', Pace.RAPID,
    ),
    PaperRun(
        'bc110-3000-1', _SLOW, _DEEP, 110e-6, ('Fig 8', 'Fig 14'),
        '"develops chatter fast"; "steadily and rapidly diverge"', Pace.RAPID,
    ),
    PaperRun(
        'bc5-3000-0.5', _SLOW, _SHALLOW, 5e-6, ('Fig 15',),
        '"Low rate of instability is seen"', Pace.SLOW,
    ),
    PaperRun(
        'bc5-10000-0.5', _FAST, _SHALLOW, 5e-6, ('Fig 16', 'Fig 17'),
        '"Low rate of instability is seen"; "Slow rate of instability"', Pace.SLOW,
    ),
)  # fmt: skip
"""The 14 runs, in the order of their tables and figures."""


@dataclass(frozen=True)
class Axis:
    """A velocity axis of Table 4 whose numbers survived the scan.

    Attributes:
        run: Name of the run.
        sign: Which end of the axis, +1 or -1.
        tick_before: The tick before the last, as a magnitude, m/s.
        last_tick: The last one.
    """

    run: str
    sign: float
    tick_before: float
    last_tick: float


AXES = (
    Axis('no-bc-3000-1', 1.0, 2.0e-3, 2.5e-3),
    Axis('bc60-3000-1', 1.0, 0.02, 0.03),
    Axis('bc60-3000-1', -1.0, 0.02, 0.03),
    Axis('no-bc-10000-1', 1.0, 0.01, 0.015),
    Axis('no-bc-10000-1', -1.0, 0.01, 0.015),
    Axis('bc60-10000-1', 1.0, 0.1, 0.15),
    Axis('bc60-10000-1', -1.0, 0.15, 0.2),
)
"""Ticks of the paper's Table 4. Where only the mantissa is legible its power of ten is the one
that the initial velocity of 0.0025 m/s allows."""


def run_named(name: str) -> PaperRun:
    """The run of this name."""
    return next(run for run in PAPER_RUNS if run.name == name)


def run_shown_in(place: str) -> PaperRun:
    """The run that a figure shows, as `Fig 7`."""
    return next(run for run in PAPER_RUNS if place in run.places)
