"""Takes away what a killed process left half-made in the shared memory of Fast DDS.

Fast DDS makes a file of shared memory for each port at which a participant is reached. One that is
killed between the making of that file and the word in it that says that it is ready leaves a file
on which every node that comes later, of whatever program, waits for ever without a sentence.
"""

from __future__ import annotations

import re
import time
from pathlib import Path

SHARED_MEMORY = Path('/dev/shm')  # noqa: S108  # of glibc's shm_open
_PORT = re.compile(r'(fastrtps|fastdds)_port\d+')  # of Fast DDS 2 and 3
_READY = (2).to_bytes(4, 'little')
"""First word of a segment that is ready (Boost.Interprocess, managed_open_or_create_impl.hpp)."""
_PATIENCE = 2.0
"""s that a process which is alive has to make a port ready; a millisecond is what it needs."""
_LOOK_AGAIN = 0.05  # s


def remove_half_made_ports(folder: Path = SHARED_MEMORY) -> list[str]:
    """Remove the ports on which a node would wait for ever; takes 2 s where there are any.

    Args:
        folder: Where the middleware has its shared memory.

    Returns:
        A sentence about each, also of one that is another user's and stays.
    """
    until = time.monotonic() + _PATIENCE
    found = _half_made(folder)
    while found and time.monotonic() < until:
        time.sleep(_LOOK_AGAIN)
        found &= _half_made(folder)
    return [_remove(path) for path, _inode in sorted(found)]


def _half_made(folder: Path) -> set[tuple[Path, int]]:
    """The files, each with its inode: another of the same name is another port."""
    found = set()
    for path in folder.glob('fast*_port*'):
        if _PORT.fullmatch(path.name):
            try:
                with path.open('rb') as file:
                    if file.read(len(_READY)) != _READY:
                        found.add((path, path.stat().st_ino))
            except OSError:
                continue  # it went meanwhile, or its user keeps it from us and our nodes
    return found


def _remove(path: Path) -> str:
    killed = f'{path} was left half-made by a process that was killed'
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        return f'{killed}, and a node may wait on it for ever; to remove it: {error.strerror}.'
    return f'{killed}; it is removed, for a node would have waited on it for ever.'
