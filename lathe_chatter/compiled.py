"""`compiled`: how the inner loop is turned into machine code, and where that is kept.

Numba keeps the machine code of a function until the function's own file changes. But a function
holds the code of those that it calls, from other files too: after an update of one of them the
stale code of its callers would be run, and give other numbers. So the code of a package is kept
in a folder named after the content of all its files, and after Numba's version: one throws away
what another has kept.
"""

from __future__ import annotations

import gc
import hashlib
import os
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from llvmlite.binding.module import ModuleRef
from numba.core import event
from numba.core.codegen import CPUCodeLibrary
from numba.core.compiler import Flags
from numba.core.registry import CPUDispatcher

Function = TypeVar('Function', bound=Callable[..., Any])


@lru_cache
def _cache_folder(package: Path) -> str | None:
    """Where the machine code of a package is kept, as its sources are now; None: nowhere."""
    digest = hashlib.sha256(numba.__version__.encode() + Path(__file__).read_bytes())
    for file in sorted(package.glob('*.py')):
        digest.update(file.read_bytes())
    name = f'{package.name}-{digest.hexdigest()[:16]}'
    for base in _bases():
        try:
            (base / name).mkdir(mode=0o700, parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(base / name, os.W_OK):
            return str(base / name)
    return None


def _bases() -> Iterator[Path]:
    """The places to keep machine code in, the best first."""
    if numba.config.CACHE_DIR:
        yield Path(numba.config.CACHE_DIR)
    with suppress(RuntimeError):  # a user without a home
        home = os.environ.get('XDG_CACHE_HOME') or '~/.cache'
        yield Path(home).expanduser() / 'lathe_chatter'
    # Until the next boot. Others can guess the name, and code that they laid there would be run.
    base = Path(tempfile.gettempdir()) / f'lathe_chatter-{os.getuid()}'
    with suppress(OSError):
        base.mkdir(mode=0o700, exist_ok=True)
        found = base.lstat()
        closed = stat.S_ISDIR(found.st_mode) and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
        if closed and found.st_uid == os.getuid():
            yield base


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


@contextmanager
def _garbage_uncollected() -> Iterator[None]:
    """Compiling makes millions of objects, few of them garbage: looking for it takes an eighth."""
    usual = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if usual:
            gc.enable()


@contextmanager
def _declarations_unoptimized() -> Iterator[None]:
    """Numba optimises what is only declared, too: a tenth of its time for nothing."""
    usual = CPUCodeLibrary._optimize_functions  # noqa: SLF001

    def optimize(library: Any, module: Any) -> None:
        module.__class__ = _Definitions
        try:
            usual(library, module)
        finally:
            module.__class__ = ModuleRef

    CPUCodeLibrary._optimize_functions = optimize  # noqa: SLF001
    try:
        yield
    finally:
        CPUCodeLibrary._optimize_functions = usual  # noqa: SLF001


class _Definitions(ModuleRef):  # type: ignore[misc]  # llvmlite has no types
    """A module of LLVM that shows the functions that it defines."""

    @property
    def functions(self) -> Any:
        return (each for each in super().functions if not each.is_declaration)


@contextmanager
def before_compiling(begin: Callable[[], object]) -> Iterator[None]:
    """Call a function once, when something turns out not to be compiled yet."""
    listener = _FirstCompilation(begin)
    event.register('numba:compile', listener)
    try:
        yield
    finally:
        event.unregister('numba:compile', listener)


class _FirstCompilation(event.Listener):  # type: ignore[misc]  # Numba has no types
    def __init__(self, begin: Callable[[], object]) -> None:
        self._begin: Callable[[], object] | None = begin

    def on_start(self, _event: object) -> None:
        begin, self._begin = self._begin, None
        if begin is not None:
            begin()

    def on_end(self, _event: object) -> None:
        pass


def compiled(  # noqa: PLR0913 -- one keyword for each fact about a function
    *,
    inline: bool = False,
    merged: bool = False,
    borrows: bool = False,
    apart: bool = False,
    nogil: bool = False,
    inner: bool = False,
) -> Callable[[Function], Function]:
    """A decorator for a function of plain numbers and arrays.

    It may call compiled functions of its own package only, see above. Floating point is strict
    IEEE: no operation is reordered, and none fused but where the code says `fma`, so every machine
    computes the same bits. Like operations on neighbouring numbers are done at once where the
    processor can, which changes no bit either. Division by zero gives infinity, as in
    NumPy. Nothing is done before the first call: an import makes no folder.

    Args:
        inline: Whether callers take the code into theirs, for what is called in every step.
        merged: The same before types are known, for what returns an array that it has changed.
        borrows: Whether it makes no array and only looks at those of its caller, so that the
            references to them need not be counted: atomic operations, dearer than a step.
        apart: Whether no two of its arrays overlap, so that more can be done at once.
        nogil: Whether other Python threads may run meanwhile.
        inner: Whether only compiled functions call it: it is made machine code within these
            only, which takes two thirds of the time. Python, too, can call its `py_func`.
    """

    def set_flags(flags: Any) -> Any:
        """Set what Numba sets for functions of its own."""
        flags.noalias = apart
        flags.no_cpython_wrapper = inner
        flags.no_cfunc_wrapper = True  # what C would call
        flags.no_compile = inner  # its callers hold its code
        flags.__class__ = _Flags
        return flags

    def decorate(function: Function) -> Function:
        options: dict[str, Any] = {'error_model': 'numpy', 'nogil': nogil}
        if merged:
            options['inline'] = 'always'
        if borrows:
            options['_nrt'] = False  # as Numba's own helpers do
        result: Any = numba.njit(forceinline=inline, **options)(function)
        if result is function:  # NUMBA_DISABLE_JIT: plain Python, for a debugger
            return function
        # Where a Numba has no such hook, the same bits take longer.
        result._compiler._customize_flags = set_flags  # noqa: SLF001
        if inner:
            result.__class__ = _Inner
        compile_usually = result.compile
        package = Path(function.__code__.co_filename).parent

        def compile_at_once(signature: Any) -> Any:
            folder = _cache_folder(package)
            settings = _numba_set(SLP_VECTORIZE=1, CACHE_DIR=folder or '')
            with settings, _garbage_uncollected(), _declarations_unoptimized():
                if folder is not None and not inner and not result.overloads:
                    result.enable_caching()
                if inner:  # not once more for each number that stands in a call
                    signature = tuple(numba.types.unliteral(kind) for kind in signature)
                return compile_usually(signature)

        result.compile = compile_at_once
        return cast('Function', result)

    return decorate


class _Flags(Flags):  # type: ignore[misc]  # Numba has no types
    """Flags compared by what is set: Numba compares all defaults too, a tenth of its time."""

    __slots__ = ()

    def __hash__(self) -> int:
        return hash(frozenset(self._values))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Flags) and self._values == other._values


class _Inner(CPUDispatcher):  # type: ignore[misc]  # Numba has no types
    """A compiled function without the entry that a call from Python takes."""

    def add_overload(self, compiled_function: Any) -> None:
        """Note whose code the callers are to take into theirs, where it becomes machine code."""
        library, key = compiled_function.library, object()
        library._optimize_final_module = lambda: None  # noqa: SLF001
        finish = partial(setattr, library, '_finalized', True)  # noqa: FBT003
        library._finalize_final_module = finish  # noqa: SLF001
        self.targetctx.insert_user_function(key, compiled_function.fndesc, [library])
        arguments = tuple(compiled_function.signature.args)
        self.overloads[arguments] = compiled_function._replace(entry_point=key)

    def __call__(self, *_arguments: object, **_named: object) -> None:
        """Refuse it: there would be a crash."""
        raise TypeError(f'{self.__name__} is called by compiled functions only.')
