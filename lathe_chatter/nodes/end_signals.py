"""Signals to end (Ctrl-C, SIGTERM, SIGHUP): raised at once, or held back for a while."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable
from types import FrameType
from typing import Any

END_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_AGAIN = 0.02
"""s after which an interrupt that was lost is raised again."""


def exit_on_end_signals() -> None:
    """From now on each of them ends the process with exit code 0; one that is ignored does not.

    For the time in which there is nothing to finish yet. An exception would not do: raised amid
    the import of a library it can come out as another error, and with a traceback.
    """
    for number in END_SIGNALS:
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, lambda _number, _frame: os._exit(0))


def raise_lost_interrupts_again() -> Callable[[Any], object]:
    """From now on a KeyboardInterrupt that Python could only ignore is raised again soon.

    Numba has LLVM call Python for each function that it loads: what is raised in such a call
    goes nowhere, and neither does what is raised in a `__del__`.

    Returns:
        What was `sys.unraisablehook` until now.
    """
    usual = sys.unraisablehook

    def interrupt(_number: int, _frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    def hook(lost: Any) -> None:
        if issubclass(lost.exc_type, KeyboardInterrupt):
            signal.signal(signal.SIGALRM, interrupt)
            signal.setitimer(signal.ITIMER_REAL, _AGAIN)
        else:
            usual(lost)

    sys.unraisablehook = hook
    return usual


def raise_on_end_signals() -> list[int]:
    """From now on each of them raises KeyboardInterrupt; one that is ignored, as under nohup, not.

    Where it is lost it is raised again.

    Returns:
        The numbers of those that came, as they come.
    """
    came: list[int] = []

    def interrupt(number: int, _frame: FrameType | None) -> None:
        came.append(number)
        raise KeyboardInterrupt

    for number in END_SIGNALS:
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, interrupt)
    raise_lost_interrupts_again()
    return came


def ignore_end_signals() -> None:
    """From now on none of them does anything: what they ask for is under way."""
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    for number in END_SIGNALS:
        signal.signal(number, signal.SIG_IGN)


class DeferredSignals:
    """As a context: the signals are noted, and `deliver` hands them to the handlers of before.

    Those raise KeyboardInterrupt. Raised amid a call into C++, as the executor of rclpy makes
    many, it can come out as another error altogether, or be lost.
    """

    def __init__(self) -> None:
        """Hold nothing yet."""
        self._number: int | None = None
        self._before: dict[int, signal._HANDLER] = {}

    def came(self) -> bool:
        """Whether one was noted that is not delivered yet."""
        return self._number is not None

    def deliver(self) -> None:
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

    def __enter__(self) -> DeferredSignals:  # noqa: PYI034 -- Self needs Python 3.11
        """Begin to hold."""
        for number in END_SIGNALS:
            before = signal.getsignal(number)
            if callable(before):  # one that is ignored stays so
                self._before[number] = signal.signal(number, self._note)
        return self

    def __exit__(self, kind: object, *_rest: object) -> None:
        """Put the handlers back; what was not delivered is now, unless an error goes on."""
        for number, before in self._before.items():
            signal.signal(number, before)
        if kind is None:
            self.deliver()
