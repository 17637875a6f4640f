"""The runs that are measured, and the references that the tests carry for them."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

from figures import CHECKOUT

from lathe_chatter.lathe import Event, EventKind, VirtualLathe
from lathe_chatter.model import BearingContact, Cut, Machine

sys.path.append(str(CHECKOUT / 'tests'))

from support.reference import dop853, solution, taylor

RATE = 1e4
"""Hz: steps of 100 us."""
DURATION = 1.0
"""s."""
DEPTH = 1e-3
"""m."""
_UNLIMITED = 1e12  # m: the linear force grows beyond any lathe

_EVENTS = {
    EventKind.BEARING_ENGAGES: ('bearing', True),
    EventKind.BEARING_RELEASES: ('bearing', False),
    EventKind.TOOL_ENTERS_CUT: ('chip', True),
    EventKind.TOOL_LEAVES_CUT: ('chip', False),
}


@dataclass(frozen=True)
class Case:
    """A cut with a law of the cutting force."""

    cut: Cut
    total_force: bool
    spindle_acceleration: float = 0.0

    @property
    def name(self) -> str:
        """The case in words."""
        force = 'total force' if self.total_force else 'linear force'
        contact = self.cut.bearing_contact.value
        if self.cut.bearing_contact is not BearingContact.NONE:
            contact += f' {1e6 * self.cut.bearing_clearance:g} um'
        return f'{force}, {contact}, {self.cut.spindle_speed_rpm:g} rev/min'

    def lathe(self, sample_rate: float = RATE) -> VirtualLathe:
        """A lathe that is about to begin this cut."""
        return VirtualLathe(
            cut=self.cut,
            sample_rate=sample_rate,
            tool_leaves_cut=self.total_force,
            spindle_acceleration=self.spindle_acceleration,
            displacement_limit=_UNLIMITED,
        )

    def with_changes(self, **changes: object) -> Case:
        """The same case of another cut."""
        return replace(self, cut=self.cut.with_changes(**changes))


LINEAR = Case(Cut(3000.0, DEPTH, bearing_contact=BearingContact.NONE), total_force=False)
"""The paper's fastest growing run at 3000 rev/min without clearance."""
TOUCHING = Case(Cut(3000.0, DEPTH, 5e-6, BearingContact.GAP), total_force=False)
CHATTER = Case(Cut(3000.0, DEPTH, 5e-6, BearingContact.GAP), total_force=True)
"""Lasting chatter: the workpiece meets its bearing, the tool leaves the cut."""

PAPER = tuple(
    replace(case, total_force=total).with_changes(spindle_speed_rpm=rpm)
    for total in (False, True)
    for rpm in (3000.0, 10000.0)
    for case in (LINEAR, TOUCHING.with_changes(bearing_clearance=60e-6), TOUCHING)
)


def located(events: list[Event]) -> tuple[solution.Event, ...]:
    """A lathe's events as the references write theirs."""
    return tuple(solution.Event(event.time, *_EVENTS[event.kind]) for event in events)


def run(case: Case) -> solution.Solution:
    """The lathe's own solution over `DURATION`."""
    lathe = case.lathe()
    samples = lathe.advance(round(DURATION * RATE))
    if lathe.guard:
        raise ArithmeticError(lathe.guard)
    return solution.Solution(samples[:, 2:6], located(lathe.events))


@lru_cache
def exact(case: Case) -> solution.Solution:
    """The solution to 36 digits, by the Taylor method of steps."""
    return _solve(taylor.solve, case)


def by_dop853(case: Case) -> solution.Solution:
    """The solution by SciPy's DOP853 and the method of steps."""
    return _solve(dop853.solve, case)


def _solve(solve: Callable[..., solution.Solution], case: Case) -> solution.Solution:
    return solve(Machine(), case.cut, DURATION, sample_rate=RATE, tool_leaves_cut=case.total_force)


def error(found: solution.Solution, expected: solution.Solution) -> float:
    """Largest error over the local amplitude, see `solution.relative_error`."""
    return solution.relative_error(found.states, expected.states, RATE)
