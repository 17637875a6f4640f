"""Samples out of the messages of a file, many messages at a time and some columns of them.

The messages of samples in a chunk are mostly evenly spaced, so that a column of all of them is a
strided view of the bytes of the chunk. Every chunk is proven by its CRC before.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lathe_chatter.arrays import Array, Integers
from lathe_chatter.errors import LayoutError
from lathe_chatter.recording.chunk_messages import HEAD, Messages, messages_of
from lathe_chatter.recording.mcap_file import RecordedFile
from lathe_chatter.recording.mcap_reader import Chunk, Damage, read_chunk
from lathe_chatter.samples.codec import BlockLayout, block_layout

TIME = 'time'
_FIXED = 11
"""Bytes of a message's head that are the same in all of a channel: opcode, length, channel."""
_AT_ONCE = 16
"""Chunks in one piece of work: 4 s of a recording, some MB."""
_AHEAD = 2
"""Pieces of work that may wait or be done, beyond those under way."""
_WORTHWHILE = 1000
"""Blocks in a file from which on threads pay."""


class SampleBlocks(NamedTuple):
    """Blocks of samples that follow each other in a record, one for each message.

    Attributes:
        columns: Names; the time is always among them.
        signals: One row for each column (k, n).
        rows: Samples in each block (blocks,).
        log_times: When each was received, ns (blocks,).
        publish_times: When each was published, ns (blocks,).
    """

    columns: tuple[str, ...]
    signals: Array
    rows: Integers
    log_times: Integers
    publish_times: Integers

    @property
    def samples(self) -> Array:
        """All samples (n, k)."""
        return self.signals.T

    @property
    def times(self) -> Array:
        """Of all samples (n,), s."""
        times: Array = self.signals[self.columns.index(TIME)]
        return times

    @property
    def spans(self) -> Array:
        """Simulated times of the first and last sample of each block, s (2, blocks)."""
        ends = np.cumsum(self.rows)
        spans = np.full((2, len(ends)), np.nan)
        some = self.rows > 0
        spans[0, some] = self.times[(ends - self.rows)[some]]
        spans[1, some] = self.times[ends[some] - 1]
        return spans

    def by_reception(self) -> SampleBlocks:
        """The same blocks in the order of reception."""
        order = np.argsort(self.log_times, kind='stable')
        begins = np.cumsum(self.rows) - self.rows
        places = [np.arange(begins[k], begins[k] + self.rows[k]) for k in order.tolist()]
        return SampleBlocks(
            self.columns,
            self.signals[:, np.concatenate(places)],
            self.rows[order],
            self.log_times[order],
            self.publish_times[order],
        )


def as_written(
    file: RecordedFile, topic: str, wanted: Sequence[str] | None
) -> Iterator[SampleBlocks]:
    """The samples of a topic in a file in the order of the file, some 4 s at a time.

    Args:
        file: Which.
        topic: Of the samples.
        wanted: Columns, in any order, besides the time; all where None.

    Raises:
        OSError: If the file cannot be read.
        LayoutError: If a message is no block of samples.
    """
    numbers = file.channels_of(topic)
    sizes = _index_sizes(file, topic, numbers[0]) if len(numbers) == 1 else []
    if sizes:
        yield from _in_threads(file, _Extractor(file, numbers[0], sizes, wanted))
        return
    waiting: list[_Stretch] = []
    for contents in file.contents():
        waiting += _stretches(contents.messages.of(*file.channels_of(topic)))
        if len(waiting) >= _AT_ONCE:
            yield from _joined(waiting, wanted)
            waiting.clear()
    yield from _joined(waiting, wanted)


def as_received(
    file: RecordedFile, topic: str, wanted: Sequence[str] | None = None
) -> Iterator[SampleBlocks]:
    """The samples of a topic in a file in the order of reception; otherwise as `as_written`."""
    waiting: list[_Stretch] = []
    for contents, bound in file.by_time():
        waiting += _stretches(contents.messages.of(*file.channels_of(topic)))
        if max((int(each.log_times.max()) for each in waiting), default=0) <= bound:
            yield from map(SampleBlocks.by_reception, _joined(waiting, wanted))
            waiting.clear()
    yield from map(SampleBlocks.by_reception, _joined(waiting, wanted))


class _Stretch(NamedTuple):
    """Evenly spaced messages of samples with the same layout.

    Attributes:
        memory: That holds them.
        begin: Where the first payload is.
        stride: Bytes from one to the next.
        layout: Of each.
        log_times: When each was received, ns (n,).
        publish_times: When each was published, ns (n,).
    """

    memory: bytes | NDArray[np.uint8]
    begin: int
    stride: int
    layout: BlockLayout
    log_times: Integers
    publish_times: Integers

    def copy_to(self, signals: Array, names: Sequence[str]) -> None:
        """Copy named columns into the rows of an array (k, n)."""
        layout, count = self.layout, len(self.log_times)
        samples: Array = np.ndarray(
            (count, layout.rows, len(layout.columns)),
            f'{layout.order}f8',
            buffer=self.memory,
            offset=self.begin + layout.start,
            strides=(self.stride, 8 * len(layout.columns), 8),
        )
        by_block = signals.reshape(len(names), count, layout.rows)
        for k, name in enumerate(names):
            by_block[k] = samples[:, :, layout.columns.index(name)]


def _stretches(messages: Messages) -> Iterator[_Stretch]:
    """Messages of samples, as few stretches as their layouts allow.

    Raises:
        LayoutError: If a message is no block of samples.
    """
    begun, count = 0, len(messages.heads)
    sizes = messages.sizes
    while begun < count:
        layout = block_layout(messages.payload(begun))
        size = int(sizes[begun])
        others = np.flatnonzero(sizes[begun:] != size)
        after = begun + (int(others[0]) if len(others) else count - begun)
        memory, first, stride = _evenly(messages.records, messages.starts[begun:after], size)
        heads: NDArray[np.uint8] = np.ndarray(
            (after - begun, layout.start), np.uint8, memory, first, (stride, 1)
        )
        if not (same := (heads == heads[0]).all(axis=1)).all():
            after = begun + int(np.argmin(same))
        yield _Stretch(
            memory,
            first,
            stride,
            layout,
            messages.heads['log_time'][begun:after].astype(np.int64),
            messages.heads['publish_time'][begun:after].astype(np.int64),
        )
        begun = after


def _evenly(
    records: bytes, starts: Integers, size: int
) -> tuple[bytes | NDArray[np.uint8], int, int]:
    """Memory where equal pieces are evenly spaced, the first of them, and their distance."""
    if len(starts) == 1:
        return records, int(starts[0]), size
    steps = starts[1:] - starts[:-1]
    if steps.min() == steps.max():
        return records, int(starts[0]), int(steps[0])
    every: NDArray[Any] = np.ndarray((len(records) - size + 1,), f'V{size}', records, 0, (1,))
    return every[starts].view(np.uint8), 0, size


def _joined(stretches: Sequence[_Stretch], wanted: Sequence[str] | None) -> Iterator[SampleBlocks]:
    """Stretches as arrays, as few as their columns allow.

    Raises:
        LayoutError: If the samples have no time.
    """
    begun = 0
    while begun < len(stretches):
        columns = stretches[begun].layout.columns
        after = begun
        while after < len(stretches) and stretches[after].layout.columns == columns:
            after += 1
        yield _joined_alike(stretches[begun:after], _chosen(columns, wanted))
        begun = after


def _joined_alike(stretches: Sequence[_Stretch], names: tuple[str, ...]) -> SampleBlocks:
    rows = [np.full(len(each.log_times), each.layout.rows) for each in stretches]
    signals = np.empty((len(names), sum(int(part.sum()) for part in rows)))
    begin = 0
    for stretch, part in zip(stretches, rows, strict=True):
        end = begin + len(part) * stretch.layout.rows
        stretch.copy_to(signals[:, begin:end], names)
        begin = end
    return SampleBlocks(
        names,
        signals,
        np.concatenate(rows),
        np.concatenate([each.log_times for each in stretches]),
        np.concatenate([each.publish_times for each in stretches]),
    )


def _chosen(columns: tuple[str, ...], wanted: Sequence[str] | None) -> tuple[str, ...]:
    if TIME not in columns:
        raise LayoutError(f'The samples have no column {TIME}, only {", ".join(columns)}.')
    return tuple(name for name in columns if wanted is None or name in wanted or name == TIME)


# -- by the index of a file, in threads ----------------------------------------------------


def _index_sizes(file: RecordedFile, topic: str, channel: int) -> list[int]:
    """Bytes of the message index of a channel behind each chunk, if all of it is told.

    Empty where a walk is the better way.
    """
    count = file.count(topic)
    sizes = [place.index_size(channel) for place in file.known.chunks]
    whole = count >= _WORTHWHILE and -1 not in sizes and sum(sizes) == 16 * count
    return sizes if whole else []


def _in_threads(file: RecordedFile, extractor: _Extractor) -> Iterator[SampleBlocks]:
    places = range(0, len(file.known.chunks), _AT_ONCE)
    groups = deque(slice(first, first + _AT_ONCE) for first in places)
    workers = min(os.cpu_count() or 1, 4)
    descriptor = os.open(file.path, os.O_RDONLY)
    try:
        with ThreadPoolExecutor(workers, thread_name_prefix='read samples') as pool:
            waiting: deque[Future[list[SampleBlocks | Damage]]] = deque()
            try:
                while groups or waiting:
                    while groups and len(waiting) < workers + _AHEAD:
                        waiting.append(pool.submit(extractor.read, descriptor, groups.popleft()))
                    for found in waiting.popleft().result():
                        if isinstance(found, Damage):
                            file.on_damage(found)
                        else:
                            yield found
            finally:
                for work in waiting:
                    work.cancel()
    finally:
        os.close(descriptor)


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


class _Extractor:
    """Reads groups of chunks, each call in any thread.

    Args:
        file: That has them.
        channel: Of the samples.
        sizes: Bytes of the message index of the channel behind each chunk.
        wanted: Columns besides the time; all where None.
    """

    def __init__(
        self, file: RecordedFile, channel: int, sizes: list[int], wanted: Sequence[str] | None
    ) -> None:
        self._path, self._places = file.path, file.known.chunks
        self._channel, self._sizes, self._wanted = channel, sizes, wanted
        self._buffers: list[bytearray] = []  # to be given fresh pages costs more than to read
        self._usual: _Usual | None = None

    def read(self, descriptor: int, group: slice) -> list[SampleBlocks | Damage]:
        """The samples in some chunks, and what of these is damaged."""
        buffer = self._buffers.pop() if self._buffers else bytearray()
        found: list[SampleBlocks | Damage] = []
        stretches: list[_Stretch] = []

        def read(size: int, offset: int) -> memoryview:
            if len(buffer) < size:
                buffer.extend(bytes(size * 5 // 4 - len(buffer)))
            view = memoryview(buffer)[:size]
            return view[: os.preadv(descriptor, [view], offset)]

        for place, size in zip(self._places[group], self._sizes[group], strict=True):
            chunk = read_chunk(self._path, read, place)
            if isinstance(chunk, Damage):
                found += [*_joined(stretches, self._wanted), chunk]
                stretches.clear()
                continue
            usual = self._as_usual(chunk, size)
            if usual is not None:
                stretches.append(usual)
                continue
            try:
                messages = messages_of(chunk).of(self._channel)
            except ValueError as error:
                found.append(Damage(self._path, chunk.offset, chunk.offset, str(error)))
                continue
            stretches += _stretches(messages)
            if len(messages.heads):
                self._usual = _Usual.of(messages)
        found += _joined(stretches, self._wanted)
        self._buffers.append(buffer)
        return found

    def _as_usual(self, chunk: Chunk, size: int) -> _Stretch | None:
        """The messages of the channel in a chunk, where they are as usual; None where not.

        No CRC covers a message index, but one covers the summary, which says how long it is. So
        entries that all lead to different messages of the channel lead to all of them.
        """
        usual, index = self._usual, chunk.indexes.get(self._channel, b'')
        if usual is None or not index or len(index) != size:
            return None
        count = size // 16
        offsets = np.frombuffer(index, '<u8')[1::2].astype(np.int64)
        steps = offsets[1:] - offsets[:-1]
        if steps.size and steps.min() < usual.size:
            return None
        if offsets[0] < 0 or offsets[-1] > len(chunk.records) - usual.size:
            return None
        memory, first, stride = _evenly(chunk.records, offsets, usual.size)
        heads: NDArray[Any] = np.ndarray((count,), usual.dtype, memory, first, (stride,))
        if heads['fixed'].tobytes() != usual.fixed * count:
            return None
        if heads['head'].tobytes() != usual.head * count:
            return None
        return _Stretch(
            memory,
            first + HEAD.itemsize,
            stride,
            usual.layout,
            heads['log_time'].astype(np.int64),
            heads['publish_time'].astype(np.int64),
        )
