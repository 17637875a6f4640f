"""Columns of samples cut out of chunks, many messages at a time."""

from __future__ import annotations

import os
import struct
from collections.abc import Iterable, Sequence
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lathe_chatter.arrays import Array, Integers
from lathe_chatter.errors import LayoutError
from lathe_chatter.recording.chunk_messages import HEAD, messages_of
from lathe_chatter.recording.mcap_reader import Damage, Read, read_chunk
from lathe_chatter.recording.mcap_summary import ChunkPlace
from lathe_chatter.recording.run_file import RecordedFile
from lathe_chatter.samples.codec import Blocks, Layout, blocks_of

TIME = 'time'
_FIXED = 11
"""Bytes of a message's head that are the same in all of a channel: opcode, length, channel."""
_SIZE_IN_LENGTH = HEAD.itemsize - 9
_INDEX_HEAD = 15
"""Bytes of a message index before its entries, which have 16 each."""
_FEW = 8
"""Stretches of messages in a chunk that are worth some calls each."""


class Cut(NamedTuple):
    """Some columns of blocks of samples that follow each other; good until the next one comes.

    Attributes:
        columns: Names.
        signals: (k, n).
        times: (n,), s.
        rows: Samples in each block (blocks,).
        log_times: When each was received, ns (blocks,).
    """

    columns: tuple[str, ...]
    signals: Array
    times: Array
    rows: Integers
    log_times: Integers


def cut_of(blocks: Blocks, wanted: Sequence[str] | None) -> Cut:
    """The wanted columns of blocks that were read already; all where None.

    Raises:
        LayoutError: If the samples have no time.
    """
    names = _chosen(blocks.columns, wanted)
    places = [blocks.columns.index(name) for name in names]
    return Cut(
        names,
        blocks.samples.T[places],
        blocks.samples[:, blocks.columns.index(TIME)],
        blocks.rows,
        blocks.log_times,
    )


def _chosen(columns: tuple[str, ...], wanted: Sequence[str] | None) -> tuple[str, ...]:
    if TIME not in columns:
        raise LayoutError(f'The samples have no column {TIME}, only {", ".join(columns)}.')
    return tuple(name for name in columns if wanted is None or name in wanted)


class Room:
    """Memory that is used again and again: to be given fresh pages costs more than to cut."""

    def __init__(self) -> None:
        """Begin with none."""
        self._signals: Array = np.empty((0, 0))
        self._records = np.empty(0, np.uint8)
        self._read = bytearray()

    def read(self, descriptor: int, size: int, offset: int) -> memoryview:
        """Bytes of a file, fewer where it ends."""
        if len(self._read) < size:
            self._read = bytearray(size * 5 // 4)
        view = memoryview(self._read)[:size]
        return view[: os.preadv(descriptor, [view], offset)]

    def signals(self, columns: int, rows: int) -> Array:
        """An array (columns, rows) with anything in."""
        if self._signals.shape[1] < rows:
            self._signals = np.empty((columns, rows * 5 // 4))
        return self._signals[:, :rows]

    def put(self, part: bytes, start: int) -> NDArray[np.uint8]:
        """Put bytes behind those that were put before, up to `start`: all of them."""
        size = start + len(part)
        if len(self._records) < size:
            more = np.empty(size * 3 // 2, np.uint8)
            more[:start] = self._records[:start]
            self._records = more
        self._records[start:size] = np.frombuffer(part, np.uint8)
        return self._records[:size]


class Cutter:
    """Cuts groups of chunks, each call in any thread.

    Args:
        file: That has them.
        channel: Of the samples.
        layout: Of the first block of the channel.
        head: What this has before its numbers.
        wanted: Columns; all where None.

    Raises:
        LayoutError: If the samples have no time.
    """

    def __init__(
        self,
        file: RecordedFile,
        channel: int,
        layout: Layout,
        head: bytes,
        wanted: Sequence[str] | None,
    ) -> None:
        """Find the places of the columns."""
        self._file = file
        self._channel = channel
        self._layout = layout
        fixed = b'\x05' + struct.pack('<QH', _SIZE_IN_LENGTH + len(head) + layout.size, channel)
        rest = bytes(HEAD.itemsize - _FIXED)
        self._head = np.frombuffer(fixed + rest + head, np.uint8)
        self._wanted = wanted
        self._names = _chosen(layout.columns, wanted)
        # The time comes last, whether it is wanted or not.
        self._places = [layout.columns.index(name) for name in (*self._names, TIME)]

    def cut(self, descriptor: int, group: Sequence[ChunkPlace], room: Room) -> list[Cut | Damage]:
        """The samples in some chunks, and what of these is damaged."""
        damages: list[Cut | Damage] = []
        records = np.empty(0, np.uint8)
        indexes: list[bytes] = []
        begins = [0]
        read = partial(room.read, descriptor)
        for place in group:
            chunk = read_chunk(self._file.path, read, place)
            if isinstance(chunk, Damage):
                damages.append(chunk)
                continue
            index = chunk.indexes.get(self._channel, b'')
            if len(index) != index_size(place, self._channel):
                return self._each(read, group)
            if index:
                indexes.append(index)
                # At once, so that its own memory is free for the next.
                records = room.put(chunk.records, begins[-1])
                begins.append(len(records))
        if not indexes:
            return damages
        offsets = self._offsets(indexes, np.array(begins))
        cut = None if offsets is None else self._cut(records, offsets, len(indexes), room)
        return self._each(read, group) if cut is None else [*damages, cut]

    def _offsets(self, indexes: Sequence[bytes], begins: Integers) -> Integers | None:
        """Where the messages of the channel are in chunks that are joined; None if unclear.

        No CRC covers a message index, but one covers the summary, which says how long it is. So
        entries that all lead to different messages of the channel lead to all of them.

        Args:
            indexes: Of the channel in each chunk.
            begins: Where each chunk begins, and where the last one ends.
        """
        counts = [len(index) // 16 for index in indexes]
        found = np.frombuffer(b''.join(indexes), '<u8')[1::2].astype(np.int64)
        found += np.repeat(begins[:-1], counts)
        size = len(self._head) + self._layout.size
        outside = (found < np.repeat(begins[:-1], counts)) | (
            found > np.repeat(begins[1:] - size, counts)
        )
        return None if outside.any() or (found[1:] < found[:-1] + size).any() else found

    def _cut(
        self, records: NDArray[np.uint8], offsets: Integers, chunks: int, room: Room
    ) -> Cut | None:
        """The columns of blocks; None where not all are of the channel, with the usual layout."""
        rows, width = self._layout.rows, len(self._layout.columns)
        heads = _pieces(records, offsets, len(self._head))
        log_times = heads[:, 15:23].copy().view('<u8')[:, 0].astype(np.int64)
        heads[:, _FIXED : HEAD.itemsize] = 0
        if (heads != self._head).any():
            return None
        size = len(self._head) + self._layout.size
        breaks = np.flatnonzero(np.diff(offsets) != size) + 1
        if len(breaks) > _FEW * chunks:
            records = _pieces(records, offsets, size).ravel()
            offsets, breaks = np.arange(len(offsets)) * size, breaks[:0]
        out = room.signals(len(self._places), len(offsets) * rows)
        by_block = out.reshape(len(self._places), len(offsets), rows)
        for first, after in pairwise((0, *breaks.tolist(), len(offsets))):
            # Blocks that follow each other with nothing between, where they are.
            samples: Array = np.ndarray(
                (after - first, rows, width),
                '<f8',
                buffer=records,
                offset=int(offsets[first]) + len(self._head),
                strides=(size, 8 * width, 8),
            )
            for k, place in enumerate(self._places):
                by_block[k, first:after] = samples[:, :, place]
        told = np.full(len(offsets), rows)
        return Cut(self._names, out[:-1], out[-1], told, log_times)

    def _each(self, read: Read, group: Iterable[ChunkPlace]) -> list[Cut | Damage]:
        """The samples in some chunks by the way that takes any layout."""
        found: list[Cut | Damage] = []
        for place in group:
            chunk = read_chunk(self._file.path, read, place)
            if isinstance(chunk, Damage):
                found.append(chunk)
                continue
            try:
                messages = messages_of(chunk).of(self._channel)
            except ValueError as error:
                damage = Damage(self._file.path, chunk.offset, chunk.offset, str(error))
                found.append(damage)
                continue
            found += [cut_of(blocks, self._wanted) for blocks in blocks_of(messages)]
        return found


def index_size(place: ChunkPlace, channel: int) -> int:
    """Bytes that the entries of a channel have by the summary; -1 if it does not tell."""
    if not place.indexes:
        return -1
    ends = place.index_of(channel)
    size = 0 if ends is None else ends[1] - ends[0] - _INDEX_HEAD
    return -1 if size % 16 else size


def _pieces(records: NDArray[np.uint8], starts: Integers, size: int) -> NDArray[np.uint8]:
    """Equal pieces of bytes that begin anywhere, as a copy (n, size)."""
    shape = (len(records) - size + 1,)
    every: NDArray[Any] = np.ndarray(shape, f'V{size}', buffer=records, strides=(1,))
    return np.ascontiguousarray(every[starts]).view(np.uint8).reshape(len(starts), size)
