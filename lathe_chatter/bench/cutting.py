"""How fast it cuts and how little watching it costs."""

from __future__ import annotations

from functools import partial

from lathe_chatter.bench.figures import Figure, median_time
from lathe_chatter.detection import ChatterDetector
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import BearingContact, Cut
from lathe_chatter.samples import SAMPLE_COLUMNS

_RATE = 1e4
_BLOCK = 10_000
_TICK = 20
"""Samples of a tick of the node: 500 Hz at 10 kHz."""


def lathe_figures(repeats: int) -> list[Figure]:
    """A quiet cut, chatter with contacts, the linear force, and a tick of the node."""
    cuts = {
        'a stable cut': (Cut(), True),
        'chatter with contacts': (Cut(depth_of_cut=1e-3), True),
        "the paper's linear cut": (Cut(bearing_contact=BearingContact.NONE), False),
    }
    figures = []
    for name, (cut, total) in cuts.items():
        lathe = VirtualLathe(cut=cut, tool_leaves_cut=total, sample_rate=_RATE)
        lathe.advance(2 * _BLOCK)
        spent = median_time(partial(lathe.advance, _BLOCK), repeats)
        figures += [
            Figure(f'{name}, 1 s at 10 kHz', 1e3 * spent, 'ms'),
            Figure(f'{name}, faster than real time', 1.0 / spent, 'times'),
        ]
    lathe = VirtualLathe(cut=Cut(depth_of_cut=1e-3))
    lathe.advance(2 * _BLOCK)

    def ticks() -> None:
        for _ in range(1000):
            lathe.advance(_TICK)

    figures.append(Figure('a tick of 20 samples', 1e3 * median_time(ticks, repeats), 'us'))
    return figures


def detector_figures(repeats: int) -> list[Figure]:
    """What the monitor's detector costs, tick by tick."""
    samples = VirtualLathe(cut=Cut(depth_of_cut=1e-3)).advance(_BLOCK)

    def watch() -> None:
        detector = ChatterDetector()
        for start in range(0, _BLOCK, _TICK):
            detector.update(samples[start : start + _TICK], SAMPLE_COLUMNS)

    spent = median_time(watch, max(repeats // 2, 1))
    return [
        Figure('watching 1 s at 10 kHz, in ticks of 20', 1e3 * spent, 'ms'),
        Figure('of one core while in real time', 100.0 * spent, '%'),
    ]
