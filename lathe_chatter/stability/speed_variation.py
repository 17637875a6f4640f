"""Stability under sinusoidal spindle speed variation: the dominant Floquet multiplier.

With the speed n (1 + A sin(2 pi f t)) the delay, the time since the spindle was one turn back,
is periodic with T = 1/f and so is the machine. Its state, the four displacements and velocities
with r = x_t - x_wp over the longest delay, is carried over one period; chatter grows where the
largest eigenvalue mu of that map lies outside the unit circle, at the rate ln|mu| / T.

The period is cut into equal elements. On each the machine is solved by Chebyshev collocation,
one matrix for all elements since only the delay varies, and r one turn back is interpolated in
the element where it was found: the error falls faster than any power of the element's order.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lathe_chatter.arrays import Array, Integers
from lathe_chatter.model import Cut, Machine
from lathe_chatter.stability.characteristic import CharacteristicEquation, checked

_ORDER = 16
_ELEMENT_PHASE = 5.0
"""Largest omega h of an element: with 16 nodes its interpolation errs by 1e-11."""
_HEADROOM = 1.2
_NEWTON_STEPS = 50
_KRYLOV_STEP = 20
_KRYLOV_TOLERANCE = 1e-13


@dataclass(frozen=True)
class Floquet:
    """How a disturbance grows from one period of the speed variation to the next.

    Attributes:
        multiplier: The eigenvalue mu of largest magnitude of the map over one period.
        period: T, s.
    """

    multiplier: complex
    period: float

    @property
    def growth_rate(self) -> float:
        """ln|mu| / T, 1/s: with a constant speed the real part of the rightmost root."""
        size = abs(self.multiplier)
        return math.log(size) / self.period if size > 0.0 else -math.inf


def floquet(machine: Machine, cut: Cut, *, seated: bool, refinement: int = 1) -> Floquet:
    """The dominant multiplier of a cut whose spindle speed varies.

    Args:
        machine: Tool, workpiece, bearing and material.
        cut: Mean speed, depth, amplitude and frequency of the variation.
        seated: Whether the workpiece rests on its bearing.
        refinement: Divides the elements, to check a result.

    Returns:
        The multiplier over one period of the variation.
    """
    depth = np.array([cut.depth_of_cut])
    return _multipliers(machine, cut, depth, seated=seated, refinement=refinement)[0]


def varied_growth_rates(
    machine: Machine,
    cut: Cut,
    spindle_speed_rpm: ArrayLike,
    depth_of_cut: ArrayLike,
    *,
    seated: bool,
) -> Array:
    """A stability chart under speed variation.

    Args:
        machine: Tool, workpiece, bearing and material.
        cut: Amplitude and frequency of the variation; its speed and depth are not used.
        spindle_speed_rpm: Mean spindle speeds (n,), rev/min.
        depth_of_cut: Depths w (m,), m.
        seated: Whether the workpiece rests on its bearing.

    Returns:
        Growth rates (m, n), 1/s.

    Raises:
        ParameterError: If a speed or depth is not allowed.
    """
    speeds = np.atleast_1d(checked('spindle_speed_rpm', spindle_speed_rpm))
    depths = np.atleast_1d(checked('depth_of_cut', depth_of_cut))
    rates = np.empty((depths.size, speeds.size))
    for column, rpm in enumerate(speeds.tolist()):
        at_speed = cut.with_changes(spindle_speed_rpm=rpm)
        found = _multipliers(machine, at_speed, depths, seated=seated, refinement=1)
        rates[:, column] = [one.growth_rate for one in found]
    return rates


class _Elements(NamedTuple):
    """One period in equal elements, and where each node finds the surface it meets.

    Attributes:
        length: h, s.
        behind: Elements that the longest delay reaches back.
        source: Number of the element one turn back, by element and node (elements, order).
        weights: Of that element's nodes (elements, order, order + 1).
    """

    length: float
    behind: int
    source: Integers
    weights: Array


def _multipliers(
    machine: Machine, cut: Cut, depths: Array, *, seated: bool, refinement: int
) -> list[Floquet]:
    """The dominant multipliers at one speed for several depths."""
    equation = CharacteristicEquation.of(machine, seated=seated)
    stiffness = np.array([machine.cutting_stiffness(float(depths.max()))])
    fastest = _HEADROOM * float(np.abs(equation.delay_free_roots(stiffness)).max())
    elements = _divide(cut, fastest * refinement)
    period = 1.0 / cut.speed_variation_frequency
    found = []
    for depth in depths.tolist():
        solution = _element_solution(machine, depth, elements.length, seated=seated)
        found.append(Floquet(dominant_eigenvalue(_period_map(elements, solution)), period))
    return found


def _divide(cut: Cut, fastest: float) -> _Elements:
    """Elements short enough for a frequency, rad/s, and for the shortest delay."""
    turns = cut.spindle_speed_rpm / 60.0
    amplitude, frequency = cut.speed_variation_amplitude, cut.speed_variation_frequency
    period = 1.0 / frequency
    shortest = 1.0 / (turns * (1.0 + amplitude))
    longest_element = min(_ELEMENT_PHASE / fastest, 0.95 * shortest)
    count = math.ceil(period / longest_element)
    length = period / count
    place = _nodes()[1:]
    now = (np.arange(count)[:, None] + place) * length

    def turned(time: Array) -> Array:
        # phi(t) / n; 1 - cos without cancellation.
        swing = np.sin(np.pi * frequency * time) ** 2 / (np.pi * frequency)
        angle: Array = time + amplitude * swing
        return angle

    before = now - 1.0 / turns
    target = turned(now) - 1.0 / turns
    for _ in range(_NEWTON_STEPS):
        speed = 1.0 + amplitude * np.sin(2.0 * np.pi * frequency * before)
        step = (turned(before) - target) / speed
        before -= step
        if np.abs(step).max() <= 1e-15 * period:
            break
    source = np.floor(before / length).astype(np.int64)
    weights = _interpolation(before / length - source)
    behind = int((np.arange(count)[:, None] - source).max())
    return _Elements(length, behind, source, weights)


def _nodes() -> Array:
    """The Chebyshev-Lobatto nodes of an element, from 0 to 1 (order + 1,)."""
    nodes: Array = np.sin(0.5 * np.pi * np.arange(_ORDER + 1) / _ORDER) ** 2
    return nodes


def _interpolation(place: Array) -> Array:
    """Barycentric weights of an element's nodes for points in 0..1 (..., order + 1)."""
    sign = (-1.0) ** np.arange(_ORDER + 1)
    sign[[0, -1]] *= 0.5
    away = place[..., None] - _nodes()
    hit = away == 0.0
    share = np.where(hit.any(axis=-1, keepdims=True), hit, sign / np.where(hit, 1.0, away))
    weights: Array = share / share.sum(axis=-1, keepdims=True)
    return weights


def _element_solution(machine: Machine, depth: float, length: float, *, seated: bool) -> Array:
    """r at the nodes and the state at the end, from the state at the start and the surface.

    Collocation of x' = A x + b u at all nodes but the first.

    Returns:
        A matrix (order + 4, 4 + order).
    """
    a, b, _ = machine.matrices(depth, seated=seated)
    nodes = _nodes()
    sign = (-1.0) ** np.arange(_ORDER + 1)
    sign[[0, -1]] *= 2.0
    derivative = np.outer(sign, 1.0 / sign)
    derivative /= nodes[:, None] - nodes + np.eye(_ORDER + 1)
    derivative -= np.diag(derivative.sum(axis=1))
    derivative /= length
    # Unknowns: the four states at the first node, the four at the second, and so on.
    system = np.kron(derivative[1:, 1:], np.eye(4)) - np.kron(np.eye(_ORDER), a)
    known = np.hstack((np.kron(-derivative[1:, :1], np.eye(4)), np.kron(np.eye(_ORDER), b[:, :1])))
    states = np.linalg.solve(system, known).reshape(_ORDER, 4, 4 + _ORDER)
    return np.vstack((states[:, 0] - states[:, 2], states[-1]))


def _period_map(elements: _Elements, solution: Array) -> Array:
    """The map of state and past r over one period.

    Its unknowns are the state and, for each element within the longest delay, r at all nodes
    but the last, which is the first of the next element.
    """
    behind = elements.behind
    size = 4 + behind * _ORDER
    count = len(elements.source)
    # r of an element, as linear forms of the unknowns, in the ring's slot `number % slots`.
    slots = behind + 1
    ring = np.zeros((slots, _ORDER + 1, size))
    past = np.arange(-behind, 0)
    ring[past % slots, :_ORDER] = np.eye(size)[4:].reshape(behind, _ORDER, size)
    state = np.eye(4, size)
    ring[past[:-1] % slots, -1] = ring[past[1:] % slots, 0]
    ring[-1 % slots, -1] = state[0] - state[2]
    for number in range(count):
        source = elements.source[number] % slots
        surface = np.einsum('jk,jkd->jd', elements.weights[number], ring[source])
        following = solution @ np.vstack((state, surface))
        ring[number % slots, 0] = state[0] - state[2]
        ring[number % slots, 1:] = following[:_ORDER]
        state = following[_ORDER:]
    last = np.arange(count - behind, count) % slots
    return np.vstack((state, ring[last, :_ORDER].reshape(-1, size)))


def dominant_eigenvalue(matrix: Array) -> complex:
    """The eigenvalue of largest magnitude, by Arnoldi's method with full orthogonalisation.

    Of one or two hundred dimensions only the outermost is wanted. `einsum` keeps to this
    thread: the library behind `@` may hand so small a product to others and wait for them.

    Args:
        matrix: (n, n).

    Returns:
        The eigenvalue, with imaginary part >= 0.
    """
    size = len(matrix)
    basis = np.zeros((size, size))
    projected = np.zeros((size, size))
    start = np.random.default_rng(0).standard_normal(size)
    basis[0] = start / np.sqrt(start @ start)
    for k in range(size):
        image = np.einsum('ij,j->i', matrix, basis[k])
        length = math.sqrt(image @ image)
        for _ in range(2):
            along = np.einsum('kj,j->k', basis[: k + 1], image)
            image -= np.einsum('kj,k->j', basis[: k + 1], along)
            projected[: k + 1, k] += along
        rest = math.sqrt(image @ image)
        exhausted = k + 1 == size or rest <= 1e-15 * length
        if exhausted or (k + 1) % _KRYLOV_STEP == 0:
            values, vectors = np.linalg.eig(projected[: k + 1, : k + 1])
            first = int(np.argmax(np.abs(values)))
            if exhausted or rest * abs(vectors[k, first]) <= _KRYLOV_TOLERANCE * abs(
                values[first]
            ):
                break
        projected[k + 1, k] = rest
        basis[k + 1] = image / rest
    return complex(values[first].real, abs(values[first].imag))
