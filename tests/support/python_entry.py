"""Compiled functions that only others of their kind call, as tests call them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from lathe_chatter.compiled import compiled

Function = TypeVar('Function', bound=Callable[..., Any])


def with_entry(function: Function) -> Function:
    """The same code with an entry for a call from Python."""
    source: Function = getattr(function, 'py_func', function)
    return compiled(borrows=True)(source)
