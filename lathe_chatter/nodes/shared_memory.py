"""Takes away what a killed process left half-made or locked in the shared memory of Fast DDS.

Fast DDS makes a file of shared memory for each port at which a participant is reached. One that is
killed between the making of that file and the word in it that says that it is ready leaves a file
on which every node that comes later, of whatever program, waits for ever without a sentence. Each
port has a semaphore too; one that a killed process had holds the next node up for 20 s.
"""

from __future__ import annotations

import os
import re
import time
from pathlib import Path

SHARED_MEMORY = Path('/dev/shm')  # noqa: S108  # of glibc's shm_open
_PORT = re.compile(r'(fastrtps|fastdds)_port\d+')  # of Fast DDS 2 and 3
_SEMAPHORE = re.compile(rf'sem\.{_PORT.pattern}_mutex')
_READY = (2).to_bytes(4, 'little')
"""First word of a segment that is ready (Boost.Interprocess, managed_open_or_create_impl.hpp)."""
_TAKEN = bytes(4)
"""First word of a semaphore that somebody has (glibc's sem_t: its value)."""
_PATIENCE = 2.0
"""s that a process which is alive has to be ready with a port; a millisecond is what it needs."""
_LOOK_AGAIN = 0.05  # s


def free_ports(folder: Path = SHARED_MEMORY) -> list[str]:
    """Remove that on which a node would wait; takes 2 s where there is any such thing.

    Args:
        folder: Where the middleware has its shared memory.

    Returns:
        A sentence about each, also of one that is another user's and stays.
    """
    until = time.monotonic() + _PATIENCE
    found = _in_the_way(folder)
    while found and time.monotonic() < until:
        time.sleep(_LOOK_AGAIN)
        found &= _in_the_way(folder)
    return [_remove(path) for path, _inode in sorted(found)]


def _in_the_way(folder: Path) -> set[tuple[Path, int]]:
    """The files, each with its inode: another of the same name is another port."""
    found = map(_left_behind, folder.glob('*fast*_port*'))
    return {each for each in found if each}


def _left_behind(path: Path) -> tuple[Path, int] | None:
    try:
        with path.open('rb') as file:
            first, inode = file.read(len(_READY)), os.fstat(file.fileno()).st_ino
    except OSError:  # it went meanwhile, or its user keeps it from us and our nodes
        return None
    half_made = _PORT.fullmatch(path.name) and first != _READY
    locked = _SEMAPHORE.fullmatch(path.name) and first == _TAKEN
    return (path, inode) if half_made or locked else None


def _remove(path: Path) -> str:
    how = 'half-made' if _PORT.fullmatch(path.name) else 'locked'
    killed = f'{path} was left {how} by a process that was killed'
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        return f'{killed}, and a node may wait on it for ever; to remove it: {error.strerror}.'
    return f'{killed}; it is removed, for a node would have waited on it.'
