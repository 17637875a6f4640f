"""Where the messages of a file are and when they were received, without reading its chunks."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

from mcap.opcode import Opcode

from lathe_chatter.recording.mcap_chunk_walk import ChunkHead, Damage, Found, Plain

_HEAD = 9
"""Bytes of a record before its content."""
_LOG_TIME = struct.Struct('<6xQ')
"""Within the content of a message."""


class Span(NamedTuple):
    """A chunk, or messages that are in none and follow each other.

    Attributes:
        first: Earliest log time, ns.
        offset: Where it begins in the file.
        last: Latest log time, ns.
        end: Where the messages end; 0 of a chunk.
    """

    first: int
    offset: int
    last: int
    end: int = 0

    @classmethod
    def of(cls, found: Plain, before: Span | None) -> Span:
        """A message, with those before it."""
        time = _LOG_TIME.unpack_from(found.content.ljust(_LOG_TIME.size, b'\0'))[0]
        end = found.offset + len(found.content)
        if before is None:
            return cls(time, found.offset - _HEAD, time, end)
        return cls(min(before.first, time), before.offset, max(before.last, time), end)


def spans_of(records: Iterable[Found], on_damage: Callable[[Damage], None]) -> Iterator[Span]:
    """Each chunk, and the messages outside of any as far as they follow each other.

    Args:
        records: Of a file, with chunks passed by.
        on_damage: Called with every part that cannot be read.
    """
    loose: Span | None = None
    for found in records:
        if isinstance(found, Plain) and found.opcode == Opcode.MESSAGE:
            loose = Span.of(found, loose)
            continue
        if loose is not None:
            yield loose
            loose = None
        if isinstance(found, ChunkHead):
            yield Span(found.first, found.offset, found.last)
        elif isinstance(found, Damage):
            on_damage(found)
    if loose is not None:
        yield loose
