"""The paper's 14 runs: reproduced, judged, and drawn as its tables and figures lay them out."""

from __future__ import annotations

from lathe_chatter.paper.open_questions import Findings, find
from lathe_chatter.paper.published_runs import PAPER_RUNS, Pace, PaperRun
from lathe_chatter.paper.reproduced_run import Literal, Reproduced, reproduce_run

__all__ = [
    'PAPER_RUNS',
    'Findings',
    'Literal',
    'Pace',
    'PaperRun',
    'Reproduced',
    'find',
    'reproduce_run',
]
