"""Times at which a recorder stood still: messages waited in the middleware, which has an end."""

from __future__ import annotations

from lathe_chatter.recording.provenance import LONGEST_STALL, STALLS

STALL = 0.1
"""s between two times that messages are taken which count as a stall; usual are 0.04 s."""


class ReceiveStalls:
    """Follows when messages are taken.

    Attributes:
        count: How often it took too long.
        longest: From one time to the next, s.
    """

    def __init__(self) -> None:
        """Begin before the first time."""
        self.count = 0
        self.longest = 0.0
        self._last: float | None = None

    def note(self, now: float) -> None:
        """Messages are taken at a steady time, s."""
        if self._last is not None:
            passed = now - self._last
            self.longest = max(self.longest, passed)
            self.count += passed > STALL
        self._last = now

    def values(self) -> dict[str, str]:
        """What a run notes of them."""
        return {STALLS: str(self.count), LONGEST_STALL: f'{self.longest:.3g}'}
