"""Compiles the inner loop once, so that nothing waits for it later.

    python -m lathe_chatter.warm_up

The machine code is kept beside the package (or where NUMBA_CACHE_DIR says) and reused by every
later process until the source changes.
"""

from __future__ import annotations

from lathe_chatter.lathe import VirtualLathe


def warm_up() -> None:
    """Take one sample, which compiles all that later ones need."""
    VirtualLathe().advance(1)


if __name__ == '__main__':
    warm_up()
