"""Real time: how many ticks are due, the loop that makes them, and its place on a busy machine.

Pacing: what is due follows from the time that has passed, never from how often somebody called.
Where the process falls behind by more than it may catch up at once, the excess is given up,
counted as lag and reported.

The loop: an executor costs ten times as much as a tick of the lathe, and hands a timer from
thread to thread before it fires. So the loop sleeps by itself until the next tick, and lets the
executor look for requests only every few ticks; where one was waiting, after the very next tick.
Where ticks leave no time, requests get as much of it as the ticks had, and no more. A mark behind
what waits tells when it is done: an executor driven by events takes a request in one go and serves
it in a later one, so that of a flood many goes serve nothing, and timers stand behind them.

Scheduling: Linux shares a core fairly, but a task that wakes may wait while others finish their
slices, a few ms. Since 6.12 a task may ask for slices of its own that are short, and is then
woken sooner; its share of the core stays the same, and no privilege is needed. See
sched_setattr(2), sched_runtime of SCHED_OTHER. Where the system permits real-time scheduling (a
limit `rtprio`, or CAP_SYS_NICE), a thread that sleeps most of its time is woken at once.
"""

from __future__ import annotations

import ctypes
import os
import platform
import struct
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from rclpy.context import Context
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation

RCLError: type[Exception] = rclpy_implementation.RCLError
SECOND = 1_000_000_000
NEVER = 1 << 63
"""Later than any time, ns."""
LOOK_UP = 0.1
"""s after which a node that nothing happens to looks whether it was told to end."""
SERVE_PERIOD = 10_000_000
"""ns after which the executor looks for requests that nobody knows of."""
_MARK_PERIOD = 100_000_000
"""ns after which it is looked whether more waits than is served."""
_MARGIN = 500_000
"""ns before the next tick in which the executor does not wait any more: it may come back late."""
_LEAST_SHARE = 1_000_000
"""ns that requests may take where the ticks since the last of them took less."""
_LOOK_UP = int(SECOND * LOOK_UP)
_SET_ATTRIBUTES = {'x86_64': 314, 'aarch64': 274}
_SLICE = 100_000
"""ns, the shortest that Linux gives."""


@dataclass
class Pacer:
    """Ticks due against a clock in nanoseconds.

    Attributes:
        tick: Simulated duration of a tick, ns.
        period: From one tick to the next, ns of the clock.
        factor: Simulated seconds per second of the clock, > 0.
        patience: The most that may be caught up in one go, ns of the clock.
        keeps_all: Whether the excess is not given up but made later: where the clock is
            another's simulated time, all of it counts.
        lag: Simulated time that was given up since the start, ns.
        overruns: How often something was given up.
    """

    tick: float
    factor: float = 1.0
    patience: float = 0.05 * SECOND
    keeps_all: bool = False
    lag: float = 0.0
    overruns: int = 0
    period: float = field(init=False)
    _origin: float | None = None
    _done: int = 0

    def __post_init__(self) -> None:
        """See the class."""
        self.period = self.tick / self.factor

    def start(self, now: int) -> None:
        """Let the next tick be due one period from now: at first, and after a pause."""
        self._origin, self._done = now, 0

    @property
    def started(self) -> bool:
        """Whether it was ever started."""
        return self._origin is not None

    def gone_back(self, now: int) -> bool:
        """Whether the clock has gone back, and so has to be started again."""
        return self.lateness(now) < -self.period

    def skip(self, now: int) -> None:
        """Give up all that is due: the clock has jumped."""
        self.lag += self.lateness(now) * self.factor
        self.overruns += 1
        self.start(now)

    def change(self, factor: float, now: int) -> None:
        """Go on with another factor, as late as it is."""
        late = self.lateness(now)
        self.factor, self.period = factor, self.tick / factor
        self.start(now)
        self._origin = now - late

    def due(self, now: int) -> int:
        """The ticks to make now; they count as made.

        A call up to half a period early counts as in time, so that a timer of the same period
        makes one tick each time in spite of its jitter.
        """
        ticks = max(0, int(self.lateness(now) / self.period + 0.5))
        allowed = max(1, int(self.patience / self.period))
        if ticks > allowed:
            if not self.keeps_all:
                excess = (ticks - allowed) * self.period
                self._origin = (self._origin or 0.0) + excess
                self.lag += (ticks - allowed) * self.tick
                self.overruns += 1
            ticks = allowed
        self._done += ticks
        return ticks

    def give_back(self, ticks: int) -> None:
        """Let ticks that were due, and counted as made, be due again: there was no time."""
        self._done -= ticks

    def next_wake(self) -> int:
        """When to call next: when the next tick is due, but no sooner than after a tick's time.

        At a factor above 1 several ticks are made in one go.
        """
        return int((self._origin or 0.0) + self._done * self.period + max(self.period, self.tick))

    def lateness(self, now: int) -> float:
        """How long ago the last tick that was made had been due, ns; negative if it is early."""
        return 0.0 if self._origin is None else now - self._origin - self._done * self.period


@dataclass
class RequestLoad:
    """What its clients ask of a node, and what it takes.

    Attributes:
        served: Requests since the start.
        taken: Their time, ns.
    """

    served: int = 0
    taken: int = 0

    def note(self, began: int) -> None:
        """Note a request whose answer was begun at `began`, ns of time.monotonic_ns()."""
        self.served += 1
        self.taken += time.monotonic_ns() - began


class Tickable(Protocol):
    """A node of rclpy with a task at set times."""

    context: Context
    requests: RequestLoad

    def next_wake(self) -> int:
        """When `wake` wants to be called, ns of time.monotonic_ns(); NEVER for not by time."""

    def wake(self) -> None:
        """Do what is due."""

    def update_scheduling(self) -> None:
        """Look after the scheduling of this thread, from time to time."""


class Schedule:
    """Tasks of a node that is woken, each at a period of its own.

    Args:
        tasks: Period, s, and what is to be done.
    """

    def __init__(self, *tasks: tuple[float, Callable[[], object]]) -> None:
        """Let each be due for the first time one period from now."""
        now = time.monotonic_ns()
        self._tasks = [(int(SECOND * period), task) for period, task in tasks]
        self._due = [now + period for period, _ in self._tasks]

    def next_due(self) -> int:
        """When something is to be done, ns of time.monotonic_ns()."""
        return min(self._due)

    def run(self) -> None:
        """Do what is due, in the order in which the tasks were given; late is not twice."""
        now = time.monotonic_ns()
        for k, (period, task) in enumerate(self._tasks):
            if now >= self._due[k]:
                self._due[k] = now + period
                task()


@dataclass
class Served:
    """A node in a loop that wakes and serves several.

    Attributes:
        executor: Serves its requests.
        node: Which; its times come first.
        serve_period: ns after which the executor looks for requests that nobody knows of.
        serve_at: When it does next, ns of time.monotonic_ns().
        spent: What waking it took since, ns.
        marked: Whether a mark stands behind what waits, and was not reached yet.
        mark_at: When the next is set at the latest, ns of time.monotonic_ns().
    """

    executor: Executor
    node: Tickable
    serve_period: int = SERVE_PERIOD
    serve_at: int = 0
    spent: int = 0
    marked: bool = False
    mark_at: int = 0

    def serve(self, now: int, next_wake: int = 0) -> None:
        """Serve what waits, and what comes before the next wake if more is likely to come.

        To wait in vain is one more sleep that ends early, and costs as much as a tick.

        Args:
            now: ns of time.monotonic_ns().
            next_wake: Likewise; 0 for not to wait.
        """
        waits = not self.serve_at or next_wake - now > self.serve_period
        until = next_wake - _MARGIN if waits else 0
        busy = self._serve(until)
        self.serve_at, self.spent = 0 if busy else now + self.serve_period, 0
        self.node.update_scheduling()

    def _serve(self, until: int) -> bool:
        """Serve what waits, and what comes until a time, ns; whether more is likely to come.

        The ticks since the last time have their share: as much goes to what waits, and no more.
        """
        first = before = self.node.requests.served
        now = time.monotonic_ns()
        share_ends = now + max(self.spent, _LEAST_SHARE)
        # Not in each idle look, for a mark takes as much as that. Not only where requests were
        # served: what others tell waits, too.
        due = not self.serve_at or now >= self.mark_at
        if due and not (self.marked or isinstance(self.executor, SingleThreadedExecutor)):
            self.marked, self.mark_at = True, now + _MARK_PERIOD
            self.executor.create_task(self._reach_mark)
        while True:
            self.executor.spin_once(timeout_sec=max(until - now, 0) / SECOND)
            now, served = time.monotonic_ns(), self.node.requests.served
            if now >= until and (now >= share_ends or not (self.marked or served != before)):
                return self.marked or served != first
            before = served

    def _reach_mark(self) -> None:
        self.marked = False


def spin_in_ticks(executor: Executor, node: Tickable, ended: Callable[[], bool]) -> None:
    """Wake and serve a node until `ended` says so or its context is shut down.

    Args:
        executor: Serves its requests.
        node: Which; its times come first.
        ended: Looked at after each tick, and ten times a second while there is none.
    """
    spin_together([Served(executor, node)], ended)


def spin_together(served: Sequence[Served], ended: Callable[[], bool]) -> None:
    """Wake and serve several nodes of one context, until `ended` says so or it is shut down.

    Args:
        served: The first of them is waited with for requests; the others are looked after.
        ended: As for `spin_in_ticks`.
    """
    for each in served:
        each.executor.add_node(each.node)
    try:
        _spin(served, ended)
    except (ExternalShutdownException, RCLError):  # the one when serving, the other in a tick
        if served[0].node.context.ok():
            raise
    finally:
        for each in served:
            each.executor.remove_node(each.node)
            each.executor.shutdown()


def _spin(served: Sequence[Served], ended: Callable[[], bool]) -> None:
    """Go round 500 times a second: each call of a function here takes a thousandth of a core."""
    while not ended():
        times = [each.node.next_wake() for each in served]
        now = time.monotonic_ns()
        earliest = min(now + _LOOK_UP, *times)
        for each in reversed(served):
            if now >= each.serve_at:
                each.serve(now, earliest if each is served[0] else 0)
        left = earliest - time.monotonic_ns()
        if left > 0:
            time.sleep(left / SECOND)
        now = time.monotonic_ns()
        for at, each in zip(times, served, strict=True):
            if at <= now:
                each.node.wake()
                now, before = time.monotonic_ns(), now
                each.spent += now - before


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
