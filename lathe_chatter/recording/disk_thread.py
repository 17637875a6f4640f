"""A thread that does one thing after the other, so that whoever asks need not wait for it."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from concurrent.futures import Future

Job = Callable[[], object]
_WAITING = 64
"""Jobs that may wait; more hold up who asks: memory ends before a disk that hangs comes back."""


class Background:
    """Does jobs in the order in which they were asked for.

    Args:
        name: Of the thread.
    """

    def __init__(self, name: str) -> None:
        """Start the thread."""
        self._jobs: queue.Queue[tuple[Job, Future[object]] | None] = queue.Queue(_WAITING)
        self._failure: BaseException | None = None
        self._ended = False
        self._thread = threading.Thread(target=self._serve, name=name, daemon=True)
        self._thread.start()

    def soon(self, job: Job) -> None:
        """Do something; should it fail, `check` says so later."""
        done: Future[object] = Future()
        done.add_done_callback(self._note)
        self._jobs.put((job, done))

    def now(self, job: Job) -> None:
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
        """Tell, once, of a job that failed.

        Raises:
            BaseException: What it raised.
        """
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure

    def end(self) -> None:
        """End the thread, after all that was asked for."""
        if not self._ended:
            self._ended = True
            self._jobs.put(None)
            self._thread.join()

    def _note(self, done: Future[object]) -> None:
        self._failure = done.exception() or self._failure

    def _serve(self) -> None:
        while (asked := self._jobs.get()) is not None:
            job, done = asked
            try:
                done.set_result(job())
            except BaseException as error:  # noqa: BLE001 -- told to who asked
                done.set_exception(error)
