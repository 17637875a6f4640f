"""Files and folders that are there whole or not at all."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def atomic_output(path: Path) -> Iterator[Path]:
    """Where to make a file or folder, from where it is moved to its place once it is whole.

    For what can be made again: of a record, what there is of it is kept. What a process that was
    killed left here, the next one that makes the same removes.

    Args:
        path: Its place.

    Raises:
        OSError: If it cannot be made there; it names the place.
    """
    beside = path.with_name(f'.{path.name}.partial')
    try:
        shutil.rmtree(beside, ignore_errors=True)
        beside.mkdir(parents=True)
        yield beside / path.name
        (beside / path.name).replace(path)
    except OSError as error:
        if error.filename is not None and str(error.filename).startswith(str(beside)):
            error.filename = str(path)
        raise
    finally:
        shutil.rmtree(beside, ignore_errors=True)
