"""Samples out of the chunks of a file, each proven by its CRC before."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lathe_chatter.recording.chunk_messages import HEAD, Messages, messages_of
from lathe_chatter.recording.mcap_chunk_walk import Chunk, Damage, read_chunk
from lathe_chatter.recording.recorded_file import RecordedFile
from lathe_chatter.recording.sample_blocks import (
    AT_ONCE,
    BlockJoiner,
    SampleBlocks,
    Stretch,
    evenly_spaced,
    stretches_of,
)
from lathe_chatter.samples.codec import BlockLayout, block_layout

Spans = Sequence[tuple[int, int]]
"""From when to when, log times, ns."""
_FIXED = 11
"""Bytes of a message's head that are the same in all of a channel: opcode, length, channel."""


def as_written(
    file: RecordedFile, topic: str, wanted: Sequence[str] | None, received: Spans = ()
) -> Iterator[SampleBlocks]:
    """The samples of a topic in a file in the order of the file, some 4 s at a time.

    Args:
        file: Which.
        topic: Of the samples.
        wanted: Columns, in any order, besides the time; all where None.
        received: If given, what was received outside of these spans may be left out.

    Raises:
        OSError: If the file cannot be read.
        LayoutError: If a message is no block of samples.
    """
    numbers = file.channels_of(topic)
    sizes = _index_sizes(file, topic, numbers[0]) if len(numbers) == 1 else []
    if sizes:
        yield from _IndexedReader(file, numbers[0], sizes, wanted).blocks(received)
        return
    joiner = BlockJoiner(wanted)
    for chunk, contents in enumerate(file.contents(), 1):
        joiner.add_all(stretches_of(contents.messages.of(*file.channels_of(topic))))
        if chunk % AT_ONCE == 0:
            yield from joiner.taken()
    yield from joiner.taken()


def as_received(
    file: RecordedFile, topic: str, wanted: Sequence[str] | None = None
) -> Iterator[SampleBlocks]:
    """The samples of a topic in a file in the order of reception; otherwise as `as_written`."""
    joiner, latest = BlockJoiner(wanted), 0
    for contents, bound in file.by_time():
        messages = contents.messages.of(*file.channels_of(topic))
        joiner.add_all(stretches_of(messages))
        latest = max(latest, int(messages.heads['log_time'].max(initial=0)))
        if latest <= bound:
            yield from map(SampleBlocks.by_reception, joiner.taken())
    yield from map(SampleBlocks.by_reception, joiner.taken())


# -- by the index of a file ----------------------------------------------------------------


def _index_sizes(file: RecordedFile, topic: str, channel: int) -> list[int]:
    """Bytes of the message index of a channel behind each chunk, if all of it is told.

    Empty where a walk is the better way.
    """
    sizes = [place.index_size(channel) for place in file.known.chunks]
    whole = -1 not in sizes and sum(sizes) == 16 * file.count(topic)
    return sizes if whole else []


class _Usual(NamedTuple):
    """What a message of samples looks like, as long as nothing changes.

    Attributes:
        dtype: Its head and times.
        fixed: Opcode, length and channel.
        head: What its payload begins with.
        size: Of the whole record, bytes.
        layout: Of its payload.
    """

    dtype: Any
    fixed: bytes
    head: bytes
    size: int
    layout: BlockLayout

    @classmethod
    def of(cls, messages: Messages) -> _Usual:
        """The last of some messages."""
        payload = messages.payload(-1)
        layout = block_layout(payload)
        dtype = np.dtype(
            {
                'names': ['fixed', 'log_time', 'publish_time', 'head'],
                'formats': [f'V{_FIXED}', '<u8', '<u8', f'V{layout.start}'],
                'offsets': [0, 15, 23, HEAD.itemsize],  # as in HEAD
            }
        )
        fixed = messages.heads[-1:].tobytes()[:_FIXED]
        head = payload[: layout.start]
        return cls(dtype, fixed, head, HEAD.itemsize + len(payload), layout)


class _IndexedReader:
    """Reads one chunk after the other: with threads it took twice the time, for Python's lock.

    Args:
        file: That has them.
        channel: Of the samples.
        sizes: Bytes of the message index of the channel behind each chunk.
        wanted: Columns besides the time; all where None.
    """

    def __init__(
        self, file: RecordedFile, channel: int, sizes: list[int], wanted: Sequence[str] | None
    ) -> None:
        self._file, self._channel, self._sizes, self._wanted = file, channel, sizes, wanted
        self._buffer = bytearray()  # to be given fresh pages costs more than to read
        self._usual: _Usual | None = None
        self._apart = 0, b''  # a size of messages, and offsets at which they do not overlap

    def blocks(self, received: Spans) -> Iterator[SampleBlocks]:
        """The samples of the channel, as in `as_written`; what is damaged is told."""
        joiner = BlockJoiner(self._wanted)
        descriptor = os.open(self._file.path, os.O_RDONLY)
        try:
            chunks = zip(self._file.known.chunks, self._sizes, strict=True)
            for count, (place, size) in enumerate(chunks, 1):
                if received and not any(a <= place.last and b >= place.first for a, b in received):
                    continue
                chunk = read_chunk(self._file.path, partial(self._read, descriptor), place)
                damage = chunk if isinstance(chunk, Damage) else self._take(chunk, size, joiner)
                if damage or count % AT_ONCE == 0:
                    yield from joiner.taken()
                if damage:
                    self._file.on_damage(damage)
            yield from joiner.taken()
        finally:
            os.close(descriptor)

    def _read(self, descriptor: int, size: int, offset: int) -> memoryview:
        if len(self._buffer) < size:
            self._buffer = bytearray(size * 5 // 4)
        view = memoryview(self._buffer)[:size]
        return view[: os.preadv(descriptor, [view], offset)]

    def _take(self, chunk: Chunk, size: int, joiner: BlockJoiner) -> Damage | None:
        usual = self._as_usual(chunk, size)
        if usual is not None:
            joiner.add(usual)
            return None
        try:
            messages = messages_of(chunk).of(self._channel)
        except ValueError as error:
            return Damage(self._file.path, chunk.offset, chunk.offset, str(error))
        joiner.add_all(stretches_of(messages))
        if len(messages.heads):
            self._usual = _Usual.of(messages)
        return None

    def _as_usual(self, chunk: Chunk, size: int) -> Stretch | None:
        """The messages of the channel in a chunk, where they are as usual; None where not.

        No CRC covers a message index, but one covers the summary, which says how long it is. So
        entries that all lead to different messages of the channel lead to all of them.
        """
        usual, index = self._usual, chunk.indexes.get(self._channel, b'')
        if usual is None or not index or len(index) != size:
            return None
        count = size // 16
        offsets = np.frombuffer(index, '<i8')[1::2]
        if self._apart != (usual.size, offsets.tobytes()):
            if offsets[0] < 0 or (offsets[1:] - offsets[:-1] < usual.size).any():
                return None
            self._apart = usual.size, offsets.tobytes()
        if offsets[-1] > len(chunk.records) - usual.size:
            return None
        memory, first, stride = evenly_spaced(chunk.records, offsets, usual.size)
        heads: NDArray[Any] = np.ndarray((count,), usual.dtype, memory, first, (stride,))
        if heads['fixed'].tobytes() != usual.fixed * count:
            return None
        if heads['head'].tobytes() != usual.head * count:
            return None
        return Stretch(
            memory,
            first + HEAD.itemsize,
            stride,
            usual.layout,
            heads['log_time'].astype(np.int64),
            heads['publish_time'].astype(np.int64),
        )
