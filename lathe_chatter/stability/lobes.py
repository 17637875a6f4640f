"""Stability lobes: every frequency of chatter with its depth and, for each lobe, its speed.

At the boundary s = i omega, and with theta = omega tau the characteristic equation says

    -1/G(i omega) = C w [1 - cos theta + i (sin theta + rho theta)],   rho = C_pd / (pi D C).

Without process damping (rho = 0) this is solved in closed form: C w = -1 / (2 Re G) and
theta = (pi + 2 arg G) mod 2 pi + 2 pi j with the number j = 0, 1, ... of the lobe. With it a
frequency has two phases in a lobe, or none: the lobes bend back at low speed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lathe_chatter.array_types import Array, Integers, ShortRepr
from lathe_chatter.model import Machine
from lathe_chatter.model.quantity_fields import Quantity
from lathe_chatter.stability.characteristic import (
    LEAST_DAMPING,
    NO_DAMPING,
    Complex,
    ProcessDamping,
    receptance,
    sections_of,
)
from lathe_chatter.stability.compiled_characteristic import BETA
from lathe_chatter.stability.critical_depth import frequency_grid

_HALVINGS = 60
_LOBES = Quantity('number of lobes', low=1.0, high=1e6)
_POINTS = Quantity('points of a lobe', low=2.0, high=1e7)
_DEPTH_LIMIT = Quantity('largest depth of the boundary', 'm', high=1e3, exclusive=True)


@dataclass(frozen=True, repr=False)
class LobeBoundary(ShortRepr):
    """Points of the stability boundary, one row for each lobe.

    Attributes:
        spindle_speed_rpm: rev/min (lobes, points).
        depth_of_cut: Critical depth w, m (lobes, points); without process damping one row
            repeated without a copy.
        lobe: Lobe number j, 0 at the highest speeds (lobes, points).
        angular_frequency: Of the chatter, rad/s (lobes, points).
    """

    spindle_speed_rpm: Array
    depth_of_cut: Array
    lobe: Integers
    angular_frequency: Array


def lobe_boundary(  # noqa: PLR0913 -- a machine, and how much of its boundary
    machine: Machine,
    *,
    seated: bool,
    process: ProcessDamping = NO_DAMPING,
    depth_limit: float = 0.005,
    lobes: int = 20,
    points: int = 500,
) -> LobeBoundary:
    """The first `lobes` lobes up to a depth, dense where the receptance turns fast.

    Args:
        machine: Tool, workpiece, bearing and material.
        seated: Whether the workpiece rests on its bearing.
        process: Process damping. With it a row goes along the lobe and back; what lies above
            the depth, or at a frequency that the lobe does not have, is nan.
        depth_limit: Points above this depth are left out, m.
        lobes: How many, from j = 0.
        points: Frequencies, the same for every lobe.

    Returns:
        The boundary; without points where every depth up to the limit is stable.

    Raises:
        ParameterError: If an argument is not allowed.
    """
    limit = _DEPTH_LIMIT.check('depth_limit', depth_limit)
    count = int(_LOBES.check('lobes', lobes))
    wanted = int(_POINTS.check('points', points))
    sections = sections_of(machine, seated=seated, least_damping=LEAST_DAMPING)
    stiffness = machine.cutting_stiffness(limit)
    grid = frequency_grid(sections, 0.0)
    if process.coefficient and stiffness:
        # At the very ends of a band the depth is 0/0.
        edges = bands(sections, grid, stiffness, damped=True)
        frequency = _spread(grid, edges, wanted + len(edges))
        frequency = frequency[~np.isin(frequency, edges)]
        return _damped(machine, process, sections, frequency, count, limit)
    frequency = _spread(grid, bands(sections, grid, stiffness, damped=False), wanted)
    response = receptance(sections, 1j * frequency)
    if stiffness:
        response.real = np.minimum(response.real, -0.5 / stiffness)  # at the very ends rounded
    depth = -0.5 / (machine.cutting_coefficient * response.real) if frequency.size else frequency
    number = np.arange(count)
    phase = echo_phase(response) + 2.0 * np.pi * number[:, None]
    shape = phase.shape
    np.divide(60.0 * frequency, phase, out=phase)
    return LobeBoundary(
        phase,
        np.broadcast_to(depth, shape),
        np.broadcast_to(number[:, None], shape),
        np.broadcast_to(frequency, shape),
    )


def crossing_frequencies(sections: Array, stiffness: float) -> Array:
    """The frequencies, rising, at which 2 C w Re G(i omega) = -1: the boundary at one depth.

    Args:
        sections: Of a machine with some damping.
        stiffness: C w, N/m.

    Returns:
        Angular frequencies, rad/s; two for each band of frequencies that the depth excites.
    """
    # Far above every mode G is that of a free mass, -1 / (mu omega^2).
    coupled = np.sqrt(2.0 * stiffness * np.abs(sections[:, BETA]).sum())
    return bands(sections, frequency_grid(sections, 2.0 * coupled), stiffness, damped=False)


def echo_phase(response: Complex) -> Array:
    """The phase omega tau, 0 to 2 pi, by which the surface lags: pi + 2 arg G."""
    lag: Array = np.mod(np.pi + 2.0 * np.angle(response), 2.0 * np.pi)
    return lag


def bands(sections: Array, grid: Array, stiffness: float, *, damped: bool) -> Array:
    """Where bands of frequencies with a depth below the limit begin and end, rising.

    Without process damping the depth is -1 / (2 C Re G). With it 1 - cos theta lies anywhere in
    0..2, so a frequency has a depth where 0 < -Re (1/G) < 2 C w.
    """

    def inside(omega: Array) -> Array:
        response = receptance(sections, 1j * omega)
        if not damped:
            return np.asarray(-1.0 - 2.0 * stiffness * response.real)
        needed = -(1.0 / response).real
        lower: Array = np.minimum(needed, 2.0 * stiffness - needed)
        return lower

    positive = inside(grid) > 0.0
    cell = np.flatnonzero(positive[1:] != positive[:-1])
    low, high, rising = grid[cell], grid[cell + 1], positive[cell + 1]
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        above = (inside(middle) > 0.0) == rising
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return 0.5 * (low + high)


def _spread(grid: Array, edges: Array, points: int) -> Array:
    """Frequencies inside the bands, as dense as the grid is there."""
    bands = edges.reshape(-1, 2) if edges.size % 2 == 0 else np.zeros((0, 2))
    share = points // max(len(bands), 1)
    parts = [np.zeros(0)]
    for low, high in bands:
        inside = grid[(grid > low) & (grid < high)]
        known = np.concatenate(([low], inside, [high]))
        parts.append(
            np.interp(np.linspace(0, known.size - 1, share), np.arange(known.size), known)
        )
    return np.concatenate(parts)


def _damped(  # noqa: PLR0913, PLR0917 -- the boundary's facts
    machine: Machine, process: ProcessDamping, sections: Array, frequency: Array, lobes: int,
    limit: float,
) -> LobeBoundary:  # fmt: skip
    """The boundary with process damping: there along one solution of the phase, back the other.

    With q = Im(1/G) / Re(1/G) the phase obeys rho theta - q + R cos(theta - phi) = 0, where
    R^2 = 1 + q^2 and tan phi = 1/q; it has one minimum in a lobe, and a zero on either side of
    it where that is negative.
    """
    rho = process.per_width_and_delay / machine.cutting_coefficient
    inverse = 1.0 / receptance(sections, 1j * frequency)
    q = inverse.imag / inverse.real
    begin = 2.0 * np.pi * np.arange(lobes)[:, None]

    def excess(theta: Array) -> Array:
        return np.asarray(np.sin(theta) + rho * theta - q * (1.0 - np.cos(theta)))

    with np.errstate(invalid='ignore'):
        lowest: Any = np.arctan2(1.0, q) + np.pi - np.arcsin(rho / np.hypot(1.0, q))
    lowest = begin + np.mod(lowest, 2.0 * np.pi)
    there = excess(lowest) < 0.0
    rows = []
    for outer in (begin + 1e-9, begin + 2.0 * np.pi):
        positive: Any = np.broadcast_to(outer, lowest.shape)
        negative: Any = lowest + 0.0
        for _ in range(_HALVINGS):
            middle = 0.5 * (positive + negative)
            above = excess(middle) > 0.0
            positive, negative = (
                np.where(above, middle, positive),
                np.where(above, negative, middle),
            )
        theta = np.where(there, 0.5 * (positive + negative), np.nan)
        depth = -inverse.real / (machine.cutting_coefficient * (1.0 - np.cos(theta)))
        theta = np.where(depth <= limit, theta, np.nan)
        rows.append((60.0 * frequency / theta, np.where(depth <= limit, depth, np.nan)))
    (speed, depth), (speed_back, depth_back) = rows
    shape = (lobes, 2 * frequency.size)
    return LobeBoundary(
        np.hstack((speed, speed_back[:, ::-1])),
        np.hstack((depth, depth_back[:, ::-1])),
        np.broadcast_to(np.arange(lobes)[:, None], shape),
        np.broadcast_to(np.concatenate((frequency, frequency[::-1])), shape),
    )
