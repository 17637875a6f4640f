"""What to do about chatter, when, and when to leave it alone; no ROS."""

from __future__ import annotations

from lathe_chatter.supervisor.move_search import Limits, Move
from lathe_chatter.supervisor.seen_and_done import ASKS, NO_MACHINE, Action, Mode, Seen
from lathe_chatter.supervisor.supervisor import Supervisor

__all__ = ['ASKS', 'NO_MACHINE', 'Action', 'Limits', 'Mode', 'Move', 'Seen', 'Supervisor']
