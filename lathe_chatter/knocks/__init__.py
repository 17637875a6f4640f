"""The knock that a cut survives: what a bearing clearance does to the margin of a stable cut.

A cut with a clearance can be stable to small disturbances and yet be knocked into chatter that
lasts: beyond its clearance the workpiece meets another machine. Lobes know nothing of that, so
here it is simulated.
"""

from __future__ import annotations

from lathe_chatter.knocks.knock_map import KnockGrid, KnockMap, read_knock_map, run_knock_map
from lathe_chatter.knocks.knock_outcome import Outcome, follow_knock, linear_reach, resting_state
from lathe_chatter.knocks.knock_threshold import KnockLimit, Margin, smallest_lasting_knock

__all__ = [
    'KnockGrid',
    'KnockLimit',
    'KnockMap',
    'Margin',
    'Outcome',
    'follow_knock',
    'linear_reach',
    'read_knock_map',
    'resting_state',
    'run_knock_map',
    'smallest_lasting_knock',
]
