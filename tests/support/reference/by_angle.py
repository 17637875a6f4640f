"""The linear machine with the spindle angle as the independent variable, by DOP853.

Against angle the regenerative delay is one revolution whatever the speed does, so the method of
steps needs no search for the time at which the spindle was one turn back: time itself becomes a
fifth state with dt/dphi = 1/Omega(t). Nothing of the solver's bookkeeping is shared.

The tool must stay in the cut and the bearing in one state (contact `none` or `seated`).
"""

from __future__ import annotations

import itertools
from bisect import bisect_right
from collections.abc import Callable, Sequence

import numpy as np
from scipy.integrate import OdeSolution, solve_ivp

from lathe_chatter.array_types import Array
from lathe_chatter.model import Cut, Machine

_BREAK_TURNS = 8
"""A corner is a jump two derivatives higher every turn: then DOP853 does not feel it."""


class Past:
    """States and time against angle, before and after the start."""

    def __init__(self, first_speed: float, offset: float) -> None:
        """Before angle 0 the spindle turns at `first_speed` (rev/s) and r is `offset`."""
        self._first_speed, self._offset = first_speed, offset
        self._starts: list[float] = []
        self._parts: list[OdeSolution] = []

    def add(self, start: float, part: OdeSolution) -> None:
        """Go on with a solution from angle `start`, rev."""
        self._starts.append(start)
        self._parts.append(part)

    def at(self, angle: float) -> Array:
        """Tool and workpiece displacement and velocity, and time (5,)."""
        k = bisect_right(self._starts, angle) - 1
        return np.array(self._parts[k](angle))

    def time_and_r(self, angle: float) -> tuple[float, float]:
        """Time, s, and r = x_t - x_wp, m, at an angle of the past."""
        if angle <= 0.0:
            return angle / self._first_speed, self._offset
        state = self.at(angle)
        return float(state[4]), float(state[0] - state[2])


def solve(
    machine: Machine,
    cut: Cut,
    start: Array,
    speed: Sequence[tuple[float, Callable[[float], float]]],
    turns: float,
    *,
    tool_leaves_cut: bool,
) -> Past:
    """Cut for `turns` revolutions.

    Args:
        machine: The machine.
        cut: Depth, clearance, contact and feed; its speed is not looked at.
        start: State at t = 0 (4,).
        speed: Stretches of the law of speed: from which angle, rev, and Omega(t), rev/s, which
            is smooth within a stretch. The first begins at angle 0.
        turns: How far, rev.
        tool_leaves_cut: Whether the force contains the feed, as equation (2) does not.
    """
    seated = cut.bearing_contact.value == 'seated'
    tool, workpiece = machine.tool, machine.workpiece
    bearing = machine.bearing_stiffness if seated else 0.0
    stiffness = machine.cutting_stiffness(cut.depth_of_cut)
    feed_speed = cut.feed_speed if tool_leaves_cut else 0.0
    past = Past(speed[0][1](0.0), start[0] - start[2])

    def motion(angle: float, state: Array, omega: Callable[[float], float]) -> list[float]:
        x, v, y, w, t = state
        then, r_then = past.time_and_r(angle - 1.0)
        force = stiffness * (feed_speed * (t - then) + x - y - r_then)
        on_tool = -tool.damping * v - tool.stiffness * x - force
        on_workpiece = -workpiece.damping * w - workpiece.stiffness * y + force
        on_workpiece -= bearing * (y - cut.bearing_clearance)
        per_angle = 1.0 / omega(t)
        return [
            v * per_angle,
            on_tool / tool.mass * per_angle,
            w * per_angle,
            on_workpiece / workpiece.mass * per_angle,
            per_angle,
        ]

    ends = _ends([angle for angle, _ in speed], turns)
    state = np.array([*start, 0.0])
    for begin, end in itertools.pairwise(ends):
        _, law = [entry for entry in speed if entry[0] <= begin + 1e-12][-1]
        part = solve_ivp(
            motion, (begin, end), state, 'DOP853', dense_output=True, args=(law,),
            rtol=1e-12, atol=1e-17, max_step=0.02,
        )  # fmt: skip
        state = part.y[:, -1]
        past.add(begin, part.sol)
    return past


def _ends(changes: Sequence[float], turns: float) -> list[float]:
    """The angles between which everything is smooth enough."""
    breaks = {float(turns)}
    breaks |= {angle + k for angle in changes for k in range(_BREAK_TURNS)}
    breaks |= {float(k) for k in range(int(turns) + 1)}  # delays reach back one stretch at most
    inside = sorted(angle for angle in breaks if angle <= turns)
    return [inside[0]] + [b for a, b in itertools.pairwise(inside) if b - a > 1e-12]
