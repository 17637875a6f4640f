"""Columns of samples straight from the chunks of a file, several chunks at a time."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from lathe_chatter.errors import LayoutError
from lathe_chatter.model import Array, Integers
from lathe_chatter.recording.chunk_messages import messages_of
from lathe_chatter.recording.recorded_file import RecordedFile
from lathe_chatter.recording.sample_blocks import Blocks, Layout, blocks_of, layout_of
from lathe_chatter.recording.sample_scan import NO_RECORDS, OTHER_LAYOUT, cut_columns
from lathe_chatter.recording.scan import Damage, read_chunk
from lathe_chatter.recording.summary import ChunkPlace

TIME = 'time'
_AT_ONCE = 16
"""Chunks in one piece of work: 4 s of a recording, some MB."""
_AHEAD = 2
"""Pieces of work that may wait or be done, beyond those under way."""
_WORTHWHILE = 5000
"""Blocks in a file from which on it pays to have the inner loop loaded."""


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


def cuts_by_index(
    file: RecordedFile, topic: str, wanted: Sequence[str] | None
) -> Iterator[Cut] | None:
    """The samples of a topic by the index of its file, decompressed and cut in threads.

    Every chunk is proven by its CRC, as when the file is walked.

    Returns:
        None where the file has no index, or so few blocks that a walk is quicker.

    Raises:
        OSError: If the file cannot be read.
    """
    numbers = [n for n, channel in file.known.channels.items() if channel.topic == topic]
    if len(numbers) != 1 or not file.known.chunks or file.count(topic) < _WORTHWHILE:
        return None
    layout, head = _first_layout(file, numbers[0])
    if layout is None:
        return None
    return _in_threads(file, _Cutter(file, numbers[0], layout, head, wanted))


def _first_layout(file: RecordedFile, channel: int) -> tuple[Layout | None, bytes]:
    """The layout of the first block of a channel, and the bytes before its numbers."""
    for contents in file.contents():
        messages = contents.messages.of(channel)
        if len(messages.heads):
            data = messages.payload(0)
            layout = layout_of(data)
            return layout, data[: layout.start]
    return None, b''


def _in_threads(file: RecordedFile, cutter: _Cutter) -> Iterator[Cut]:
    chunks = file.known.chunks
    groups = [chunks[k : k + _AT_ONCE] for k in range(0, len(chunks), _AT_ONCE)]
    workers = min(os.cpu_count() or 1, 4)
    # Memory that is used again and again: to be given fresh pages costs more than to cut.
    rooms = [_Room() for _ in range(workers + _AHEAD)]
    descriptor = os.open(file.path, os.O_RDONLY)
    try:
        with ThreadPoolExecutor(workers, thread_name_prefix='read samples') as pool:
            waiting: deque[tuple[Future[list[Cut | Damage]], _Room]] = deque()
            try:
                while groups or waiting:
                    while groups and rooms:
                        room = rooms.pop()
                        work = pool.submit(cutter.cut, descriptor, groups.pop(0), room)
                        waiting.append((work, room))
                    work, room = waiting.popleft()
                    for found in work.result():
                        if isinstance(found, Damage):
                            file.on_damage(found)
                        else:
                            yield found
                    rooms.append(room)
            finally:
                for work, _ in waiting:
                    work.cancel()
    finally:
        os.close(descriptor)


class _Room:
    """Arrays that grow where they are too small."""

    def __init__(self) -> None:
        self.signals: Array = np.empty((0, 0))
        self.log_times: Integers = np.empty(0, np.int64)

    def of(self, columns: int, rows: int, blocks: int) -> tuple[Array, Integers]:
        """Signals (columns, rows or more) and log times (blocks or more), with anything in."""
        if self.signals.shape[1] < rows:
            self.signals = np.empty((columns, rows * 5 // 4))
        if len(self.log_times) < blocks:
            self.log_times = np.empty(blocks * 5 // 4, np.int64)
        return self.signals, self.log_times


class _Cutter:
    """Cuts groups of chunks, each call in any thread."""

    def __init__(
        self,
        file: RecordedFile,
        channel: int,
        layout: Layout,
        head: bytes,
        wanted: Sequence[str] | None,
    ) -> None:
        self._file = file
        self._channel = channel
        self._layout = layout
        self._head = np.frombuffer(head, np.uint8)
        self._wanted = wanted
        self._names = _chosen(layout.columns, wanted)
        # The time comes last, whether it is wanted or not.
        self._places = np.array([layout.columns.index(name) for name in (*self._names, TIME)])

    def cut(self, descriptor: int, group: Sequence[ChunkPlace], room: _Room) -> list[Cut | Damage]:
        """The samples in some chunks, and what of these is damaged."""
        layout = self._layout
        most = sum(place.size for place in group) // (len(self._head) + layout.size)
        out, log_times = room.of(len(self._places), most * layout.rows, most)
        block = np.empty(layout.size // 8)
        damages: list[Cut | Damage] = []
        messages = 0
        for place in group:
            chunk = read_chunk(self._file.path, descriptor, place)
            if isinstance(chunk, Damage):
                damages.append(chunk)
                continue
            if messages + len(chunk.records) // (len(self._head) + layout.size) > most:
                return self._each(descriptor, group)  # its index tells another size
            messages = cut_columns(
                np.frombuffer(chunk.records, np.uint8),
                self._channel,
                self._head,
                block.view(np.uint8),
                block,
                len(layout.columns),
                self._places,
                out,
                log_times,
                messages,
            )
            if messages in (OTHER_LAYOUT, NO_RECORDS):
                return self._each(descriptor, group)
        end = messages * layout.rows
        rows = np.full(messages, layout.rows)
        cut = Cut(self._names, out[:-1, :end], out[-1, :end], rows, log_times[:messages])
        return [*damages, cut]

    def _each(self, descriptor: int, group: Sequence[ChunkPlace]) -> list[Cut | Damage]:
        """The samples in some chunks by the way that takes any layout."""
        found: list[Cut | Damage] = []
        for place in group:
            chunk = read_chunk(self._file.path, descriptor, place)
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
