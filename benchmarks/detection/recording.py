"""Recordings, and what the detector and its rivals made of them."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from concurrent.futures import Executor
from typing import NamedTuple

import numpy as np
from rich.progress import Progress
from rivals import HOP, RIVALS
from scenarios import Case
from simulator import COLUMNS, RATE, simulate

from lathe_chatter.array_types import Array
from lathe_chatter.detection import ChatterDetector, Estimate
from lathe_chatter.executors import spread

DETECTOR = 'this detector'


class Traces(NamedTuple):
    """What a recording gave.

    Attributes:
        case: What was recorded.
        scores: Of each detector, one value a hop.
        growth: The growth rate that the detector tells, 1/s, a value a hop.
        frequency: The frequency, Hz.
        states: Its states.
        cpu: What the detector took, s.
    """

    case: Case
    scores: dict[str, Array]
    growth: Array
    frequency: Array
    states: list[str]
    cpu: float


def record(case: Case) -> Traces:
    """Simulate and watch; the detector never alarms, so that every threshold can be tried."""
    samples = simulate(case.plan, case.around, case.seed)
    samples = samples[round(case.skipped * RATE) :]
    detector = ChatterDetector(strictness=np.inf)
    begin = time.process_time()
    estimates = [
        detector.update(samples[start : start + HOP], COLUMNS)
        for start in range(0, len(samples) - HOP + 1, HOP)
    ]
    cpu = time.process_time() - begin
    scores = {name: rival(samples) for name, rival in RIVALS.items()}
    scores[DETECTOR] = np.nan_to_num(np.array([e.score for e in estimates]))
    told = _told(samples) if case.onset is not None else estimates
    return Traces(
        case,
        scores,
        np.array([e.growth_rate for e in told]),
        np.array([e.frequency for e in told]),
        [e.state for e in estimates],
        cpu,
    )


def _told(samples: Array) -> list[Estimate]:
    """What a detector that does alarm says, a value a hop."""
    detector = ChatterDetector()
    starts = range(0, len(samples) - HOP + 1, HOP)
    return [detector.update(samples[start : start + HOP], COLUMNS) for start in starts]


def run(cases: Sequence[Case], label: str, executor: Executor) -> list[Traces]:
    """Record all cases wherever there are workers."""
    with Progress(transient=True, disable=not sys.stderr.isatty()) as progress:
        bar = progress.add_task(label, total=len(cases))
        return spread(
            record,
            cases,
            executor=executor,
            progress=lambda count: progress.advance(bar, count),
        )
