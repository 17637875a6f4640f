"""`compiled`: how the inner loop is turned into machine code, and where that is kept.

Numba keeps the machine code of a function until the function's own file changes. But a function
holds the code of those that it calls, from other files too: after an update of one of them the
stale code of its callers would be run, and give other numbers. So the code of a package is kept
in a folder named after the content of all its files.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

import numba

Function = TypeVar('Function', bound=Callable[..., Any])


@lru_cache
def _cache_folder(package: Path) -> str:
    """Where the machine code of a package belongs, as its sources are now."""
    digest = hashlib.sha256(Path(__file__).read_bytes())
    for file in sorted(package.glob('*.py')):
        digest.update(file.read_bytes())
    home = os.environ.get('XDG_CACHE_HOME') or '~/.cache'
    base = Path(numba.config.CACHE_DIR or Path(home).expanduser() / 'lathe_chatter')
    return str(base / f'{package.name}-{digest.hexdigest()[:16]}')


def compiled(*, inline: bool = False, nogil: bool = False) -> Callable[[Function], Function]:
    """A decorator for a function of plain numbers and arrays.

    It may call compiled functions of its own package only, see above. Floating point is strict
    IEEE: no operation is fused or reordered, so every machine computes the same bits. Division
    by zero gives infinity, as in NumPy.

    Args:
        inline: Whether callers take the code into theirs, for what is called in every step.
        nogil: Whether other Python threads may run meanwhile.
    """

    def decorate(function: Function) -> Function:
        usual = numba.config.CACHE_DIR
        numba.config.CACHE_DIR = _cache_folder(Path(function.__code__.co_filename).parent)
        try:
            options = {'cache': True, 'error_model': 'numpy', 'nogil': nogil}
            result: Function = numba.njit(forceinline=inline, **options)(function)
        finally:
            numba.config.CACHE_DIR = usual
        return result

    return decorate
