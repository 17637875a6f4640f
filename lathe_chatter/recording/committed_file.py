"""An MCAP file that is complete on disk after every commit.

MCAP ends in a summary (index, statistics) and a footer; a file without them opens in no indexed
reader. A commit therefore writes the new chunk *and* a fresh summary and footer in one call, over
the summary that the commit before it left. The new bytes are always more than those they
replace, so at no moment is there a file without an end: kill -9 loses what came since the last
commit and nothing else.
"""

from __future__ import annotations

import os
import threading
from pathlib import Path

from mcap.writer import CompressionType, IndexType, Writer

_CHUNK_SIZE = 1 << 22
"""Larger than what comes between two commits, which each end a chunk."""


class _Tape:
    """What the MCAP writer takes for its output file: it only ever collects bytes."""

    def __init__(self) -> None:
        self.pending = bytearray()
        self.start = 0

    def write(self, data: bytes) -> int:
        self.pending += data
        return len(data)

    def tell(self) -> int:
        return self.start + len(self.pending)

    def flush(self) -> None:
        """Nothing is held back here."""

    def taken(self) -> bytes:
        """What was written since the last call."""
        data = bytes(self.pending)
        self.start += len(data)
        self.pending.clear()
        return data


class CommittedFile:
    """Writes one MCAP file, chunked, with lz4 and CRCs, by commits.

    Args:
        path: Of the file, which must not exist.

    Attributes:
        writer: The MCAP writer: schemas, channels and messages go here.

    Raises:
        OSError: If the file cannot be made, or a commit cannot be written; what came since
            the one before is then not on disk, and the file is as that one left it.
    """

    def __init__(self, path: Path) -> None:
        """Make the file and commit its empty beginning."""
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
        self._tape = _Tape()
        self.writer = Writer(
            self._tape,  # all that the writer asks of a file
            chunk_size=_CHUNK_SIZE,
            compression=CompressionType.LZ4,
            index_types=IndexType.ALL,
            # Optional, and the writer would repeat those of earlier commits.
            use_summary_offsets=False,
        )
        self.writer.start(profile='ros2', library='lathe_chatter')
        self._syncs = _BackgroundSync(self._descriptor)
        self._body_end = 0
        self.commit(even_if_empty=True)

    def commit(self, *, even_if_empty: bool = False) -> int:
        """Put everything written so far on disk, as a complete file.

        The data is handed to the operating system before this returns, and to the disk soon
        after, by another thread.

        Returns:
            How many bytes of data this added.
        """
        self.writer.flush()
        before = self._tape.start
        body = self._tape.taken()
        if not body and not even_if_empty:
            return 0
        end_of_body = self._tape.start
        self.writer.finish()
        tail = self._tape.taken()
        # The next chunk goes where this summary begins.
        self._tape.start = end_of_body
        _write_at(self._descriptor, body + tail, before)
        self._syncs.ask()
        return len(body)

    def close(self) -> None:
        """Commit, wait for the disk, and close."""
        try:
            self.commit()
        finally:
            self.abandon()

    def abandon(self) -> None:
        """Close without another commit: what came since the last one is lost."""
        self._syncs.end()
        try:
            os.fsync(self._descriptor)
        finally:
            os.close(self._descriptor)


def _write_at(descriptor: int, data: bytes, offset: int) -> None:
    """Write all of `data` at `offset`; one call, unless the system takes only a part."""
    view = memoryview(data)
    while view:
        written = os.pwrite(descriptor, view, offset)
        view, offset = view[written:], offset + written


class _BackgroundSync:
    """fdatasync in a thread of its own: inline it would stall the writer for milliseconds."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._asked = threading.Event()
        self._ended = False
        self._thread = threading.Thread(target=self._serve, name='fdatasync', daemon=True)
        self._thread.start()

    def ask(self) -> None:
        """Sync soon; requests that come meanwhile are served together."""
        self._asked.set()

    def end(self) -> None:
        """Finish the sync under way and stop."""
        self._ended = True
        self._asked.set()
        self._thread.join()

    def _serve(self) -> None:
        while True:
            self._asked.wait()
            self._asked.clear()
            if self._ended:
                return
            os.fdatasync(self._descriptor)
