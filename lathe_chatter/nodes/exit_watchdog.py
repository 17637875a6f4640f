"""The end of a process whose middleware does not let it go.

Fast DDS 2.14, that of Jazzy, can wait for itself for ever where a participant is destroyed while
another one is being discovered: `set_listener` waits, with a lock held, for a callback to return
that waits for the lock. rclpy holds the GIL meanwhile, so neither a thread of Python nor a handler
of signals can end the process; a timer of the C library can, with the exit code that is due.
"""

from __future__ import annotations

import ctypes
import sys

_BY_THREAD = 2  # SIGEV_THREAD of sigevent(3type): the timer calls a function
_CLOCK_MONOTONIC = 1
_WANTED = ('timer_create', 'timer_settime', '_exit')


class _Event(ctypes.Structure):
    """`struct sigevent` of Linux: 64 bytes."""

    _fields_ = (
        ('value', ctypes.c_long),
        ('signal', ctypes.c_int),
        ('notify', ctypes.c_int),
        ('function', ctypes.c_void_p),
        ('attributes', ctypes.c_void_p),
        ('rest', ctypes.c_char * 32),
    )


class _Times(ctypes.Structure):
    """`struct itimerspec`: first the period, 0 for none, then the time until it is due."""

    _fields_ = tuple(
        (name, ctypes.c_long) for name in ('period_s', 'period_ns', 'seconds', 'nanoseconds')
    )


def end_within(seconds: float, code: int) -> None:
    """End this process with an exit code if it has not ended by itself.

    Everything that has to be kept must be on disk. Where the C library has no such timer nothing
    is done.

    Args:
        seconds: That it has, more than 0.
        code: Its exit code.
    """
    if sys.platform != 'linux':
        return
    library = ctypes.CDLL(None)
    try:
        make, start, leave = (library[name] for name in _WANTED)
    except AttributeError:  # glibc before 2.34 has them in another library
        return
    event = _Event(
        value=code, notify=_BY_THREAD, function=ctypes.cast(leave, ctypes.c_void_p).value
    )
    timer = ctypes.c_void_p()
    if make(_CLOCK_MONOTONIC, ctypes.byref(event), ctypes.byref(timer)) == 0:
        whole, rest = divmod(seconds, 1.0)
        times = _Times(seconds=int(whole), nanoseconds=int(1e9 * rest))
        start(timer, 0, ctypes.byref(times), None)
