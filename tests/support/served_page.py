"""A page that is served while a test looks at it."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from lathe_chatter.page.server import PageServer

_PATIENCE = 120.0


@contextmanager
def serving(server: PageServer) -> Iterator[asyncio.AbstractEventLoop]:
    """Serve it in a thread, by this loop."""
    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=lambda: loop.run_until_complete(server.run()))
    thread.start()
    try:
        yield loop
    finally:
        server.end()
        thread.join(_PATIENCE)
        loop.close()
