"""The monitor over a recording of any shop: read it, judge it, score it, draw it."""

from __future__ import annotations

from lathe_chatter.listening.detector_score import Judged, Score, judge, score
from lathe_chatter.listening.signal_file import Signals, read_signals

__all__ = ['Judged', 'Score', 'Signals', 'judge', 'read_signals', 'score']
