"""What a step of one lathe costs where many are cut in one call."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from itertools import product
from statistics import median
from typing import Any

import numpy as np
from figures import Figure, Line, tracked

from lathe_chatter.arrays import Array
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.lathe.sweep import LatheSweep, sample_rate_for
from lathe_chatter.model import BearingContact, Cut
from lathe_chatter.samples import SAMPLE_COLUMNS

_SPEEDS = np.linspace(2500.0, 3500.0, 4)
_DEPTHS = np.linspace(0.1e-3, 0.5e-3, 4)
_CLEARANCES = 1e-6 * np.array([40.0, 60.0])
_STEPS_PER_TURN = 200
_SETTLING_TURNS = 20
_TURNS = 10
_REPEATS = 150
_LONG, _LONG_REPEATS = 20, 9


def _lathes(contact: BearingContact, depths: Sequence[float], per_turn: int) -> list[VirtualLathe]:
    """A sweep over speed, depth and clearance."""
    cuts = [
        Cut(speed, depth, clearance, contact)
        for speed, depth, clearance in product(_SPEEDS, depths, _CLEARANCES)
    ]
    return [VirtualLathe(cut=cut, sample_rate=sample_rate_for(cut, per_turn)) for cut in cuts]


def many() -> list[Line]:
    """Nanoseconds of a core for a step of a lathe, beside the same lathes one by one."""
    one = ['tool_displacement']
    cases = (
        ('gap, 10 steps a sample', BearingContact.GAP, _DEPTHS, 20, one, 10.0),
        ('none, 10 steps a sample', BearingContact.NONE, _DEPTHS, 20, SAMPLE_COLUMNS, 10.0),
        ('none, a sample each step, 1 column', BearingContact.NONE, _DEPTHS, 200, one, 10.0),
        ('none, the same, all 8', BearingContact.NONE, _DEPTHS, 200, SAMPLE_COLUMNS, None),
        ('gap, all in chatter', BearingContact.GAP, 1e-3 + _DEPTHS, 200, one, None),
    )
    lines: list[Line] = []
    for what, contact, depths, per_turn, columns, goal in tracked(cases, 'sweeps'):
        lines += _lines(what, _lathes(contact, depths, per_turn), per_turn, columns, goal)
    return lines


def _lines(
    what: str,
    lathes: list[VirtualLathe],
    per_turn: int,
    columns: Sequence[str],
    goal: float | None,
) -> list[Line]:
    sweep = LatheSweep(lathes)
    sweep.advance(_SETTLING_TURNS * per_turn)
    for lathe in lathes:
        lathe.advance(_SETTLING_TURNS * per_turn)
    samples = _TURNS * per_turn
    together, alone = [], []
    for _ in range(_REPEATS):
        together.append(_seconds(sweep.advance, samples, columns=columns, workers=1))
        alone.append(sum(_seconds(lathe.advance, samples) for lathe in lathes))
    # Long enough that the start of threads is nothing.
    ratios = [
        _seconds(sweep.advance, _LONG * samples, columns=columns, workers=1)
        / _seconds(sweep.advance, _LONG * samples, columns=columns)
        for _ in range(_LONG_REPEATS)
    ]
    per_step = 1e9 / (len(lathes) * _TURNS * _STEPS_PER_TURN)
    note = (
        f'median {per_step * median(together):.1f}; {sweep.abreast} of {len(lathes)} abreast; '
        f'one by one {per_step * min(alone):.1f}; all cores {median(ratios):.1f} times as fast'
    )
    figure = f'sweep, {what}: best of {_REPEATS}'
    return [Figure(figure, per_step * min(together), 'ns', goal, note=note)]


def _seconds(call: Callable[..., Array], samples: int, **options: Any) -> float:
    """By the clock."""
    then = time.perf_counter()
    call(samples, **options)
    return time.perf_counter() - then
