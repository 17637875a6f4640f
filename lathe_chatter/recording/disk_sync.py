"""fdatasync in a thread of its own: inline it would stall the writer for milliseconds."""

from __future__ import annotations

import os
import threading


class BackgroundSync:
    """Syncs one file on request, and closes it at the end.

    Args:
        descriptor: Of the open file, which is from now on closed here.

    Attributes:
        messages: How many messages of the file no loss of power can take any more.
    """

    def __init__(self, descriptor: int) -> None:
        """Start the thread."""
        self._descriptor = descriptor
        self._asked = threading.Event()
        self._ended = False
        self.messages = self._written = 0
        self._failure: OSError | None = None
        self._thread = threading.Thread(target=self._serve, name='fdatasync', daemon=True)
        self._thread.start()

    def ask(self, messages: int) -> None:
        """Sync a file of so many messages soon; requests meanwhile are served together."""
        self._written = messages
        self._asked.set()

    def check(self) -> None:
        """Tell of a sync that failed.

        Raises:
            OSError: What the disk said. What was synced before is there, later data may be.
        """
        if self._failure is not None:
            raise self._failure

    def end(self) -> None:
        """Sync once more and close the file, still in the background."""
        self._ended = True
        self._asked.set()

    def join(self) -> None:
        """Wait for the end.

        Raises:
            OSError: If a sync failed.
        """
        self._thread.join()
        self.check()

    def _serve(self) -> None:
        ended = False
        while not ended:
            self._asked.wait()
            self._asked.clear()
            # Read before the sync, which then covers all that was written.
            ended, written = self._ended, self._written
            try:
                os.fdatasync(self._descriptor)
            except OSError as error:
                self._failure = error
            else:
                self.messages = written
        os.close(self._descriptor)
