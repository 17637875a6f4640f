"""What the node `lathe` says about itself: its pace, and what it is doing to the workpiece."""

from __future__ import annotations

import math
import time
from collections import deque
from typing import NamedTuple

import numpy as np

from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.nodes.diagnostics import ERROR, OK, WARN, Status
from lathe_chatter.nodes.real_time_loop import SECOND, Pacer, RequestLoad
from lathe_chatter.nodes.simulation_control import RunControl, RunState

GUARD_ON = 'not tripped'
"""What is said of the guard as long as it has not ended the cut."""
_MICRO = 1e-3
"""us in a ns."""
_LATEST = 4096
FLOOD = 0.25
"""Fraction of the time that requests take when they are called a flood."""
_LATE = 0.1
"""s behind the clock from which a node no longer keeps up."""


class Durations:
    """The latest durations of something done over and over, and their quantiles.

    Attributes:
        add: Notes one.
        clear: Forgets all.
    """

    def __init__(self) -> None:
        """Begin empty."""
        self._latest = deque[float](maxlen=_LATEST)
        self.add, self.clear = self._latest.append, self._latest.clear

    def quantiles(self, *fractions: float) -> tuple[float, ...]:
        """The quantiles of those noted since `clear`, 4096 at most; zeros where none were."""
        known = self._latest or (0.0,)
        return tuple(np.quantile(known, fractions))


class _Mark(NamedTuple):
    """Where the counters stood when the last second ended."""

    ticks: int
    overruns: int
    lag: float
    served: int
    taken: int
    at: int


class TickStatistics:
    """Counts and times the ticks, and turns them into statuses.

    Args:
        pacer: Whose lag is reported.
        tick: Simulated duration of a tick, ns.
        requests: That are served beside the ticks.

    Attributes:
        ticks: How many were made.
        lateness: By how much each came late, ns.
    """

    def __init__(self, pacer: Pacer, tick: float, requests: RequestLoad) -> None:
        """Begin at no ticks."""
        self._pacer, self._requests = pacer, requests
        self._tick = tick
        self.ticks = 0
        self._steps = Durations()
        self.lateness = Durations()
        self._before = _Mark(0, 0, 0.0, 0, 0, time.monotonic_ns())
        self._turned, self._speed = (0.0, 0.0), math.nan
        self._reached, self._reached_since = 0.0, (0, time.monotonic_ns())
        self._is_seldom = False
        self.begin_second()

    def note_tick(self, duration: int, lathe: VirtualLathe) -> None:
        """Count a tick that took `duration` ns to compute and publish."""
        self.ticks += 1
        self._steps.add(duration)
        self._engaged += lathe.bearing_engaged
        self._in_cut += lathe.tool_in_cut
        before, self._turned = self._turned, (lathe.time, lathe.spindle_angle)
        passed, turns = self._turned[0] - before[0], self._turned[1] - before[1]
        self._speed = 60.0 * turns / passed if passed > 0.0 else math.nan  # nan after a reset

    @property
    def behind(self) -> bool:
        """Whether simulated time was given up in this second."""
        return self.was_behind(self._pacer.overruns)

    def was_behind(self, overruns: int) -> bool:
        """Whether that was so when there had been so many overruns."""
        return overruns > self._before.overruns

    def begin_second(self) -> None:
        """Forget what belonged to the second that was reported."""
        now = time.monotonic_ns()
        requests = self._requests
        if not self._is_seldom or self.ticks != self._reached_since[0]:
            self._reached_since = self.ticks, now
        self._share_before = self.requests_share
        self._before = _Mark(
            self.ticks, self._pacer.overruns, self._pacer.lag, requests.served, requests.taken, now
        )
        self._steps.clear()
        self.lateness.clear()
        self._engaged = self._in_cut = 0

    @property
    def requests_share(self) -> float:
        """What requests took of the time in this second, as a fraction."""
        elapsed = max(1, time.monotonic_ns() - self._before.at)
        return (self._requests.taken - self._before.taken) / elapsed

    @property
    def flooded(self) -> bool:
        """Whether requests took much of the time in this second and in the one before.

        In one alone a single reset does.
        """
        return min(self.requests_share, self._share_before) > FLOOD

    @property
    def requests_served(self) -> int:
        """How many requests were served in this second."""
        return self._requests.served - self._before.served

    def pace(
        self, control: RunControl, *, asked: float, late: float, clock: str, scheduling: str
    ) -> Status:
        """The status of the pace.

        Args:
            control: Whether time goes on.
            asked: The real-time factor asked for, 0 for as fast as possible.
            late: How late the last tick is that should have been made by now, s.
            clock: What is wrong with /clock; empty if nothing is.
            scheduling: Of the thread that ticks.
        """
        ticks, since = self._reached_since
        self._is_seldom = self._ticks_are_seldom(control)
        if self.ticks != ticks or not self._is_seldom:
            elapsed = max(1, time.monotonic_ns() - since)
            self._reached = (self.ticks - ticks) * self._tick / elapsed
        level, message = self._verdict(control, asked, late, clock)
        p50, p99, largest = (q * _MICRO for q in self._steps.quantiles(0.5, 0.99, 1.0))
        late99, latest = (q * _MICRO for q in self.lateness.quantiles(0.99, 1.0))
        values = {
            'state': control.state.value,
            'real-time factor': self._reached,
            'real-time factor asked for': asked,
            'ticks': self.ticks,
            'overruns': self._pacer.overruns,
            'lag given up, s': self._pacer.lag / SECOND,
            'lag given up in the last second, s': (self._pacer.lag - self._before.lag) / SECOND,
            'step time p50, us': p50,
            'step time p99, us': p99,
            'step time max, us': largest,
            'lateness p99, us': late99,
            'lateness max, us': latest,
            'behind the clock, s': late,
            'requests in the last second': self.requests_served,
            'time taken by requests, fraction': self.requests_share,
            'scheduling': scheduling,
        }
        return Status('pace', level, message, values)

    def _verdict(
        self, control: RunControl, asked: float, late: float, clock: str
    ) -> tuple[bytes, str]:
        """Level and message of the pace: what is wrong, a cause before what comes of it."""
        running = control.state is RunState.RUNNING
        wrong = (
            (bool(clock), clock),
            (self.flooded, 'flooded: requests take much of the time'),
            (self.behind, 'behind: simulated time was given up'),
            (running and late > _LATE, 'catching up'),
        )
        for holds, message in wrong:
            if holds:
                return WARN, message
        if not running:
            return OK, control.state.value
        return OK, 'as fast as possible' if asked == 0.0 else 'keeping up'

    def _ticks_are_seldom(self, control: RunControl) -> bool:
        """Whether one may take longer than the second that is reported."""
        return control.state is RunState.RUNNING and self._pacer.period > 0.5 * SECOND

    def cutting(self, control: RunControl, lathe: VirtualLathe) -> Status:
        """The status of the cut."""
        made = self.ticks - self._before.ticks
        ticks = max(1, made)
        engaged, in_cut = self._engaged, self._in_cut
        under_way = not made and self._ticks_are_seldom(control)
        if under_way:
            engaged, in_cut = int(lathe.bearing_engaged), int(lathe.tool_in_cut)
        cut, asked = lathe.cut, lathe.cut.spindle_speed_rpm
        values = {
            'simulated time, s': lathe.time,
            'bearing contact': cut.bearing_contact.value,
            'bearing engaged, fraction of ticks': engaged / ticks,
            'tool in cut, fraction of ticks': in_cut / ticks,
            'guard': control.ended_because or GUARD_ON,
            'spindle speed, rev/min': self._speed if math.isfinite(self._speed) else asked,
            'spindle speed asked for, rev/min': asked,
            'depth of cut, m': cut.depth_of_cut,
            'bearing clearance, m': cut.bearing_clearance,
            'resets': control.resets,
        }
        if control.ended_because:
            return Status('cut', ERROR, control.ended_because, values)
        message = 'cutting'
        if not (made or under_way):
            message = 'at rest'
        elif not cut.depth_of_cut:
            message = 'no depth of cut'
        elif not in_cut:
            message = 'out of the cut'
        return Status('cut', OK, message, values)
