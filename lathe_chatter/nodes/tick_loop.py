"""The loop of a node that is woken at set times: it sleeps until each, and serves in between.

An executor costs ten times as much as a tick of the lathe, and hands a timer from thread to
thread before it fires. So the loop sleeps by itself, and lets the executor look for requests
only every few ticks; where one was waiting, after the very next tick again.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol

from rclpy.context import Context
from rclpy.executors import Executor

from lathe_chatter.nodes.node_main import LOOK_UP

SERVE_PERIOD = 10_000_000
"""ns after which the executor looks for requests that nobody knows of."""
_MARGIN = 500_000
"""ns before the next tick in which the executor is not asked any more: it may come back late."""
_SECOND = 1e9


class Woken(Protocol):
    """A node of rclpy with a task at set times."""

    context: Context

    def next_wake(self) -> int | None:
        """When `wake` wants to be called, ns of time.monotonic_ns(); None for not by time."""

    def wake(self) -> None:
        """Do what is due."""

    def keep_place(self) -> None:
        """Look after the scheduling of this thread, from time to time."""


def spin_in_ticks(
    executor: Executor,
    node: Woken,
    ended: Callable[[], bool],
    serve_period: int = SERVE_PERIOD,
) -> None:
    """Wake and serve a node until `ended` says so or its context is shut down.

    Args:
        executor: Serves its requests.
        node: Which; its times come first.
        ended: Looked at after each tick, and ten times a second while there is none.
        serve_period: ns after which the executor looks for requests that nobody knows of.
    """
    executor.add_node(node)
    serve_at = 0
    try:
        while node.context.ok() and not ended():
            wake_at = node.next_wake()
            if wake_at is None:
                executor.spin_once(timeout_sec=LOOK_UP)
                continue
            now = time.monotonic_ns()
            if now >= serve_at:
                busy = _serve(executor, now, wake_at - _MARGIN)
                serve_at = 0 if busy else now + serve_period
                node.keep_place()
            left = wake_at - time.monotonic_ns()
            if left > 0:
                time.sleep(left / _SECOND)
            node.wake()
    finally:
        executor.remove_node(node)
        executor.shutdown()


def _serve(executor: Executor, now: int, until: int) -> bool:
    """Serve what waits, and what comes in a while; whether anything did."""
    left = max(until - now, 0)
    executor.spin_once(timeout_sec=left / _SECOND)
    busy = False
    while (now := time.monotonic_ns()) < until:
        busy = True
        executor.spin_once(timeout_sec=(until - now) / _SECOND)
    return busy
