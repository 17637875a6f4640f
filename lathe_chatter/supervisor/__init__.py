"""What to do about chatter, when, and when to leave it alone; no ROS."""

from __future__ import annotations

from lathe_chatter.supervisor.move_search import Limits, Move
from lathe_chatter.supervisor.supervisor import ASKS, Action, Mode, Seen, Supervisor

__all__ = ['ASKS', 'Action', 'Limits', 'Mode', 'Move', 'Seen', 'Supervisor']
