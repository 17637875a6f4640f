"""Being woken in time on a busy machine.

Linux shares a core fairly, but a task that wakes may wait while others finish their slices, a
few ms. Since 6.12 a task may ask for slices of its own that are short, and is then woken
sooner; its share of the core stays the same, and no privilege is needed. See sched_setattr(2),
sched_runtime of SCHED_OTHER. Where the system permits real-time scheduling (a limit `rtprio`,
or CAP_SYS_NICE), a thread that sleeps most of its time is woken at once.
"""

from __future__ import annotations

import ctypes
import os
import platform
import struct

_SET_ATTRIBUTES = {'x86_64': 314, 'aarch64': 274}
_SLICE = 100_000
"""ns, the shortest that Linux gives."""


class RealTime:
    """Real-time scheduling (SCHED_RR) of the calling thread, while it is wanted and permitted.

    It is not passed on to threads and processes that are started meanwhile.

    Args:
        priority: 1 (lowest) to 99; 0 for never.
    """

    def __init__(self, priority: int) -> None:
        """Keep what somebody has chosen for the process, if anybody has."""
        self._priority = priority
        self._possible = (
            priority > 0
            and platform.system() == 'Linux'
            and os.sched_getscheduler(0) == os.SCHED_OTHER
        )
        self.held = False

    @property
    def word(self) -> str:
        """What the thread has, for people."""
        return f'real time, priority {self._priority}' if self.held else 'ordinary'

    def hold(self, *, wanted: bool) -> None:
        """Take it, or give it back."""
        if not self._possible or wanted == self.held:
            return
        policy = os.SCHED_RR | os.SCHED_RESET_ON_FORK if wanted else os.SCHED_OTHER
        try:
            os.sched_setscheduler(0, policy, os.sched_param(self._priority if wanted else 0))
        except PermissionError:
            self._possible = False
            return
        self.held = wanted
        if not wanted:
            ask_for_short_slices()


def ask_for_short_slices() -> bool:
    """Ask for this thread and those that it starts later.

    Returns:
        Whether the system took the request; one before 6.12 takes it and does nothing.
    """
    call = _SET_ATTRIBUTES.get(platform.machine())
    if platform.system() != 'Linux' or call is None:
        return False
    if os.sched_getscheduler(0) != os.SCHED_OTHER:
        return False  # somebody has given it a better place already
    nice = os.getpriority(os.PRIO_PROCESS, 0)
    # size, policy, flags, nice, priority, runtime, deadline, period, two clamps of utilisation
    attributes = struct.pack('IIQiIQQQII', 56, os.SCHED_OTHER, 0, nice, 0, _SLICE, 0, 0, 0, 0)
    return int(ctypes.CDLL(None).syscall(call, 0, attributes, 0)) == 0
