"""The map of a disturbance over a period of a varying spindle speed, as what it does to a vector.

The period is cut into equal elements. On each the modes are solved by Chebyshev collocation for
the cutting force at its nodes, which follows from the surface that was left one turn back. The
map is never written out, so memory is that of one turn. Growth is measured from a rate near the
expected one, so nothing overflows.
"""

from __future__ import annotations

import math
from enum import Enum
from typing import NamedTuple

import numpy as np

from lathe_chatter.array_types import Array, Integers
from lathe_chatter.compiled import compiled
from lathe_chatter.errors import ParameterError
from lathe_chatter.model import Cut, Machine
from lathe_chatter.model.quantity_fields import check_choice
from lathe_chatter.stability.characteristic import ProcessDamping, sections_of
from lathe_chatter.stability.compiled_characteristic import BETA, STIFFNESS

ORDER = 16
_ELEMENT_PHASE = 5.0
"""Largest omega h of an element: with 16 nodes its interpolation errs by 1e-11."""
_HEADROOM = 1.2
_NEWTON_STEPS = 50
_TURNS_AT_ONCE = 4.0
"""Turns that the map covers at least: over a part of one it would be little but a shift."""
_MOST_ELEMENTS = 200_000
"""In one map: beyond, it would take minutes."""
_RESCALED = 64
"""Elements after which the warm-up scales its numbers back."""


class SpeedLaw(str, Enum):
    """What swings as a sine where a spindle speed is varied."""

    SPEED = 'speed'
    """The spindle's speed, as a drive makes it; the delay follows."""
    DELAY = 'delay'
    """The delay, as most of the literature has it."""


class Elements(NamedTuple):
    """A period, or several, in equal elements, and where each node finds the surface it meets.

    Attributes:
        length: h, s.
        period: Elements of one period.
        total: Elements of the map.
        behind: Elements that the longest delay reaches back.
        source: Number of the element one turn back, by element of a period and node
            (period, order).
        weights: Of that element's nodes (period, order, order + 1).
        delay: From there to the node (period, order), s.
        turn: Time of a turn at the speed that the spindle has at the node (period, order), s.
    """

    length: float
    period: int
    total: int
    behind: int
    source: Integers
    weights: Array
    delay: Array
    turn: Array

    def size(self, element: Element) -> int:
        """Of the vector that is carried."""
        return len(element.across) + self.behind * ORDER


def divide(
    machine: Machine,
    cut: Cut,
    deepest: float,
    law: SpeedLaw | str,
    refinement: int,
    *,
    seated: bool,
) -> Elements:
    """Elements short enough for the machine, rad/s, and for the shortest delay.

    Raises:
        ParameterError: If there are more of them than anyone would wait for, or the law is none.
    """
    law = check_choice('law', law, SpeedLaw)
    sections = sections_of(machine, seated=seated)
    coupled = machine.cutting_stiffness(deepest) * np.abs(sections[:, BETA]).sum()
    fastest = _HEADROOM * math.sqrt(float(sections[:, STIFFNESS].max() + coupled)) * refinement
    amplitude, frequency = cut.speed_variation_amplitude, cut.speed_variation_frequency
    swing = amplitude if law is SpeedLaw.SPEED else 0.0
    shortest = cut.delay / (1.0 + amplitude) if swing else cut.delay * (1.0 - amplitude)
    longest_element = min(_ELEMENT_PHASE / fastest, 0.95 * shortest)
    period = 1.0 / frequency
    count: int = math.ceil(period / longest_element)
    periods = max(1, math.ceil(_TURNS_AT_ONCE * cut.delay / period))
    if count * periods > _MOST_ELEMENTS:
        slowest = count * frequency / _MOST_ELEMENTS
        allowed = (
            f'at least {slowest:.2g} Hz for this machine, for it moves at {fastest:.0f} rad/s'
        )
        if periods > 1:
            allowed = 'lower, or the spindle faster: a turn is too long for a machine so fast'
        raise ParameterError('speed_variation_frequency', frequency, 'Hz', allowed)
    length = period / count
    now = (np.arange(count)[:, None] + _nodes()[1:]) * length
    if law is SpeedLaw.DELAY:
        delay = cut.delay * (1.0 + amplitude * np.sin(2.0 * np.pi * frequency * now))
        turn = delay
    else:
        delay = _delay(cut, now)
        turn = cut.delay / (1.0 + amplitude * np.sin(2.0 * np.pi * frequency * now))
    before = now - delay
    source = np.floor(before / length).astype(np.int64)
    weights = _interpolation(before / length - source)
    behind = int((np.arange(count)[:, None] - source).max())
    return Elements(length, count, count * periods, behind, source, weights, delay, turn)


def _delay(cut: Cut, now: Array) -> Array:
    """The time since the spindle was one turn back, s."""
    amplitude, frequency = cut.speed_variation_amplitude, cut.speed_variation_frequency

    def turned(time: Array) -> Array:
        # phi(t) / n; 1 - cos without cancellation.
        swing = np.sin(np.pi * frequency * time) ** 2 / (np.pi * frequency)
        angle: Array = time + amplitude * swing
        return angle

    before = now - cut.delay
    target = turned(now) - cut.delay
    for _ in range(_NEWTON_STEPS):
        speed = 1.0 + amplitude * np.sin(2.0 * np.pi * frequency * before)
        step = (turned(before) - target) / speed
        before -= step
        if np.abs(step).max() <= 1e-15 / frequency:
            break
    delay: Array = now - before
    return delay


def _nodes() -> Array:
    """The Chebyshev-Lobatto nodes of an element, from 0 to 1 (order + 1,)."""
    nodes: Array = np.sin(0.5 * np.pi * np.arange(ORDER + 1) / ORDER) ** 2
    return nodes


def _interpolation(place: Array) -> Array:
    """Barycentric weights of an element's nodes for points in 0..1 (..., order + 1)."""
    sign = (-1.0) ** np.arange(ORDER + 1)
    sign[[0, -1]] *= 0.5
    weights: Array = place[..., None] - _nodes()
    row, node = np.nonzero((weights == 0.0).any(axis=-1)), np.argmin(np.abs(weights), axis=-1)
    with np.errstate(divide='ignore', invalid='ignore'):
        np.divide(sign, weights, out=weights)
        weights /= weights.sum(axis=-1, keepdims=True)
    weights[row] = np.eye(ORDER + 1)[node[row]]  # a place that is a node
    return weights


class Element(NamedTuple):
    """What a machine does on an element, with growth measured from a rate.

    Attributes:
        step: r at the nodes and the state at the end, from r one turn back of the nodes and the
            state at the start, by element of a period or one for all; transposed, so that many
            results are added up at once (period or 1, order + states, order + states).
        across: r from the state (states,).
        echo: e^(-rate tau) of the surface at each node (period, order).
    """

    step: Array
    across: Array
    echo: Array


def element_of(
    machine: Machine, cut: Cut, elements: Elements, rate: float, *, seated: bool
) -> Element:
    """Collocation of y' = (A - rate) y + b F at all nodes but the first, y = e^(-rate t) x."""
    a, _, _ = machine.matrices(0.0, seated=seated)
    tool, workpiece = machine.tool.modes, machine.workpiece.modes
    states = len(a)
    across, velocity, push = np.zeros(states), np.zeros(states), np.zeros(states)
    across[::2] = [*(mode.chip for mode in tool), *(-mode.chip for mode in workpiece)]
    velocity[1::2] = across[::2]
    push[1::2] = [*(-mode.force / mode.mass for mode in tool),
                  *(mode.force / mode.mass for mode in workpiece)]  # fmt: skip
    nodes = _nodes()
    sign = (-1.0) ** np.arange(ORDER + 1)
    sign[[0, -1]] *= 2.0
    derivative = np.outer(sign, 1.0 / sign)
    derivative /= nodes[:, None] - nodes + np.eye(ORDER + 1)
    derivative -= np.diag(derivative.sum(axis=1))
    derivative /= elements.length
    # Unknowns: all states at the first node, all at the second, and so on.
    system = np.kron(derivative[1:, 1:], np.eye(states))
    system -= np.kron(np.eye(ORDER), a - rate * np.eye(states))
    known = np.hstack(
        (np.kron(-derivative[1:, :1], np.eye(states)), np.kron(np.eye(ORDER), push[:, None]))
    )
    solved = np.linalg.solve(system, known).reshape(ORDER, states, states + ORDER)
    relative = np.einsum('s,jsk->jk', across, solved)
    moving = np.einsum('s,jsk->jk', velocity, solved)
    # F = K (r - e^(-rate tau) r_before) + d r'
    stiffness = machine.cutting_stiffness(cut.depth_of_cut)
    process = ProcessDamping.of(cut)
    turn = elements.turn if process.coefficient else elements.turn[:1]
    damping = process.per_width_and_delay * cut.depth_of_cut * turn[..., None]
    whole = stiffness * relative + damping * moving
    coupling = np.eye(ORDER) - whole[..., states:]
    given = np.concatenate(
        (np.broadcast_to(-stiffness * np.eye(ORDER), coupling.shape), whole[..., :states]),
        axis=-1,
    )
    force = np.linalg.solve(coupling, given)
    results = np.concatenate((relative, solved[-1]))
    step = results[:, states:] @ force
    step[..., ORDER:] += results[:, :states]
    step = np.ascontiguousarray(step.swapaxes(-1, -2))
    return Element(step, across, np.exp(-rate * elements.delay))


def carry(
    vector: Array, elements: Elements, element: Element, count: int, *, rescaled: bool = False
) -> tuple[Array, float]:
    """Carry state and past r over so many elements from the beginning of a period.

    The vector is the state and, for each element within the longest delay, r at all nodes but the
    last, which is the first of the next element.

    Returns:
        The vector then, and the logarithm of what was scaled away where it is `rescaled`.
    """
    result = np.ascontiguousarray(vector).copy()
    log = _carry(
        result, element.step, element.across, element.echo, elements.source, elements.weights,
        elements.behind, count, rescaled,
    )  # fmt: skip
    return result, float(log)


@compiled(nogil=True)
def _carry(
    vector: Array, step: Array, across: Array, echo: Array, source: Integers, weights: Array,
    behind: int, count: int, rescaled: bool,
) -> float:  # fmt: skip
    """`carry` in place; the logarithm of what was scaled away."""
    states, order = len(across), weights.shape[1]
    size, period, steps = order + states, len(source), len(step)
    slots = behind + 1
    ring = np.zeros((slots, order + 1))
    state, given, result = vector[:states].copy(), np.empty(size), np.empty(size)
    log = 0.0
    for k in range(behind):
        for j in range(order):
            ring[(k - behind) % slots, j] = vector[states + k * order + j]
    for k in range(behind - 1):
        ring[(k - behind) % slots, order] = ring[(k + 1 - behind) % slots, 0]
    ring[-1 % slots, order] = np.sum(across * state)
    for number in range(count):
        here = number % period
        slot, base = number % slots, number - here
        for j in range(order):
            before = (source[here, j] + base) % slots
            even, odd = weights[here, j, order] * ring[before, order], 0.0
            for node in range(0, order, 2):
                even += weights[here, j, node] * ring[before, node]
                odd += weights[here, j, node + 1] * ring[before, node + 1]
            given[j] = (even + odd) * echo[here, j]
        first = 0.0
        for i in range(states):
            given[order + i] = state[i]
            first += across[i] * state[i]
        which = here if steps > 1 else 0
        result[:] = 0.0
        for i in range(size):
            for k in range(size):
                result[k] += step[which, i, k] * given[i]
        ring[slot, 0] = first
        for j in range(order):
            ring[slot, j + 1] = result[j]
        for i in range(states):
            state[i] = result[order + i]
        if rescaled and (number % _RESCALED == _RESCALED - 1 or number == count - 1):
            most = max(np.abs(ring).max(), 1e-300)
            ring /= most
            state /= most
            log += math.log(most)
    for i in range(states):
        vector[i] = state[i]
    for k in range(behind):
        for j in range(order):
            vector[states + k * order + j] = ring[(count - behind + k) % slots, j]
    return log
