"""Coordinates in registers where they are few, in memory where they are many.

Two modes a body are eight numbers: as a tuple they go from step to step without a way through
memory, which costs more than the step's arithmetic. A tuple of many would be copied whole at each
change of an entry; then it is an array. Which it is the compiler decides by the number of modes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import types
from numba.cpython.unsafe.tuple import tuple_setitem
from numba.extending import overload

from lathe_chatter.arrays import Array

_FEW = 4
_OPTIONS = {'forceinline': True, '_nrt': False, 'error_model': 'numpy'}


def loaded(z: Array, room: Array, shape: tuple[float, ...]) -> Any:
    """The coordinates `z` (2n,), to be changed by `with_entry`; `room` (2n,) may hold them."""
    room[: 2 * len(shape)] = z
    return room


def with_entry(z: Any, i: int, value: float) -> Any:
    """The coordinates with another entry `i`."""
    z[i] = value
    return z


def moved_to(z: Any, end: Any, shape: tuple[float, ...]) -> Any:
    """The coordinates `end` in the place of `z`."""
    z[: 2 * len(shape)] = end
    return z


@overload(loaded, jit_options=_OPTIONS)  # type: ignore[untyped-decorator]  # Numba
def _loaded(z: Any, room: Any, shape: Any) -> Callable[..., Any]:  # noqa: ARG001
    if len(shape) <= _FEW:

        def in_registers(z: Any, room: Any, shape: Any) -> Any:  # noqa: ARG001
            result = shape + shape
            for i in range(2 * len(shape)):
                result = tuple_setitem(result, i, z[i])
            return result

        return in_registers

    def in_memory(z: Any, room: Any, shape: Any) -> Any:
        for i in range(2 * len(shape)):
            room[i] = z[i]
        return room

    return in_memory


@overload(with_entry, jit_options=_OPTIONS)  # type: ignore[untyped-decorator]  # Numba
def _with_entry(z: Any, i: Any, value: Any) -> Callable[..., Any]:  # noqa: ARG001
    if isinstance(z, types.BaseTuple):

        def in_registers(z: Any, i: Any, value: Any) -> Any:
            return tuple_setitem(z, i, value)

        return in_registers

    def in_memory(z: Any, i: Any, value: Any) -> Any:
        z[i] = value
        return z

    return in_memory


@overload(moved_to, jit_options=_OPTIONS)  # type: ignore[untyped-decorator]  # Numba
def _moved_to(z: Any, end: Any, shape: Any) -> Callable[..., Any]:  # noqa: ARG001
    if isinstance(z, types.BaseTuple):

        def in_registers(z: Any, end: Any, shape: Any) -> Any:  # noqa: ARG001
            return end

        return in_registers

    def in_memory(z: Any, end: Any, shape: Any) -> Any:
        for i in range(2 * len(shape)):
            z[i] = end[i]
        return z

    return in_memory
