"""The inner loop of reading: through the records of a chunk, wanted columns into arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lathe_chatter.compiled import compiled
from lathe_chatter.model import Array, Integers

Bytes = NDArray[np.uint8]

MESSAGE = 5
"""Opcode of a message."""
OTHER_LAYOUT, NO_RECORDS = -1, -2
"""Why a chunk was not cut: a block of another layout, or records that do not fill it."""
_BEFORE, _HEAD = 9, 31
"""Bytes of opcode and length, and of a message before what it holds."""


@compiled()
def _number(records: Bytes, place: int, size: int) -> int:
    """An unsigned little-endian number."""
    value = 0
    for k in range(size):
        value |= int(records[place + k]) << (8 * k)
    return value


@compiled(nogil=True)
def cut_columns(  # noqa: PLR0913, PLR0917 -- what it is told and where it writes
    records: Bytes,
    channel: int,
    head: Bytes,
    block: Bytes,
    numbers: Array,
    width: int,
    columns: Integers,
    out: Array,
    log_times: Integers,
    messages: int,
) -> int:
    """Cut columns out of every block of samples in a chunk.

    Args:
        records: The bytes of the chunk (uint8).
        channel: Of the samples.
        head: What each block has before its numbers (uint8).
        block: Room for the numbers of one block (uint8).
        numbers: The same room as numbers (rows * width,).
        width: Columns of a block.
        columns: Which are wanted (k,).
        out: Where they go (k, n); the blocks cut before stand at its beginning.
        log_times: When each block was received, ns (m,); likewise.
        messages: How many blocks were cut before.

    Returns:
        How many blocks have been cut now, or OTHER_LAYOUT or NO_RECORDS.
    """
    at, size = 0, len(records)
    rows = len(numbers) // width
    while at < size:
        length = _number(records, at + 1, 8) if at + _BEFORE <= size else -1
        if length < 0 or length > size - at - _BEFORE:
            return NO_RECORDS
        if records[at] == MESSAGE and _number(records, at + _BEFORE, 2) == channel:
            payload = at + _HEAD
            if length != _HEAD - _BEFORE + len(head) + len(block):
                return OTHER_LAYOUT
            # Parts first, then indexes from 0 on: the compiler makes whole vectors of these.
            beginning = records[payload : payload + len(head)]
            different = 0
            for k in range(len(head)):
                different |= beginning[k] ^ head[k]
            if different:
                return OTHER_LAYOUT
            rest = records[payload + len(head) : payload + len(head) + len(block)]
            for k in range(len(block)):
                block[k] = rest[k]
            for j in range(len(columns)):
                column = numbers[columns[j] :: width]
                line = out[j, messages * rows : (messages + 1) * rows]
                for row in range(rows):
                    line[row] = column[row]
            log_times[messages] = _number(records, at + 15, 8)
            messages += 1
        at += _BEFORE + length
    return messages
