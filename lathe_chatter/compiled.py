"""`compiled`: how the inner loop is turned into machine code, and where that is kept.

Numba keeps the machine code of a function until the function's own file changes. But a function
holds the code of those that it calls, from other files too: after an update of one of them the
stale code of its callers would be run, and give other numbers. So the code of a package is kept
in a folder named after the content of all its files.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar, cast

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
    folder = f'{package.name}-{digest.hexdigest()[:16]}'
    if not _is_writable(base / folder):  # a service without a home: kept until the next boot
        base = Path(tempfile.gettempdir()) / f'lathe_chatter-{os.getuid()}'
    return str(base / folder)


def _is_writable(folder: Path) -> bool:
    """Whether files can be made in a folder, which is made where it is not there."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK)


@contextmanager
def _numba_set(**options: Any) -> Iterator[None]:
    """Numba's settings otherwise for a while: they are global, and others use Numba too."""
    usual = {name: getattr(numba.config, name) for name in options}
    try:
        for name, value in options.items():
            setattr(numba.config, name, value)
        yield
    finally:
        for name, value in usual.items():
            setattr(numba.config, name, value)


def _apart(flags: Any) -> Any:
    """Flags of a function whose arrays do not overlap; Numba sets them for its own loops."""
    flags.noalias = True
    return flags


def compiled(
    *, inline: bool = False, borrows: bool = False, apart: bool = False, nogil: bool = False
) -> Callable[[Function], Function]:
    """A decorator for a function of plain numbers and arrays.

    It may call compiled functions of its own package only, see above. Floating point is strict
    IEEE: no operation is fused or reordered, so every machine computes the same bits. Like
    operations on neighbouring numbers are done at once where the processor can (a quarter off
    the time of a step), which changes no bit either. Division by zero gives infinity, as in
    NumPy.

    Args:
        inline: Whether callers take the code into theirs, for what is called in every step.
        borrows: Whether it makes no array and only looks at those of its caller, so that the
            references to them need not be counted: atomic operations, dearer than a step.
        apart: Whether no two of its arrays overlap, so that more can be done at once.
        nogil: Whether other Python threads may run meanwhile.
    """

    def decorate(function: Function) -> Function:
        folder = _cache_folder(Path(function.__code__.co_filename).parent)
        with _numba_set(CACHE_DIR=folder):
            options = {'cache': True, 'error_model': 'numpy', 'nogil': nogil}
            if borrows:
                options['_nrt'] = False  # as Numba's own helpers do
            result: Any = numba.njit(forceinline=inline, **options)(function)
        if result is function:  # NUMBA_DISABLE_JIT: plain Python, for a debugger
            return function
        if apart:
            # Where a Numba has no such hook, the same bits take longer.
            result._compiler._customize_flags = _apart  # noqa: SLF001
        compile_usually = result.compile

        def compile_at_once(signature: Any) -> Any:
            with _numba_set(SLP_VECTORIZE=1):
                return compile_usually(signature)

        result.compile = compile_at_once
        return cast('Function', result)

    return decorate
