"""The virtual lathe: it cuts, can be retuned while it does, saved and continued.

The names below are loaded when they are first used (PEP 562): who reads what a lathe has said and
recorded, from the modules beside, loads no Numba, which takes half a second.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lathe_chatter.lathe.virtual_lathe import Event, EventKind, VirtualLathe

__all__ = ['Event', 'EventKind', 'VirtualLathe']


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    from lathe_chatter.lathe import virtual_lathe

    return getattr(virtual_lathe, name)
