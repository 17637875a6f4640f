"""What a reference returns, and the measure of error against it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.model import Machine


class Event(NamedTuple):
    """An instant at which the machine changes from one linear system to another.

    Attributes:
        time: s.
        kind: `bearing` (the workpiece reaches or leaves its bearing) or `chip` (the tool leaves
            or enters the cut).
        begins: Whether the contact begins (touch, entry) or ends (release, separation).
    """

    time: float
    kind: str
    begins: bool


@dataclass(frozen=True)
class Solution:
    """A run: states at k / sample_rate, k = 1..n, as (n, 4), and its located events."""

    states: Array
    events: tuple[Event, ...]


def relative_error(
    states: Array,
    reference: Array,
    sample_rate: float,
    machine: Machine | None = None,
    window: float = 0.02,
) -> float:
    """Largest error of any state over the local amplitude.

    Velocities count as the amplitudes that they are at their mode's natural frequency, so that
    all four states are lengths. The local amplitude is the largest of them over the last
    `window` seconds.
    """
    machine = machine or Machine()
    tool, workpiece = machine.tool.natural_frequency, machine.workpiece.natural_frequency
    length = np.array([1.0, 1.0 / tool, 1.0, 1.0 / workpiece])
    error = np.abs((states - reference) * length).max(axis=1)
    size = np.abs(reference * length).max(axis=1)
    width = max(1, round(window * sample_rate))
    padded = np.concatenate([np.zeros(width - 1), size])
    amplitude = np.lib.stride_tricks.sliding_window_view(padded, width).max(axis=-1)
    return float((error / amplitude).max())


def event_error(events: Sequence[Event], reference: Sequence[Event]) -> float:
    """Largest difference between the times of the same events, s; infinite if they differ."""
    if [event[1:] for event in events] != [event[1:] for event in reference]:
        return math.inf
    pairs = zip(events, reference, strict=True)
    return max((abs(mine.time - theirs.time) for mine, theirs in pairs), default=0.0)
