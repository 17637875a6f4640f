"""The machine by SciPy's DOP853 and the method of steps, in double precision.

Between two breaks (a jump of a derivative that an eighth-order method would feel) the delayed
surface is smooth and DOP853 integrates an ordinary differential equation with a known input.
Every step is kept as the polynomial of degree 7 that is its dense output; the steps are so short
that this polynomial, and not only the step, is right: with the default of 250 us a run of
0.4 s agrees with the Taylor reference to 2e-11 of the local amplitude, with 125 us to 4e-12.
"""

from __future__ import annotations

import heapq
from bisect import bisect_right
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq

from lathe_chatter.array_types import Array
from lathe_chatter.model import BearingContact, Cut, Machine, paper_initial_state
from support.reference.solution import Event, Solution

_NODES = 0.5 - 0.5 * np.cos(np.pi * np.arange(8) / 7)
_FIT = np.linalg.inv(np.vander(_NODES, increasing=True))
_ORDER = 9
"""Breaks of a higher order than this are below the error of the method."""
_MERGE = 1e-13
"""Breaks closer than this are one break, s."""


class _Step(NamedTuple):
    start: float
    length: float
    end_state: Array  # (2n,)
    polynomials: Array  # ascending powers of (t - start) / length, (8, 2n)


def solve(
    machine: Machine,
    cut: Cut,
    duration: float,
    *,
    sample_rate: float = 1e4,
    tool_leaves_cut: bool = True,
    step: float = 2.5e-4,
) -> Solution:
    """Integrate from `model.paper_initial_state`, with r = r(0) before.

    Displacement and velocity of n modes alternate, those of the tool first. A body is displaced
    as by a force at rest, and has its velocity from a blow.

    Args:
        machine: The machine.
        cut: The cut; its speed is constant, its noises and runout are left out.
        duration: s.
        sample_rate: Hz.
        tool_leaves_cut: Total force with multiple regeneration, or the paper's linear force.
        step: Longest step, s.
    """
    run = _Run(machine, cut, step, tool_leaves_cut=tool_leaves_cut)
    times = np.arange(1, round(duration * sample_rate) + 1) / sample_rate
    states = np.empty((len(times), 4))
    taken = 0
    for part in run.steps(times[-1]):
        upto = int(np.searchsorted(times, part.start + part.length + 1e-15, side='right'))
        x = (times[taken:upto] - part.start) / part.length
        states[taken:upto] = np.vander(x, 8, increasing=True) @ part.polynomials @ run.seen
        taken = upto
    states[taken:] = run.state @ run.seen
    return Solution(states, tuple(run.events))


class _Run:
    """The state and everything that the past has left behind."""

    def __init__(self, machine: Machine, cut: Cut, step: float, *, tool_leaves_cut: bool) -> None:
        modes = (*machine.tool.modes, *machine.workpiece.modes)
        signs = [1.0] * len(machine.tool.modes) + [-1.0] * len(machine.workpiece.modes)
        self.modes = [
            (
                mode.stiffness / mode.mass,
                mode.damping / mode.mass,
                sign * mode.force / mode.mass,
                (sign < 0.0) * mode.bearing * machine.bearing_stiffness / mode.mass,
            )
            for sign, mode in zip(signs, modes, strict=True)
        ]  # fmt: skip
        self.across = [sign * mode.chip for sign, mode in zip(signs, modes, strict=True)]
        self.at_bearing = [
            (sign < 0.0) * mode.bearing for sign, mode in zip(signs, modes, strict=True)
        ]
        self.seen = np.zeros((2 * len(modes), 4))
        start = paper_initial_state(cut)
        self.state = np.zeros(2 * len(modes))
        for body, sign in ((0, 1.0), (2, -1.0)):
            own = [k for k in range(len(modes)) if signs[k] == sign]
            soft = sum(modes[k].chip ** 2 / modes[k].stiffness for k in own)
            light = sum(modes[k].chip ** 2 / modes[k].mass for k in own)
            for k in own:
                self.seen[2 * k, body] = self.seen[2 * k + 1, body + 1] = modes[k].chip
                self.state[2 * k] = start[body] * modes[k].chip / modes[k].stiffness / soft
                self.state[2 * k + 1] = start[body + 1] * modes[k].chip / modes[k].mass / light
        self.cutting_stiffness = machine.cutting_stiffness(cut.depth_of_cut)
        surface_speed = np.pi * cut.workpiece_diameter * cut.spindle_speed_rpm / 60.0
        self.process_damping = cut.process_damping * cut.depth_of_cut / surface_speed
        self.delay, self.clearance = cut.delay, cut.bearing_clearance
        self.feed = cut.feed if tool_leaves_cut else 0.0
        self.longest = self.delay / np.ceil(self.delay / step)
        self.offset = float(self.state[0::2] @ self.across)
        self.watched = []
        if cut.bearing_contact in {BearingContact.GAP, BearingContact.BOTH_SIDES}:
            self.watched.append('bearing')
        if cut.bearing_contact is BearingContact.BOTH_SIDES:
            self.watched.append('below')
        if tool_leaves_cut:
            self.watched.append('chip')
        self.engaged = {
            'bearing': cut.bearing_contact is BearingContact.SEATED
            or ('bearing' in self.watched and self._bearing(self.state) >= self.clearance),
            'below': 'below' in self.watched and self._bearing(self.state) <= -self.clearance,
            'chip': True,
        }
        self.events: list[Event] = []
        self.breaks = [(0.0, 0)]  # of the delayed surface: time at which it is met, order
        self.starts: list[float] = []
        self.lengths: list[float] = []
        self.surfaces: list[list[float]] = []

    def surface_before(self, t: float) -> float:
        """The surface left one turn before t, m."""
        t -= self.delay
        i = bisect_right(self.starts, t) - 1
        if i < 0:
            return self.offset
        x = (t - self.starts[i]) / self.lengths[i]
        result = 0.0
        for c in self.surfaces[i]:  # highest power first
            result = result * x + c
        return result

    def _bearing(self, state: Array) -> float:
        return float(state[0::2] @ self.at_bearing)

    def derivative(self, t: float, state: Array) -> list[float]:
        """Equations (8a) and (8b), of every mode."""
        values = state.tolist()
        force = push = 0.0
        if self.engaged['chip']:
            r = sum(c * x for c, x in zip(self.across, values[0::2], strict=True))
            rate = sum(c * v for c, v in zip(self.across, values[1::2], strict=True))
            force = self.cutting_stiffness * (self.feed + r - self.surface_before(t))
            force += self.process_damping * rate
        if self.engaged['bearing'] or self.engaged['below']:
            side = self.clearance if self.engaged['bearing'] else -self.clearance
            push = sum(c * x for c, x in zip(self.at_bearing, values[0::2], strict=True)) - side
        result = []
        for k, (stiffness, damping, on_force, on_bearing) in enumerate(self.modes):
            x, v = values[2 * k], values[2 * k + 1]
            result += [v, -stiffness * x - damping * v - on_force * force - on_bearing * push]
        return result

    def steps(self, end: float) -> Iterator[_Step]:
        """Every step up to `end`, from break to break and from event to event."""
        t, event, turn = 0.0, '', 1
        while t < end - _MERGE:
            order = self._passed(t)
            if turn * self.delay <= t + _MERGE:
                turn += 1
            stop = min(end, turn * self.delay)
            if self.breaks:
                stop = min(stop, self.breaks[0][0])
            self._break(t, order, event)
            event_time, event = stop, ''
            for step in self._integrate(t, stop):
                event_time, kind = self._first_event(step, passed=t == step.start)
                if kind:
                    event = kind
                    step = next(self._integrate(step.start, event_time))  # noqa: PLW2901
                self._remember(step)
                yield step
                if event:
                    break
            t = event_time if event else stop
            self.passed = event
            if event:
                self.engaged[event] = not self.engaged[event]
                self.events.append(Event(t, event, self.engaged[event]))

    passed = ''
    """The kind of the event at the start of the current stretch."""

    def _passed(self, t: float) -> int:
        """Take the breaks met at t from the heap; the lowest of their orders."""
        order = _ORDER + 1
        while self.breaks and self.breaks[0][0] <= t + _MERGE:
            order = min(order, heapq.heappop(self.breaks)[1])
        return order

    def _break(self, t: float, met: int, event: str) -> None:
        """Put the break that the surface left at t has, if any, on the heap for the next turn."""
        cutting = self.engaged['chip']
        order = met + 2 if cutting else met
        if event == 'chip':
            order = min(order, 1)
        elif event and cutting:
            order = min(order, 3)
        if order <= _ORDER:
            heapq.heappush(self.breaks, (t + self.delay, order))

    def _integrate(self, start: float, stop: float) -> Iterator[_Step]:
        length = stop - start
        solver = DOP853(
            self.derivative,
            start,
            self.state,
            stop,
            max_step=self.longest,
            first_step=min(self.longest, length),
            rtol=1e-12,
            atol=1e-18,
        )
        while solver.status == 'running':
            problem = solver.step()
            if problem:
                raise ArithmeticError(problem)
            t = solver.t_old
            nodes = solver.dense_output()(t + _NODES * (solver.t - t)).T
            yield _Step(t, solver.t - t, solver.y.copy(), _FIT @ nodes)

    def _remember(self, step: _Step) -> None:
        self.state = step.end_state
        if self.engaged['chip']:
            left = step.polynomials[:, 0::2] @ self.across
        else:
            left = self._surface_polynomial(step)
            left[0] -= self.feed
        self.starts.append(step.start)
        self.lengths.append(step.length)
        self.surfaces.append(left[::-1].tolist())

    def _surface_polynomial(self, step: _Step) -> Array:
        nodes = step.start + _NODES * step.length
        return _FIT @ np.array([self.surface_before(t) for t in nodes.tolist()])

    def _first_event(self, step: _Step, *, passed: bool) -> tuple[float, str]:
        """Time and kind of the first event within a step; the kind is empty without one."""
        found = []
        for kind in self.watched:
            if kind != 'chip':
                signal = step.polynomials[:, 0::2] @ self.at_bearing
                signal = signal if kind == 'bearing' else -signal
                signal[0] -= self.clearance
            else:
                signal = step.polynomials[:, 0::2] @ self.across
                signal = signal - self._surface_polynomial(step)
                signal[0] += self.feed
            if passed and self.passed == kind:
                signal = signal[1:]  # the zero at the start is the event just passed
            x = _first_change(signal if self.engaged[kind] else -signal)
            if x is not None:
                found.append((step.start + x * step.length, kind))
        return min(found, default=(0.0, ''))


def _first_change(signal: Array) -> float | None:
    """Where in (0, 1] a polynomial that starts positive first becomes negative, if anywhere."""
    if signal[0] > np.abs(signal[1:]).sum():
        return None
    turning = np.roots((signal[1:] * np.arange(1, len(signal)))[::-1])
    inner = turning.real[(np.abs(turning.imag) < 1e-9) & (turning.real > 0) & (turning.real < 1)]
    value = np.polynomial.Polynomial(signal)
    before = 0.0
    for x in [*np.sort(inner).tolist(), 1.0]:
        if value(x) <= 0.0:
            return float(brentq(value, before, x, xtol=1e-15)) if value(before) > 0.0 else x
        before = x
    return None
