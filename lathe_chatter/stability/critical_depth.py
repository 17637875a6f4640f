"""The depth of cut from which on chatter grows: the least at which a root reaches the axis.

With s = i omega the characteristic equation says that H(omega) = -1/w, where

    H = [C (1 - e^(-i omega tau)) + i omega C_pd tau / (pi D)] G(i omega)

is the response to a unit of depth. So the negative real values of H are looked for, on a grid
that follows every mode and every turn of the delay, and the largest of them counts.
"""

from __future__ import annotations

import cmath
import math

import numpy as np
from numpy.typing import ArrayLike

from lathe_chatter.array_types import Array, Integers
from lathe_chatter.compiled import compiled
from lathe_chatter.model import Machine
from lathe_chatter.stability.characteristic import (
    LEAST_DAMPING,
    NO_DAMPING,
    Cuts,
    Machines,
    ProcessDamping,
)
from lathe_chatter.stability.compiled_characteristic import DAMPING, STIFFNESS, receptance_at

_NEAR_MODE = 0.15
"""Step of the grid of frequencies, as a part of the distance to the nearest mode."""
_ANTINODE = 0.05
"""The same as a part of the frequency, at most: G may be small and turn fast between modes."""
_PHASE_STEP = 0.3
"""Largest step of the delayed phase within which H crosses the real axis at most once, rad."""
_SLACK = 1.1
"""By which the receptance inside a step of the grid may exceed that at its ends."""
_HALVINGS = 100
_MOST_FREQUENCIES = 100_000


def critical_depth(
    machine: Machine,
    spindle_speed_rpm: float,
    *,
    seated: bool,
    process: ProcessDamping = NO_DAMPING,
) -> float:
    """The depth of cut from which on chatter grows at this spindle speed.

    Args:
        machine: Tool, workpiece, bearing and material.
        spindle_speed_rpm: Spindle speed, rev/min.
        seated: Whether the workpiece rests on its bearing.
        process: Process damping.

    Returns:
        The smallest w at which a root reaches the imaginary axis, m; infinite for a material
        that needs no force, next to 0 where any cut excites a mode without damping.

    Raises:
        ParameterError: If the speed is not allowed.
    """
    return float(critical_depths(machine, spindle_speed_rpm, seated=seated, process=process))


def critical_depths(
    machine: Machines,
    spindle_speed_rpm: ArrayLike,
    *,
    seated: bool,
    process: ProcessDamping = NO_DAMPING,
) -> Array:
    """`critical_depth` at spindle speeds of any shape, also of an array of machines.

    Raises:
        ParameterError: If a speed is not allowed.
    """
    cuts = Cuts.of(
        machine, spindle_speed_rpm, None, seated=seated, process=process,
        least_damping=LEAST_DAMPING,
    )  # fmt: skip
    depths = np.full(cuts.delay.size, math.inf)
    order = np.argsort(cuts.machine, kind='stable')
    bounds = np.searchsorted(cuts.machine[order], np.arange(len(cuts.modes) + 1))
    for which, modes in enumerate(cuts.modes.tolist()):
        here = order[bounds[which] : bounds[which + 1]]
        if not here.size:
            continue
        sections = cuts.sections[which, :modes]
        shortest = float(cuts.delay[here].min())
        grid = frequency_grid(sections, 4.0 * math.pi / shortest)
        most, real = _bounds(sections, modes, grid)
        steps = np.argsort(-real)  # by NumPy: Numba's sort takes a second to compile
        _depths(
            sections, modes, grid, most, real, steps,
            cuts.stiffness, cuts.damping, cuts.delay, here, depths,
        )  # fmt: skip
    return depths.reshape(cuts.shape)


def frequency_grid(sections: Array, beyond: float) -> Array:
    """Angular frequencies between which G turns little, to `beyond` past twice the last mode."""
    return np.asarray(_grid(sections, len(sections), beyond))


@compiled()
def _grid(sections: Array, modes: int, beyond: float) -> Array:
    """`frequency_grid`."""
    highest, lowest = 0.0, math.inf
    for j in range(modes):
        highest = max(highest, sections[j, STIFFNESS])
        lowest = min(lowest, sections[j, STIFFNESS])
    end = 2.0 * math.sqrt(highest) + beyond
    grid = np.empty(_MOST_FREQUENCIES)
    omega, count = 0.01 * math.sqrt(lowest), 0
    while omega < end and count < _MOST_FREQUENCIES - 1:
        grid[count] = omega
        count += 1
        step = _ANTINODE * omega
        for j in range(modes):
            half = 0.5 * sections[j, DAMPING]
            height = math.sqrt(max(sections[j, STIFFNESS] - half * half, 0.0))
            away = abs(omega - height)
            near = _NEAR_MODE * math.sqrt(away * away + half * half)
            if omega < height:
                near = min(near, max(away, _NEAR_MODE * half))  # a point at the mode itself
            step = min(step, near)
        omega += step
    grid[count] = end
    return grid[: count + 1]


@compiled(nogil=True)
def _bounds(sections: Array, modes: int, grid: Array) -> tuple[Array, Array]:
    """The largest |G|, and the largest -Re G, that each step of the grid may have."""
    count = len(grid) - 1
    response = np.empty(count + 1, np.complex128)
    for k in range(count + 1):
        response[k] = receptance_at(sections, modes, complex(0.0, grid[k]))
    most, real = np.empty(count), np.empty(count)
    for k in range(count):
        most[k] = _SLACK * max(abs(response[k]), abs(response[k + 1]))
        least = min(response[k].real, response[k + 1].real)
        real[k] = -least + (_SLACK - 1.0) * most[k]
    return most, real


@compiled(nogil=True)
def _depths(
    sections: Array, modes: int, grid: Array, most: Array, real: Array, order: Integers,
    stiffness: Array, damping: Array, delay: Array, wanted: Integers, depths: Array,
) -> None:  # fmt: skip
    """The critical depths of the wanted cuts of one machine."""
    for cut in wanted:
        depths[cut] = _depth(
            sections, modes, grid, most, real, order, stiffness[cut], damping[cut], delay[cut]
        )


@compiled(borrows=True, inner=True)
def _depth(
    sections: Array, modes: int, grid: Array, most: Array, real: Array, order: Integers,
    stiffness: float, damping: float, delay: float,
) -> float:  # fmt: skip
    """The critical depth of one cut: the most promising steps of the grid first."""
    best = math.inf
    if stiffness == 0.0:
        return best
    for k in order:
        # Without process damping -1/w is 2 C Re G.
        bound = 2.0 * stiffness * real[k]
        if damping > 0.0:
            bound = (2.0 * stiffness + damping * grid[k + 1]) * most[k]
        if bound * best <= 1.0:
            if damping > 0.0:
                continue
            break
        low, high = grid[k], grid[k + 1]
        parts = math.ceil((high - low) * delay / _PHASE_STEP)
        width = (high - low) / parts
        left = low
        at_left = _response(sections, modes, stiffness, damping, delay, left)
        for part in range(parts):
            right = high if part == parts - 1 else low + (part + 1) * width
            at_right = _response(sections, modes, stiffness, damping, delay, right)
            if (at_left.imag >= 0.0) != (at_right.imag >= 0.0) and (
                at_left.real < 0.0 or at_right.real < 0.0
            ):
                value = _crossing(
                    sections, modes, stiffness, damping, delay, left, at_left, right, at_right
                )
                if value * best < -1.0:
                    best = -1.0 / value
            left, at_left = right, at_right
    return best


@compiled(inline=True, borrows=True, inner=True)
def _response(
    sections: Array, modes: int, stiffness: float, damping: float, delay: float, omega: float
) -> complex:
    """H(omega)."""
    s = complex(0.0, omega)
    force = stiffness * (1.0 - cmath.exp(-delay * s)) + damping * s
    return force * receptance_at(sections, modes, s)


@compiled(borrows=True, inner=True)
def _crossing(
    sections: Array, modes: int, stiffness: float, damping: float, delay: float, left: float,
    at_left: complex, right: float, at_right: complex,
) -> float:  # fmt: skip
    """H where it crosses the real axis between two frequencies: secants kept inside brackets."""
    rising = at_right.imag >= 0.0
    low, low_value, high, high_value = left, at_left.imag, right, at_right.imag
    value, last = at_left.real, 0
    for _ in range(_HALVINGS):
        # Illinois: the end that stays counts for half, so that it moves too.
        omega = high - high_value * (high - low) / (high_value - low_value)
        if not low < omega < high:
            omega = 0.5 * (low + high)
        there = _response(sections, modes, stiffness, damping, delay, omega)
        value = there.real
        if there.imag == 0.0 or high - low <= 4e-16 * high:
            break
        if (there.imag >= 0.0) == rising:
            closed = high - omega
            high, high_value = omega, there.imag
            if last == 1:
                low_value *= 0.5
            last = 1
        else:
            closed = omega - low
            low, low_value = omega, there.imag
            if last == -1:
                high_value *= 0.5
            last = -1
        if closed <= 1e-15 * omega:
            break
    return value
