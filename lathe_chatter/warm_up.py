"""Compiles the inner loops once, so that nothing waits for it later.

    python -m lathe_chatter.warm_up

The machine code is kept beside the package (or where NUMBA_CACHE_DIR says) and reused by every
later process until the source changes.
"""

from __future__ import annotations

from lathe_chatter.detection import ChatterDetector
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import SAMPLE_COLUMNS


def warm_up() -> None:
    """Cut a little and watch it, which compiles all that later calls need."""
    ChatterDetector().update(VirtualLathe().advance(2000), SAMPLE_COLUMNS)


if __name__ == '__main__':
    warm_up()
