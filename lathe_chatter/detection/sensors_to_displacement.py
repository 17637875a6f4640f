"""Which sensors stand for the two displacements, and the filter that makes them comparable.

Every signal passes s^(2-n) / (s^2 + 1.4 w s + w^2) and one high-pass of the same corner, n being
how often the displacement was differentiated in it: a velocity or an acceleration becomes a
displacement above 15 Hz (a seismograph), and a displacement beside it is filtered likewise. One
linear filter on both bodies' signals leaves F = C w (1 - shift) r and the tool's own equation as
they are, so that the cut is identified from accelerations as from displacements.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lathe_chatter.array_types import Array

_CORNER = 15.0
"""Hz."""
_DAMPING = 0.7
_ORDERS = {'displacement': 0, 'velocity': 1, 'acceleration': 2}
_MIXTURES = ('sound', 'force')
"""What tells of a vibration and not of the motion of one body, so nothing of its growth."""


class Sensors(NamedTuple):
    """What is listened to.

    Attributes:
        tool: Label of the column that stands for the tool's motion, or for a mixture; or empty.
        workpiece: The same for the workpiece.
        orders: How often each displacement was differentiated (2,).
        mixed: Whether it is a mixture.
    """

    tool: str
    workpiece: str
    orders: tuple[int, int]
    mixed: bool

    @property
    def filtered(self) -> bool:
        """Whether any of them is no displacement."""
        return not self.mixed and any(self.orders)


def sensors_among(names: Sequence[str]) -> Sensors | None:
    """The sensors to listen to among columns; None where there is none.

    A displacement goes before a velocity, that before an acceleration, and the motion of a body
    before sound and force.
    """
    found = {
        body: next((f'{body}_{kind}' for kind in _ORDERS if f'{body}_{kind}' in names), '')
        for body in ('tool', 'workpiece')
    }
    orders = [_ORDERS.get(name.rpartition('_')[2], 0) for name in found.values()]
    if any(found.values()):
        return Sensors(found['tool'], found['workpiece'], (orders[0], orders[1]), mixed=False)
    mixture = next((name for name in _MIXTURES if name in names), None)
    return None if mixture is None else Sensors(mixture, '', (0, 0), mixed=True)


class MotionFilter:
    """The filter, for the two signals of one stretch of samples.

    Args:
        orders: How often each displacement was differentiated (2,).
        rate: Samples a second, Hz.
    """

    def __init__(self, orders: tuple[int, int], rate: float) -> None:
        """Begin with nothing filtered."""
        from scipy.signal import bilinear_zpk, zpk2sos  # it takes a while to import

        corner = 2.0 * math.pi * _CORNER
        pole = corner * complex(-_DAMPING, math.sqrt(1.0 - _DAMPING**2))
        poles = [pole, pole.conjugate()] * 2
        self._sections = [
            zpk2sos(*bilinear_zpk([0.0] * (4 - order), poles, 1.0, rate)) for order in orders
        ]
        self._states: list[Array] | None = None

    def apply(self, signals: Array) -> None:
        """Filter the next signals (n, 2) in place; one that is not finite stays so."""
        from scipy.signal import sosfilt, sosfilt_zi

        if self._states is None:  # as if the first sample had stood there always
            first = np.nan_to_num(signals[0])
            self._states = [
                sosfilt_zi(sections) * first[k] for k, sections in enumerate(self._sections)
            ]
        for k, sections in enumerate(self._sections):
            filtered, state = sosfilt(sections, signals[:, k], zi=self._states[k])
            signals[:, k], self._states[k] = filtered, np.asarray(state, np.float64)
