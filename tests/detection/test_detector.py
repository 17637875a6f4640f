"""The detector on cuts of the virtual lathe, whose truth the characteristic roots tell."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from lathe_chatter.detection import ChatterDetector, Estimate
from lathe_chatter.detection.estimate import Mode as WorksWith
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import Cut, Machine, Mode
from lathe_chatter.samples import SAMPLE_COLUMNS
from lathe_chatter.stability import rightmost_root

BLOCK = 20
HIDDEN = ('chip_thickness', 'cutting_force')
Watch = Callable[[float], list[Estimate]]


class Cell:
    """A lathe and its detector, block by block as the nodes exchange them."""

    def __init__(self, cut: Cut, **settings: Any) -> None:
        self.lathe = VirtualLathe(cut=cut, **settings)
        self.detector = ChatterDetector()

    def go(self, duration: float) -> list[Estimate]:
        blocks = round(duration * 1e4 / BLOCK)
        update = self.detector.update
        return [update(self.lathe.advance(BLOCK), SAMPLE_COLUMNS) for _ in range(blocks)]

    def change(self, **changes: Any) -> None:
        self.lathe.retune(self.lathe.cut.with_changes(**changes))


def test_the_default_scenario_is_flagged_advised_and_cured() -> None:
    cell = Cell(Cut())
    assert not any(estimate.chatter for estimate in cell.go(3.0))
    cell.change(depth_of_cut=0.62e-3)
    seen = cell.go(2.0)
    flagged = next(estimate for estimate in seen if estimate.chatter)
    assert flagged.state == 'chatter'
    assert flagged.growth_rate > 0.0
    roots = [rightmost_root(Machine(), 3000.0, 0.62e-3, seated=s) for s in (False, True)]
    low, high = (root.imag / (2.0 * math.pi) for root in roots)
    assert low - 2.0 < seen[-1].frequency < high + 2.0
    advised = [e.recommended_speed_rpm for e in seen if math.isfinite(e.recommended_speed_rpm)]
    for seated in (False, True):
        assert rightmost_root(Machine(), advised[-1], 0.62e-3, seated=seated).real < 0.0
    cell.change(spindle_speed_rpm=advised[-1])
    after = cell.go(2.0)
    assert not after[-1].chatter
    assert after[-1].state == 'stable'
    assert sum(np.diff([estimate.chatter for estimate in after]) != 0) == 1


def test_the_same_without_clearance_is_never_flagged() -> None:
    cell = Cell(Cut(bearing_contact='none'))
    seen = cell.go(3.0)
    cell.change(depth_of_cut=0.62e-3)
    assert not any(estimate.chatter for estimate in seen + cell.go(4.0))


PAPER = [
    (rpm, depth, contact)
    for rpm in (3000.0, 10000.0)
    for depth in (0.5e-3, 1.0e-3)
    for contact in ('none', 'seated')
]


@pytest.mark.parametrize('linear', [False, True], ids=['total', 'linear'])
@pytest.mark.parametrize(('rpm', 'depth', 'contact'), PAPER)
def test_the_papers_cases_are_judged_as_their_roots_are(
    rpm: float, depth: float, contact: str, linear: bool
) -> None:
    cell = Cell(
        Cut(rpm, depth, bearing_contact=contact),
        tool_leaves_cut=not linear,
        displacement_limit=1e9,
    )
    root = rightmost_root(Machine(), rpm, depth, seated=contact == 'seated')
    flagged = any(estimate.chatter for estimate in cell.go(3.0))
    assert flagged == (root.real > 0.0)


def test_the_size_of_the_batches_changes_no_decision() -> None:
    samples = VirtualLathe(cut=Cut(3000.0, 0.7e-3)).advance(20_000)
    ends = []
    for size in (1, 7, 20, 500, 20_000):
        detector = ChatterDetector()
        for start in range(0, len(samples), size):
            estimate = detector.update(samples[start : start + size], SAMPLE_COLUMNS)
        ends.append(estimate)
    assert len({repr(estimate) for estimate in ends}) == 1


def test_it_is_never_told_the_answer() -> None:
    """Without the columns that no machine measures it decides the same."""
    seen = [place for place, name in enumerate(SAMPLE_COLUMNS) if name not in HIDDEN]
    names = [SAMPLE_COLUMNS[place] for place in seen]
    samples = VirtualLathe(cut=Cut(3000.0, 1e-3)).advance(10_000)
    whole, part = ChatterDetector(), ChatterDetector()
    assert repr(whole.update(samples, SAMPLE_COLUMNS)) == repr(
        part.update(samples[:, seen], names)
    )


@pytest.mark.parametrize(
    'other',
    [
        {'tool': [Mode(0.05, 775.0, 0.008, chip=0.5), Mode(0.05, 900.0, 0.008)]},
        {'tool': Mode(0.05, 775.0, 0.008, chip=0.5)},
        {'workpiece': Mode(0.05, 650.0, 0.008, bearing=-3.0, chip=0.1)},
    ],
)
def test_a_machine_that_is_not_identified_is_judged_without(other: dict[str, Any]) -> None:
    """Also one whose chip would see a negative stiffness of the bearing."""
    machine = Machine(**other)
    detector = ChatterDetector(machine)
    estimate = detector.update(VirtualLathe(machine).advance(10_000), SAMPLE_COLUMNS)
    assert estimate.mode is WorksWith.MANY_MODES
    assert math.isnan(estimate.margin)
