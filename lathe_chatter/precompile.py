"""Compiles the inner loops once, so that nothing waits for it later.

    python -m lathe_chatter.precompile

The machine code is kept beside the package (or where NUMBA_CACHE_DIR says) and reused by every
later process until the source changes.
"""

from __future__ import annotations

from lathe_chatter.detection import ChatterDetector
from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.model import BearingContact, Cut
from lathe_chatter.samples import SAMPLE_COLUMNS

_BLOCK, _LONG_ENOUGH = 1000, 10


def precompile() -> None:
    """Cut until it chatters, and watch that: compiles or loads all that later calls need."""
    detector = ChatterDetector()
    lathe = VirtualLathe(cut=Cut(depth_of_cut=1e-3, bearing_contact=BearingContact.SEATED))
    for _ in range(_LONG_ENOUGH):
        if detector.update(lathe.advance(_BLOCK), SAMPLE_COLUMNS).chatter:
            break


if __name__ == '__main__':
    precompile()
