"""A thread that writes to the disk, so that whoever has data need not wait for it."""

from __future__ import annotations

import os
import queue
import threading
from collections.abc import Callable
from concurrent.futures import Future

Job = Callable[[], object]
_MAX_WAITING = 64
"""Jobs that may wait; more hold up who asks: memory ends before a disk that hangs comes back."""


class DiskThread:
    """Does jobs in the order in which they were asked for.

    Args:
        name: Of the thread.
    """

    def __init__(self, name: str) -> None:
        """Start the thread."""
        self._jobs: queue.Queue[tuple[Job, Future[object]] | None] = queue.Queue(_MAX_WAITING)
        self._failure: BaseException | None = None
        self._ended = False
        self._thread = threading.Thread(target=self._serve, name=name, daemon=True)
        self._thread.start()

    def do_later(self, job: Job) -> None:
        """Do something; should it fail, `check` says so later."""
        done: Future[object] = Future()
        done.add_done_callback(self._keep_failure)
        self._jobs.put((job, done))

    def do_now(self, job: Job) -> None:
        """Do something after all that was asked for, and wait for it.

        Raises:
            BaseException: What the job raises.
        """
        if self._ended:
            job()
            return
        done: Future[object] = Future()
        self._jobs.put((job, done))
        done.result()

    def check(self) -> None:
        """Raise, once, what a job failed with.

        Raises:
            BaseException: What it raised.
        """
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure

    def end(self, *, wait: bool = True) -> None:
        """End the thread, after all that was asked for."""
        if not self._ended:
            self._ended = True
            self._jobs.put(None)
        if wait:
            self._thread.join()

    def _keep_failure(self, done: Future[object]) -> None:
        self._failure = done.exception() or self._failure

    def _serve(self) -> None:
        while (asked := self._jobs.get()) is not None:
            job, done = asked
            try:
                done.set_result(job())
            except BaseException as error:  # noqa: BLE001 -- raised by `check` or `do_now`
                done.set_exception(error)


class FileSync:
    """Syncs one file on request, and closes it at the end: inline that would stall its writer.

    Args:
        descriptor: Of the open file, which is from now on closed here.

    Attributes:
        messages: How many messages of the file no loss of power can take any more.
    """

    def __init__(self, descriptor: int) -> None:
        """Start the thread."""
        self._descriptor = descriptor
        self._thread = DiskThread('fdatasync')
        self._waiting = False
        self.messages = self._written = 0

    def request(self, messages: int) -> None:
        """Sync a file of so many messages soon; requests meanwhile are served together."""
        self._written = messages
        if not self._waiting:
            self._waiting = True
            self._thread.do_later(self._sync)

    def check(self) -> None:
        """Raise what a sync failed with.

        Raises:
            OSError: What the disk said. What was synced before is there, later data may be.
        """
        self._thread.check()

    def end(self) -> None:
        """Sync once more and close the file, still in the background."""
        self._thread.do_later(self._sync)
        self._thread.do_later(lambda: os.close(self._descriptor))
        self._thread.end(wait=False)

    def join(self) -> None:
        """Wait for the end.

        Raises:
            OSError: If a sync failed.
        """
        self._thread.end()
        self._thread.check()

    def _sync(self) -> None:
        # Both before the sync, which then covers all that was written.
        self._waiting, written = False, self._written
        os.fdatasync(self._descriptor)
        self.messages = written
