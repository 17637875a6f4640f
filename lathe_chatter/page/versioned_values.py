"""What a page shows, by name, with versions: each viewer is sent what it has not seen."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np

from lathe_chatter.array_types import Array


class Board:
    """Named values that change now and then."""

    def __init__(self) -> None:
        """Begin empty."""
        self._values: dict[str, tuple[int, Any]] = {}
        self._count = 0

    def put(self, name: str, value: Any) -> None:
        """Show a value from now on; one that is as it was is no news."""
        if name not in self._values or self._values[name][1] != value:
            self._count += 1
            self._values[name] = self._count, value

    def get(self, name: str) -> Any:
        """What is shown, None where nothing is."""
        return self._values.get(name, (0, None))[1]

    def news(self, seen: dict[str, int]) -> dict[str, Any]:
        """What a viewer has not seen; `seen` has it from now on."""
        found = {n: v for n, (version, v) in self._values.items() if version > seen.get(n, 0)}
        seen.update({name: self._values[name][0] for name in found})
        return found


def encode_frame(header: Mapping[str, Any], arrays: Mapping[str, Array]) -> bytes:
    """A message to a page: the length of a JSON text, the text, and float32 arrays.

    The text has under `arrays` the names and lengths of the arrays, in order, and is filled up
    with blanks, so that the arrays begin at a multiple of four bytes.
    """
    shapes = [(name, int(array.size)) for name, array in arrays.items()]
    text = json.dumps({**header, 'arrays': shapes}, default=_plain, separators=(',', ':'))
    data = text.encode()
    data += b' ' * (-len(data) % 4)
    parts = (np.ascontiguousarray(array, '<f4').tobytes() for array in arrays.values())
    return b''.join((struct.pack('<I', len(data)), data, *parts))


def finite(values: Array) -> list[float | None]:
    """Numbers as JSON has them; what is not finite is null."""
    return [value if math.isfinite(value) else None for value in values.tolist()]


def _plain(value: Any) -> Any:
    """What JSON has no word for."""
    return value.item() if hasattr(value, 'item') else str(value)
