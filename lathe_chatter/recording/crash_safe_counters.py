"""What a recorder has taken, kept where its sudden end does not reach: so a loss has a number.

What comes between the last commit and a kill is in no file. But how much it was is: the counts
stand in a page of memory that is mapped from a file beside those of the run, and the system keeps
that page whatever becomes of the process. A run that is finished has no such file any more.
"""

from __future__ import annotations

import contextlib
import mmap
import os
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

FILE_NAME = 'unfinished'
_MAGIC = b'lathe_chatter 1\n'
_ENTRY = struct.Struct('<QQ')
_SIZE = 1 << 16
_CAPACITY = (_SIZE - len(_MAGIC)) // _ENTRY.size


class Taken(NamedTuple):
    """How many messages of a channel were taken, and when the last was received, ns."""

    messages: int
    last: int


class UnfinishedCounts:
    """Counts messages by the numbers of their channels.

    A disk that has no room for the counts, or a system that cannot map files, costs the counts
    and nothing else.

    Args:
        folder: Of the run.
    """

    def __init__(self, folder: Path) -> None:
        """Make the file, with its room on the disk."""
        self._path = folder / FILE_NAME
        self._counts = [0] * _CAPACITY
        self._page: mmap.mmap | None = None
        with contextlib.suppress(OSError, ValueError):
            descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o644)
            try:
                # Written and not only asked for: a page without room behind it kills who writes.
                os.write(descriptor, _MAGIC.ljust(_SIZE, b'\0'))
                self._page = mmap.mmap(descriptor, _SIZE)
            finally:
                os.close(descriptor)

    def count(self, channel: int, log_time: int) -> None:
        """A message of a channel was taken, received in ns since the epoch."""
        if self._page is None or channel >= _CAPACITY:
            return
        self._counts[channel] += 1
        place = len(_MAGIC) + channel * _ENTRY.size
        _ENTRY.pack_into(self._page, place, self._counts[channel], log_time)

    def close(self, *, finished: bool) -> None:
        """Leave the counts, or take them away where everything counted is in the run."""
        if self._page is None:
            return
        self._page.close()
        self._page = None
        if finished:
            with contextlib.suppress(OSError):
                self._path.unlink()


def taken(folder: Path) -> Mapping[int, Taken]:
    """What the recorder of an unfinished run had taken, by channel; empty where nothing tells."""
    try:
        data = (folder / FILE_NAME).read_bytes()
    except OSError:
        return {}
    if len(data) != _SIZE or not data.startswith(_MAGIC):
        return {}
    rest = len(data) - len(_MAGIC) - _CAPACITY * _ENTRY.size
    entries = _ENTRY.iter_unpack(data[len(_MAGIC) : len(data) - rest])
    return {channel: Taken(*entry) for channel, entry in enumerate(entries) if entry[0]}
