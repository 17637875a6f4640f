"""At which delays a root of a cut crosses the imaginary axis, and which way.

With theta = omega tau, -1/G(i omega) = K (1 - cos theta) + i (K sin theta + p theta): the real
part leaves two phases in each turn for a frequency, and its imaginary part picks the frequencies.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lathe_chatter.array_types import Array, Integers
from lathe_chatter.stability.characteristic import receptance
from lathe_chatter.stability.compiled_characteristic import ALPHA, BETA, DAMPING, STIFFNESS
from lathe_chatter.stability.critical_depth import frequency_grid
from lathe_chatter.stability.lobes import bands, crossing_frequencies, echo_phase

_HALVINGS = 60


class Crossings(NamedTuple):
    """Delays (n,), s, in no order, and +1 where a longer delay moves the root to the right."""

    delay: Array
    outward: Integers


def axis_crossings(
    sections: Array, stiffness: float, per_delay: float, longest: float
) -> Crossings:
    """Every crossing at a delay up to the longest.

    Args:
        sections: Of a machine with some damping.
        stiffness: K = C w, N/m.
        per_delay: p = C_pd w / (pi D), the process damping for a delay of 1 s, N/m.
        longest: Delay, s.
    """
    if stiffness == 0.0:
        return Crossings(np.zeros(0), np.zeros(0, np.int64))
    if per_delay == 0.0:
        frequency = crossing_frequencies(sections, stiffness)
        # Re G is known; next to a mode with little damping no frequency is exact enough for it.
        response = receptance(sections, 1j * frequency)
        phase = echo_phase(-0.5 / stiffness + 1j * response.imag)
        turns = int(np.ceil(longest * frequency.max(initial=0.0) / (2.0 * np.pi))) + 1
        phase = phase + 2.0 * np.pi * np.arange(turns)[:, None]
        frequency = np.broadcast_to(frequency, phase.shape)
    else:
        frequency, phase = _damped(sections, stiffness, per_delay, longest)
    delay = phase / frequency
    inside = delay <= longest
    delay, frequency = delay[inside], frequency[inside]
    return Crossings(delay, _outward(sections, stiffness, per_delay, delay, frequency))


def _damped(
    sections: Array, stiffness: float, per_delay: float, longest: float
) -> tuple[Array, Array]:
    """Frequencies and phases (n,) of all crossings with process damping."""
    coupled = np.sqrt(2.0 * stiffness * np.abs(sections[:, BETA]).sum())
    grid = frequency_grid(sections, 2.0 * coupled)
    edges = bands(sections, grid, stiffness, damped=True)
    turns = int(np.ceil(longest * grid[-1] / (2.0 * np.pi)))
    # Beyond some phase the damping alone is more than 1/G has.
    found: list[tuple[Array, Array]] = [(np.zeros(0), np.zeros(0))]
    for low, high in edges[: edges.size // 2 * 2].reshape(-1, 2):
        inside = grid[(grid > low) & (grid < high)]
        omega = np.concatenate(([low], inside, [high]))
        needed = np.abs((1.0 / receptance(sections, 1j * omega)).imag).max() + stiffness
        here = min(turns, int(needed / (2.0 * np.pi * per_delay)) + 1)
        base = 2.0 * np.pi * np.arange(here)[:, None]
        for sign in (1.0, -1.0):
            begin = base if sign > 0.0 else base + 2.0 * np.pi

            def theta(frequency: Array, start: Array, sign: float = sign) -> Array:
                real = (1.0 / receptance(sections, 1j * frequency)).real
                turn: Array = start + sign * np.arccos(np.clip(1.0 + real / stiffness, -1.0, 1.0))
                return turn

            def excess(frequency: Array, start: Array) -> Array:
                phase = theta(frequency, start)
                value = (1.0 / receptance(sections, 1j * frequency)).imag
                return np.asarray(value + stiffness * np.sin(phase) + per_delay * phase)

            positive = excess(omega, np.asarray(begin)) > 0.0
            row, column = np.nonzero(positive[:, 1:] != positive[:, :-1])
            start: Array = begin[row, 0]
            rising = positive[row, column + 1]
            left, right = omega[column], omega[column + 1]
            for _ in range(_HALVINGS):
                middle = 0.5 * (left + right)
                above = (excess(middle, start) > 0.0) == rising
                left, right = np.where(above, left, middle), np.where(above, middle, right)
            frequency = 0.5 * (left + right)
            found.append((frequency, theta(frequency, start)))
    frequencies, phases = zip(*found, strict=True)
    return np.concatenate(frequencies), np.concatenate(phases)


def _outward(
    sections: Array, stiffness: float, per_delay: float, delay: Array, frequency: Array
) -> Integers:
    """+1 where a longer delay moves the root at i omega to the right, -1 to the left.

    From F(s, tau) = 1 + E G = 0 with E = K (1 - e) + p tau s follows
    ds/dtau = -E_tau G / (E_s G + E G').
    """
    s = 1j * frequency
    at = s[..., None]
    denominator = (at + sections[:, DAMPING]) * at + sections[:, STIFFNESS]
    part = (sections[:, ALPHA] * at + sections[:, BETA]) / denominator
    steep = (sections[:, ALPHA] - part * (2.0 * at + sections[:, DAMPING])) / denominator
    total, slope = part.sum(axis=-1), steep.sum(axis=-1)
    echo = stiffness * np.exp(-s * delay)
    force = -1.0 / total  # K - echo + p tau s, without the rounding of a small difference
    moved = -(echo + per_delay) * s * total
    moved /= (delay * (echo + per_delay)) * total + force * slope
    return np.where(moved.real > 0.0, 1, -1)
