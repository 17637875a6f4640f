"""Histories of runs, out of samples that are in memory."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lathe_chatter.model import Cut, Machine
from lathe_chatter.recording.sample_blocks import SampleBlocks
from lathe_chatter.report.plotted_samples import RunSamples
from lathe_chatter.report.run_history import History, Session


def blocks_of(signals: Mapping[str, Any]) -> SampleBlocks:
    """One block of signals (n,) by name."""
    once = np.zeros(1, np.int64)
    return SampleBlocks(tuple(signals), np.array([*signals.values()]), once, once, once)


def history_of(
    signals: Mapping[str, Any],
    machine: Machine | None = None,
    cut: Cut | None = None,
    *,
    spindle_acceleration: float = 0.0,
    **facts: Any,
) -> History:
    """One session with signals (n,) by name."""
    session = Session(
        0.0, '', machine or Machine(), cut or Cut(), tool_leaves_cut=True,
        spindle_acceleration=spindle_acceleration, known=True,
    )  # fmt: skip
    samples = RunSamples(lambda _spans: [blocks_of(signals)])
    return History(Path('run'), (session,), samples, **facts)
