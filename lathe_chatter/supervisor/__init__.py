"""What to do about chatter, when, and when to leave it alone; no ROS.

What computes is loaded when it is first used (PEP 562): with Numba that takes half a second.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from lathe_chatter.supervisor.seen_and_done import ASKS, NO_MACHINE, Action, Mode, Seen

if TYPE_CHECKING:
    from lathe_chatter.supervisor.move_search import Limits
    from lathe_chatter.supervisor.supervisor import Supervisor

__all__ = ['ASKS', 'NO_MACHINE', 'Action', 'Limits', 'Mode', 'Seen', 'Supervisor']


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    from lathe_chatter.supervisor import supervisor

    return getattr(supervisor, name)
