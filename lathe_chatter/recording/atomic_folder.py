"""Copies that are there whole or not at all."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def atomic_folder(path: Path) -> Iterator[None]:
    """A folder to make that goes again if its making fails, so that a second try finds none.

    For copies alone: of a record, what there is of it is kept. A folder that was there before
    is left as it is.
    """
    was_there = path.exists()
    try:
        yield
    except BaseException:
        if not was_there:
            shutil.rmtree(path, ignore_errors=True)
        raise
