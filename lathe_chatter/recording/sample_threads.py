"""The samples of a long run by the index of its files, decompressed and cut in threads."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor

from lathe_chatter.recording.mcap_reader import Damage
from lathe_chatter.recording.run_file import RecordedFile
from lathe_chatter.recording.sample_columns import Cut, Cutter, Room, index_size
from lathe_chatter.samples.codec import Layout, layout_of

_AT_ONCE = 16
"""Chunks in one piece of work: 4 s of a recording, some MB."""
_AHEAD = 2
"""Pieces of work that may wait or be done, beyond those under way."""
_WORTHWHILE = 1000
"""Blocks in a file from which on threads pay."""


def cuts_by_index(
    file: RecordedFile, topic: str, wanted: Sequence[str] | None
) -> Iterator[Cut] | None:
    """The samples of a topic by the index of its file.

    Every chunk is proven by its CRC, as when the file is walked.

    Returns:
        None where the file has no index or one of a part of it, or so few blocks that a walk is
        quicker.

    Raises:
        OSError: If the file cannot be read.
    """
    numbers = [n for n, channel in file.known.channels.items() if channel.topic == topic]
    count = file.count(topic)
    if len(numbers) != 1 or not file.known.chunks or count < _WORTHWHILE:
        return None
    if sum(index_size(place, numbers[0]) for place in file.known.chunks) != 16 * count:
        return None
    layout, head = _first_layout(file, numbers[0])
    if layout is None:
        return None
    return _in_threads(file, Cutter(file, numbers[0], layout, head, wanted))


def _first_layout(file: RecordedFile, channel: int) -> tuple[Layout | None, bytes]:
    """The layout of the first block of a channel, and the bytes before its numbers."""
    for contents in file.contents():
        messages = contents.messages.of(channel)
        if len(messages.heads):
            data = messages.payload(0)
            layout = layout_of(data)
            return layout, data[: layout.start]
    return None, b''


def _in_threads(file: RecordedFile, cutter: Cutter) -> Iterator[Cut]:
    chunks = file.known.chunks
    groups = [chunks[k : k + _AT_ONCE] for k in range(0, len(chunks), _AT_ONCE)]
    workers = min(os.cpu_count() or 1, 4)
    rooms = [Room() for _ in range(workers + _AHEAD)]
    descriptor = os.open(file.path, os.O_RDONLY)
    try:
        with ThreadPoolExecutor(workers, thread_name_prefix='read samples') as pool:
            waiting: deque[tuple[Future[list[Cut | Damage]], Room]] = deque()
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
