"""fdatasync in a thread of its own: inline it would stall the writer for milliseconds."""

from __future__ import annotations

import os
import threading


class BackgroundSync:
    """Syncs one file on request, and closes it at the end.

    Args:
        descriptor: Of the open file, which is from now on closed here.
    """

    def __init__(self, descriptor: int) -> None:
        """Start the thread."""
        self._descriptor = descriptor
        self._asked = threading.Event()
        self._ended = False
        self._failure: OSError | None = None
        self._thread = threading.Thread(target=self._serve, name='fdatasync', daemon=True)
        self._thread.start()

    def ask(self) -> None:
        """Sync soon; requests that come meanwhile are served together."""
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
            ended = self._ended  # read before the sync, which then covers all that was written
            try:
                os.fdatasync(self._descriptor)
            except OSError as error:
                self._failure = error
        os.close(self._descriptor)
