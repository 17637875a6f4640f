"""The virtual lathe: it cuts, can be retuned while it does, saved and continued."""

from __future__ import annotations

from lathe_chatter.lathe.virtual_lathe import Event, EventKind, VirtualLathe

__all__ = ['Event', 'EventKind', 'VirtualLathe']
