"""Characteristic roots by another way: Chebyshev collocation of the delayed scalar."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from lathe_chatter.model import Machine

_HIGHEST_FREQUENCY = 2000.0


def rightmost_root(machine: Machine, rpm: float, depth: float, *, seated: bool) -> complex:
    """The rightmost root, polished by Newton's method on the equation in receptances.

    Only r = x_t - x_wp is transported over one turn: the eigenproblem has 4 + N unknowns.
    """
    delay = 60.0 / rpm
    a, b, _ = machine.matrices(depth, seated=seated)
    nodes = math.ceil(0.8 * _HIGHEST_FREQUENCY * delay) + 24
    derivative = _chebyshev_derivative(nodes) * 2.0 / delay
    problem = np.zeros((4 + nodes, 4 + nodes))
    problem[:4, :4] = a
    problem[:4, -1] = b[:, 0]
    problem[4:, :4] = np.outer(derivative[1:, 0], [1.0, 0.0, -1.0, 0.0])
    problem[4:, 4:] = derivative[1:, 1:]
    eigenvalues = np.linalg.eigvals(problem)
    # Newton's method may reorder what differs by the error of collocation, but no more.
    first = eigenvalues[eigenvalues.real > eigenvalues.real.max() - 1e-3]
    stiffness = machine.cutting_stiffness(depth)
    roots = [_polish(machine, stiffness, delay, s, seated=seated) for s in first.tolist()]
    best = max(roots, key=lambda s: s.real)
    return complex(best.real, abs(best.imag))


def residual(machine: Machine, rpm: float, depth: float, s: complex, *, seated: bool) -> float:
    """|1 + C w (G_t + G_wp)(1 - e^(-s tau))| relative to its terms."""
    receptance = _receptance(machine, s, seated=seated)[0]
    stiffness = machine.cutting_stiffness(depth)
    echo = np.exp(-s * 60.0 / rpm)
    value = 1.0 + stiffness * receptance * (1.0 - echo)
    return float(abs(value) / (1.0 + abs(stiffness * receptance) * (1.0 + abs(echo))))


def _polish(
    machine: Machine, stiffness: float, delay: float, s: complex, *, seated: bool
) -> complex:
    for _ in range(30):
        receptance, slope = _receptance(machine, s, seated=seated)
        echo = np.exp(-s * delay)
        value = 1.0 + stiffness * receptance * (1.0 - echo)
        step = value / (stiffness * (slope * (1.0 - echo) + receptance * delay * echo))
        s -= step
        if abs(step) < 1e-14 * abs(s):
            break
    return complex(s)


def _receptance(machine: Machine, s: complex, *, seated: bool) -> tuple[complex, complex]:
    """(G_t + G_wp)(s) and its derivative, mode by mode."""
    total, slope = 0.0 + 0.0j, 0.0 + 0.0j
    stiffnesses = (machine.tool.stiffness, machine.workpiece_stiffness(seated=seated))
    for mode, stiffness in zip((machine.tool, machine.workpiece), stiffnesses, strict=True):
        dynamic = mode.mass * s * s + mode.damping * s + stiffness
        total += 1.0 / dynamic
        slope -= (2.0 * mode.mass * s + mode.damping) / dynamic**2
    return total, slope


def _chebyshev_derivative(order: int) -> NDArray[np.float64]:
    """Differentiation on the nodes cos(pi k / order) of [-1, 1]."""
    k = np.arange(order + 1)
    x = np.cos(np.pi * k / order)
    weight = np.where((k == 0) | (k == order), 2.0, 1.0) * (-1.0) ** k
    matrix = np.outer(weight, 1.0 / weight) / (x[:, None] - x[None, :] + np.eye(order + 1))
    return matrix - np.diag(matrix.sum(axis=1))
