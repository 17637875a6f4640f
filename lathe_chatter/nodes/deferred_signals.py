"""Wishes to end (Ctrl-C, SIGTERM, SIGHUP) held back to where a loop can heed them."""

from __future__ import annotations

import signal
from types import FrameType, TracebackType

_WISHES = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class HeldSignals:
    """As a context: the signals are noted, and `heed` hands them to the handlers of before.

    Those raise KeyboardInterrupt. Raised amid a call into C++, as the executor of rclpy makes
    many, it can come out as another error altogether, or be lost.
    """

    def __init__(self) -> None:
        """Hold nothing yet."""
        self._number: int | None = None
        self._before: dict[int, signal._HANDLER] = {}

    def heed(self) -> None:
        """Let the first signal that came do what it would have done.

        Raises:
            KeyboardInterrupt: If one came, and Python's handler or ours was there before.
        """
        number, self._number = self._number, None
        if number is None:
            return
        before = self._before[number]
        if callable(before):
            before(number, None)

    def _note(self, number: int, _frame: FrameType | None) -> None:
        if self._number is None:
            self._number = number

    def __enter__(self) -> HeldSignals:  # noqa: PYI034 -- Self needs Python 3.11
        """Begin to hold."""
        for wish in _WISHES:
            before = signal.getsignal(wish)
            if callable(before):  # one that is ignored, as under nohup, stays so
                self._before[wish] = signal.signal(wish, self._note)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Put the handlers back; what nobody heeded is heeded now, unless an error goes on."""
        for wish, before in self._before.items():
            signal.signal(wish, before)
        if kind is None:
            self.heed()
