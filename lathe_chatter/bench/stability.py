"""How long roots, limits, advice and multipliers take."""

from __future__ import annotations

from typing import Any

import numpy as np

from lathe_chatter import stability
from lathe_chatter.bench.figures import Figure, median_time
from lathe_chatter.model import Cut, Machine

MACHINE = Machine()
SPEEDS = np.linspace(1000.0, 12000.0, 111)
DEPTHS = np.linspace(0.05e-3, 2e-3, 38)
MANY_SPEEDS = np.linspace(1000.0, 12000.0, 300)
_VARIED = ((1000.0, 1.0), (3000.0, 5.0), (9000.0, 30.0))
"""Speeds, rev/min, and frequencies at which they are varied, Hz."""


def growth_map() -> Any:
    """The roots of the map of the table: 111 speeds by 38 depths."""
    return stability.rightmost_roots(MACHINE, SPEEDS, DEPTHS[:, None], seated=False)


def varied_cuts() -> list[Cut]:
    """Cuts whose speed swings by 20 %."""
    return [
        Cut(rpm, 1e-3, speed_variation_amplitude=0.2, speed_variation_frequency=frequency)
        for rpm, frequency in _VARIED
    ]


def stability_figures(repeats: int) -> list[Figure]:
    """Times of everything that the stability core computes."""
    figures = [
        Figure('growth map 111 x 38, every point proven', median_time(growth_map, repeats), 's')
    ]

    def timed(name: str, work: Any) -> None:
        figures.append(Figure(name, 1e3 * median_time(work, repeats), 'ms'))

    for rpm in (60.0, 300.0, 3000.0, 12000.0):
        timed(
            f'rightmost root at {rpm:g} rev/min, proven',
            lambda rpm=rpm: stability.rightmost_root(MACHINE, rpm, 1e-3, seated=False),
        )
    timed(
        'lobe boundary, 200 000 points',
        lambda: stability.lobe_boundary(MACHINE, seated=False, lobes=20, points=10_000),
    )
    timed(
        'critical depth at one speed',
        lambda: stability.critical_depth(MACHINE, 3000.0, seated=False),
    )
    timed('safe region at 300 speeds', lambda: stability.safe_limit(MACHINE, Cut(), MANY_SPEEDS))
    for cut in varied_cuts():
        timed(
            f'speed variation, {cut.spindle_speed_rpm:g} rev/min at '
            f'{cut.speed_variation_frequency:g} Hz',
            lambda cut=cut: stability.floquet(MACHINE, cut, seated=False),
        )
    return figures
