"""The rightmost characteristic roots: does a cut chatter, how fast, at what frequency.

Newton's method starts from the modes and from every half turn of the delayed phase along the
imaginary axis, where the roots of a delay hang like beads. What it finds is then held against
the argument principle: no root may lie further right, else the search is repeated from a denser
field. So every answer is proven, and none needs an eigenproblem that grows with tau.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from lathe_chatter.array_types import Array, Integers
from lathe_chatter.compiled import compiled
from lathe_chatter.errors import UnprovenError
from lathe_chatter.model import Cut, Machine
from lathe_chatter.model.quantity_fields import Quantity
from lathe_chatter.stability.characteristic import (
    NO_DAMPING,
    Complex,
    Cuts,
    Machines,
    ProcessDamping,
)
from lathe_chatter.stability.compiled_characteristic import (
    BETA,
    DAMPING,
    STIFFNESS,
    inverse,
    newton_step,
    receptance_at,
)
from lathe_chatter.stability.root_count import count_right_of, count_to_the_right

_ITERATIONS = 12
_ITERATIONS_DENSE = 60
_ATTEMPTS = 8
"""Searches: the first quick one, four denser and denser, three that tell close roots less."""
_STRIP = 12.0
"""The first search gives up what wanders to Re s tau < -12: such a root is never rightmost."""
_MARGINS = (5e-13, 5e-11, 5e-9, 5e-7)
"""Re s may be beaten by this times |s|; above the first only where roots all but coincide."""
_ARRIVED = 1e-13
"""Relative length of a step from which on one more ends at rounding."""
_ROUNDING = 4.0 * float(np.finfo(float).eps)
_LEFT, _TURNS = 36.0, 4.0
"""The dense search looks at -Re s tau up to the logarithm of rounding, in the first turns."""
_NUDGE = 1e-8
"""Relative distance from a mode at which a search begins: at the mode itself D is 0 times inf."""
_SHARED = 1e-11
"""Relative distance of two poles within which Newton's method may miss the root between them."""
_COUNT = Quantity('number of roots', low=1.0, high=10000.0)
_NONE = complex(-math.inf, 0.0)


def rightmost_root(
    machine: Machine,
    spindle_speed_rpm: float,
    depth_of_cut: float,
    *,
    seated: bool,
    process: ProcessDamping = NO_DAMPING,
) -> complex:
    """The rightmost characteristic root: growth rate + i chatter angular frequency.

    Args:
        machine: Tool, workpiece, bearing and material.
        spindle_speed_rpm: Spindle speed, rev/min.
        depth_of_cut: w, m; 0 gives the least damped mode.
        seated: Whether the workpiece rests on its bearing (the screening function is 1).
        process: Process damping.

    Returns:
        The root with the largest real part, 1/s, with imaginary part >= 0, rad/s.

    Raises:
        ParameterError: If speed or depth is not allowed.
    """
    found = rightmost_roots(
        machine, spindle_speed_rpm, depth_of_cut, seated=seated, process=process
    )
    return complex(found)


def root_of(machine: Machine, cut: Cut, *, seated: bool) -> complex:
    """`rightmost_root` of a cut, with its process damping.

    Args:
        machine: Tool, workpiece, bearing and material.
        cut: Speed, depth and process damping.
        seated: Whether the workpiece rests on its bearing.
    """
    return rightmost_root(
        machine,
        cut.spindle_speed_rpm,
        cut.depth_of_cut,
        seated=seated,
        process=ProcessDamping.of(cut),
    )


def rightmost_roots(
    machine: Machines,
    spindle_speed_rpm: ArrayLike,
    depth_of_cut: ArrayLike,
    *,
    seated: bool,
    process: ProcessDamping = NO_DAMPING,
    proven: bool = True,
) -> Complex:
    """The rightmost roots of many cuts, each proven to be the rightmost.

    Args:
        machine: Tool, workpiece, bearing and material; one, or an array of several.
        spindle_speed_rpm: Spindle speeds of any shape, rev/min.
        depth_of_cut: Depths w, m; machines, speeds and depths broadcast.
        seated: Whether the workpiece rests on its bearing.
        process: Process damping.
        proven: False leaves out the proof, which takes half of the time: for the coarse part of
            a search.

    Returns:
        Growth rate + i angular frequency, 1/s and rad/s, in the broadcast shape.

    Raises:
        ParameterError: If a speed or depth is not allowed.
        UnprovenError: If a root could not be proven to be the rightmost.
    """
    cuts = Cuts.of(machine, spindle_speed_rpm, depth_of_cut, seated=seated, process=process)
    roots = np.empty(cuts.delay.size, complex)
    _rightmost_of_all(
        cuts.sections, cuts.modes, cuts.machine, cuts.stiffness, cuts.damping, cuts.delay,
        proven, roots,
    )  # fmt: skip
    if np.isnan(roots).any():
        places = np.isnan(roots)
        rpm, most = 60.0 / cuts.delay[places][0], int(places.sum())
        raise UnprovenError(
            f'The rightmost root of {most} of {roots.size} cuts, one at {rpm:.6g} rev/min,'
        )
    return roots.reshape(cuts.shape)


def leading_roots(
    machine: Machine,
    spindle_speed_rpm: float,
    depth_of_cut: float,
    *,
    seated: bool,
    process: ProcessDamping = NO_DAMPING,
    count: int = 6,
) -> Complex:
    """The `count` rightmost roots in the upper half plane, rightmost first.

    Args:
        machine: Tool, workpiece, bearing and material.
        spindle_speed_rpm: Spindle speed, rev/min.
        depth_of_cut: w, m. With 0 there are no more roots than modes.
        seated: Whether the workpiece rests on its bearing.
        process: Process damping.
        count: How many; of a conjugate pair one is counted.

    Returns:
        Roots with imaginary part >= 0 (count,), 1/s and rad/s; fewer where fewer exist.

    Raises:
        ParameterError: If an argument is not allowed.
        UnprovenError: If the roots found do not agree with their number.
    """
    wanted = int(_COUNT.check('count', count))
    cuts = Cuts.of(machine, spindle_speed_rpm, depth_of_cut, seated=seated, process=process)
    facts = (cuts.sections[0], cuts.modes[0], cuts.stiffness[0], cuts.damping[0], cuts.delay[0])
    for density in (1, 2, 4, 8):
        seeds = _dense_seeds(*facts, density, wanted)
        roots = _distinct(_arrived(*facts, seeds), wanted)
        if roots.size == 0:
            continue
        margin = _MARGINS[1] * np.abs(roots).max()
        expected = np.where(roots.imag > 0.0, 2, 1).sum()
        if count_right_of(cuts, np.array([roots[-1].real - margin]))[0] == expected:
            return roots
    raise UnprovenError(f'Each of the {wanted} leading roots')


def _distinct(points: Complex, count: int) -> Complex:
    """The first `count` points, each once, in the upper half plane, the rightmost first."""
    height = np.abs(points.imag)
    upper = points.real + 1j * np.where(height > 1e-9 * np.abs(points), height, 0.0)
    upper = upper[np.argsort(-upper.real)]
    kept: list[complex] = []
    for point in upper.tolist():
        if all(abs(point - other) > 1e-8 * abs(other) for other in kept):
            kept.append(point)
        if len(kept) == count:
            break
    return np.array(kept, complex)


@compiled(nogil=True)
def _rightmost_of_all(
    sections: Array, modes: Integers, machine: Integers, stiffness: Array, damping: Array,
    delay: Array, proven: bool, roots: Complex,
) -> None:  # fmt: skip
    """`_rightmost` of many cuts; nan where it could not be proven."""
    for cut in range(len(delay)):
        which = machine[cut]
        roots[cut] = _rightmost(
            sections[which], modes[which], stiffness[cut], damping[cut], delay[cut], proven
        )


@compiled(inner=True)
def _rightmost(
    sections: Array, modes: int, stiffness: float, damping: float, delay: float, proven: bool
) -> complex:
    """The rightmost root of a cut."""
    if stiffness == 0.0 and damping == 0.0:
        return _rightmost_mode(sections, modes)
    best = _quick_search(sections, modes, stiffness, damping, delay)
    for attempt in range(_ATTEMPTS):
        if best.real > -math.inf:
            if not proven:
                return best
            margin = _MARGINS[max(attempt - 4, 0)]
            line = best.real + margin * abs(best)
            if count_to_the_right(sections, modes, stiffness, damping, delay, line) == 0:
                return best
        if attempt < 4:
            seeds = _dense_seeds(sections, modes, stiffness, damping, delay, 2**attempt, 0)
            for root in _arrived(sections, modes, stiffness, damping, delay, seeds):
                if root.real > best.real:
                    best = complex(root.real, abs(root.imag))
    return complex(math.nan, math.nan)


@compiled(borrows=True, inner=True)
def _rightmost_mode(sections: Array, modes: int) -> complex:
    """The least damped mode of a machine that does not cut."""
    best = _NONE
    for j in range(modes):
        pole = _pole(sections, j)
        if pole.real > best.real:
            best = pole
    return best


@compiled(inline=True, borrows=True, inner=True)
def _pole(sections: Array, j: int) -> complex:
    """The zero of a section's denominator in the upper half plane, or its right one."""
    half = 0.5 * sections[j, DAMPING]
    rest = half * half - sections[j, STIFFNESS]
    if rest > 0.0:
        return complex(-half + math.sqrt(rest), 0.0)
    return complex(-half, math.sqrt(-rest))


@compiled(borrows=True, inner=True)
def _shared_pole(sections: Array, modes: int) -> complex:
    """The rightmost pole that two sections all but share, which is a root; -inf without one.

    The force drives the two as one mode, and they can move against each other without any. D is 0
    times inf there, so that Newton's method may not arrive. The root lies between the two, nearer
    to the one that yields less to the force.
    """
    best = _NONE
    for j in range(modes):
        pole = _pole(sections, j)
        for other in range(j):
            apart = _pole(sections, other) - pole
            if abs(apart.real) + abs(apart.imag) > _SHARED * abs(pole):
                continue
            both = sections[j, BETA] + sections[other, BETA]
            root = pole + apart * (sections[j, BETA] / both) if both != 0.0 else pole
            if root.real > best.real:
                best = root
    return best


@compiled(borrows=True, inner=True)
def _highest(sections: Array, modes: int, stiffness: float, damping: float, delay: float) -> float:
    """An angular frequency above which no root is of interest, rad/s."""
    natural, coupled = 0.0, 0.0
    for j in range(modes):
        natural = max(natural, sections[j, STIFFNESS])
        coupled += abs(sections[j, BETA])
    return 1.1 * math.sqrt(natural + stiffness * coupled) + damping * coupled + math.pi / delay


@compiled(borrows=True, inner=True)
def _newton(
    sections: Array, modes: int, stiffness: float, damping: float, delay: float, s: complex,
    iterations: int, strip: float,
) -> complex:  # fmt: skip
    """The root to which Newton's method goes from a point; -inf where it does not arrive."""
    for _ in range(iterations):
        step = newton_step(sections, modes, stiffness, damping, delay, s)
        s -= step
        moved = abs(step.real) + abs(step.imag)
        if not moved < math.inf or s.real * delay <= -strip:
            return _NONE
        tolerance = max(_ARRIVED, _ROUNDING)
        if moved <= tolerance * (abs(s.real) + abs(s.imag)):
            s -= newton_step(sections, modes, stiffness, damping, delay, s)
            return complex(s.real, abs(s.imag))
    return _NONE


@compiled(borrows=True, inner=True)
def _quick_search(
    sections: Array, modes: int, stiffness: float, damping: float, delay: float
) -> complex:
    """The rightmost of the roots found from the modes, and from each half turn of the phase."""
    best = _shared_pole(sections, modes)
    for j in range(modes):
        for coupled in (0.0, 1.0):
            pole = _pole(sections, j)
            shifted = coupled * stiffness * sections[j, BETA] / sections[j, STIFFNESS]
            seed = pole * (math.sqrt(max(1.0 + shifted, 0.1)) + _NUDGE)
            root = _newton(sections, modes, stiffness, damping, delay, seed, _ITERATIONS, _STRIP)
            if root.real > best.real:
                best = root
    turn = math.pi / delay
    count = math.ceil(_highest(sections, modes, stiffness, damping, delay) / turn)
    for k in range(count):
        seed = complex(0.0, (k + 0.5) * turn)
        root = _newton(sections, modes, stiffness, damping, delay, seed, _ITERATIONS, _STRIP)
        if root.real > best.real:
            best = root
    return best


@compiled()
def _dense_seeds(
    sections: Array, modes: int, stiffness: float, damping: float, delay: float, density: int,
    beyond: int,
) -> Complex:  # fmt: skip
    """More seeds: also along the curve |e^(-s tau)| = |1 + (1/G + R s)/K| of far roots."""
    turn = math.pi / delay
    count = math.ceil(_highest(sections, modes, stiffness, damping, delay) / turn) + 2 * beyond
    count *= density
    left, up = int(_LEFT) * density, int(2.0 * _TURNS)
    seeds = np.empty(3 * modes + 2 * count + left * up, np.complex128)
    place = 0
    for j in range(modes):
        pole = _pole(sections, j)
        shifted = stiffness * sections[j, BETA] / sections[j, STIFFNESS]
        for factor in (1.0, 0.5, math.sqrt(max(1.0 + shifted, 0.1))):
            seeds[place] = pole * (factor + _NUDGE)
            place += 1
    for k in range(count):
        on_axis = complex(0.0, (k + 0.5) * turn / density)
        seeds[place] = on_axis
        force = inverse(receptance_at(sections, modes, on_axis)) + damping * on_axis
        decay = math.log(abs(1.0 + force / stiffness)) / delay if stiffness > 0.0 else 0.0
        seeds[place + 1] = on_axis - (decay if math.isfinite(decay) else 0.0)
        place += 2
    # And a lattice behind the first turns, for real roots and what the modes push far left.
    for j in range(left):
        for k in range(up):
            seeds[place] = complex(-j / (density * delay), k * turn)
            place += 1
    return seeds


@compiled()
def _arrived(
    sections: Array, modes: int, stiffness: float, damping: float, delay: float, seeds: Complex
) -> Complex:
    """The roots to which Newton's method goes from many points."""
    roots = np.empty(len(seeds) + 1, np.complex128)
    roots[0] = _shared_pole(sections, modes)
    count = int(roots[0].real > -math.inf)
    for seed in seeds:
        root = _newton(
            sections, modes, stiffness, damping, delay, seed, _ITERATIONS_DENSE, math.inf
        )
        if root.real > -math.inf:
            roots[count] = root
            count += 1
    return roots[:count]
