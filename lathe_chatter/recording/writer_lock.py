"""Whether somebody still writes a file: its writer holds a lock, which ends with the process."""

from __future__ import annotations

import contextlib
import fcntl
from pathlib import Path


def hold(descriptor: int) -> None:
    """Let others see that an open file is being written, until it is closed or its writer ends.

    A file system without locks has none: then nobody is seen to write.
    """
    with contextlib.suppress(OSError):
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


def is_held(file: Path) -> bool:
    """Whether a file is being written.

    Raises:
        OSError: If it cannot be opened.
    """
    with file.open('rb') as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        except OSError:
            return False
    return False
