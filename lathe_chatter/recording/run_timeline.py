"""When things happened in a run: by simulated time, and in the order in which they were written.

The stamps of messages are those of the system's clock. It dates a run and orders nothing in it:
time services set it back and forward while a run is recorded. What has simulated time is ordered
by that, and other messages by the blocks of samples about which they were written.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lathe_chatter.array_types import Array, Integers
from lathe_chatter.recording.chunk_messages import Messages
from lathe_chatter.recording.clock_steps import CLOCK, noted_steps, steps_back
from lathe_chatter.recording.recorded_file import Raw, RecordedFile
from lathe_chatter.recording.sample_blocks import TIME, SampleBlocks
from lathe_chatter.recording.sample_order import is_mixed_up
from lathe_chatter.samples.mixed_streams import mixed_at

if TYPE_CHECKING:
    from lathe_chatter.recording.run import Run

_SAME_PLACE = 1_000_000_000
"""ns: simulated time that goes back so near to where the lathe said it does is the same event."""


class Placed(NamedTuple):
    """A message with its place in the run.

    Attributes:
        raw: The message.
        place: How many messages were written before it.
    """

    raw: Raw
    place: int


@dataclass(frozen=True)
class Timeline:
    """The blocks of samples of a lathe (n,), in the order in which they were written.

    Attributes:
        places: How many messages of the run were written before each.
        received: When each was received by a clock without steps back, ns.
        published: When each was published, likewise.
        first: Simulated time of the first sample of each, s.
        last: Of the last one, s.
        rows: Samples in each.
        steps: Of the system's clock: simulated time about then and how far it was set, s.
        offsets: By how much the stamps of each are ahead of the clock without steps, ns.
    """

    places: Integers
    received: Integers
    published: Integers
    first: Array
    last: Array
    rows: Integers
    steps: tuple[tuple[float, float], ...]
    offsets: Integers

    @property
    def restarts(self) -> Integers:
        """Blocks whose simulated time is not after that of the block before."""
        return np.flatnonzero(self.first[1:] <= self.last[:-1]) + 1

    @property
    def mixed_at(self) -> float:
        """Simulated time at which several lathes are seen to have sent at once, s; else nan."""
        some = self.rows > 1
        steps = (self.last - self.first)[some] / (self.rows[some] - 1)
        step = float(np.median(steps)) if steps.size else 0.0
        return mixed_at(self.last[:-1], self.first[1:], step)

    @cached_property
    def _known_offsets(self) -> Integers:
        return np.unique(self.offsets)

    @cached_property
    def _stepped_at(self) -> list[int]:
        """Blocks before which the clock was set, the last first."""
        found: list[int] = (np.flatnonzero(np.diff(self.offsets))[::-1] + 1).tolist()
        return found

    def steady(self, found: Placed) -> tuple[int, int]:
        """When a message was received and published by the clock without steps back, ns."""
        raw = found.raw
        if not len(self.places):
            return raw.log_time, raw.publish_time
        near = max(int(np.searchsorted(self.places, found.place)) - 1, 0)
        offsets = self._known_offsets
        far = np.abs(raw.log_time - offsets - self.received[near])
        offset = int(offsets[np.argmin(far)])
        received = raw.log_time - offset
        # What a publisher keeps for late readers may be of before a step.
        for k in self._stepped_at:
            step = abs(int(self.offsets[k] - self.offsets[k - 1]))
            published = raw.publish_time - int(self.offsets[k])
            # The size of a step is known to some ms, and the other side of it is a step away.
            if self.received[k - 1] - step // 2 <= published <= received:
                return received, published
            offset = int(self.offsets[0])
        return received, min(raw.publish_time - offset, received)

    def received_in(self, spans: Sequence[tuple[float, float]]) -> list[tuple[int, int]]:
        """Between which stamps the samples of some spans of simulated time, s, were received."""
        stamps = self.received + self.offsets
        until = stamps.copy()
        until[-1:] = np.iinfo(np.int64).max  # a run may grow while it is read
        found = [(self.last >= begin) & (self.first <= end) for begin, end in spans]
        return [(int(stamps[k].min()), int(until[k].max())) for k in found if k.any()]

    def block_at(self, published: int) -> int:
        """The first block that was published at a time (ns, without steps) or after it.

        Where simulated time goes back close to it, it is the block where it does.
        """
        block = int(np.searchsorted(self.published, published))
        if len(self.restarts) and block not in self.restarts:
            times = self.published[self.restarts]
            nearest = int(np.argmin(np.abs(times - published)))
            if abs(int(times[nearest]) - published) < _SAME_PLACE:
                return int(self.restarts[nearest])
        return block

    def simulated_time(self, received: int, blocks: slice) -> float:
        """Simulated time at which something was received among some blocks, s.

        Args:
            received: ns, without steps.
            blocks: Of one session of the lathe; not empty.
        """
        times = self.received[blocks]
        after = min(max(int(np.searchsorted(times, received)), 1), len(times))
        near = slice(after - 1, after + 1)  # a run has too many to look at all for each message
        since = (times[near] - times[after - 1]).astype(float)
        return float(
            np.interp(float(received - int(times[after - 1])), since, self.last[blocks][near])
        )


def read_timeline(
    run: Run, samples: str, others: Callable[[str], bool] = lambda _topic: False
) -> tuple[Timeline, list[Placed]]:
    """Read when the blocks of a lathe were written, and other messages with their places.

    A file whose samples are handed out in the order of reception is taken in this order.

    Args:
        run: Which.
        samples: Topic of the lathe's samples.
        others: Whether the messages of a topic are wanted too.

    Raises:
        RunReadError: If a file is damaged.
        LayoutError: If a message is no block of samples.
    """
    found: list[Placed] = []
    places: list[Integers] = []
    written = 0
    for file in run.opened:
        messages, of_samples, there = _in_file(file, samples, others)
        found += [each._replace(place=written + each.place) for each in messages]
        places.append(written + of_samples)
        written += there
    blocks = [
        _Ends(each.rows, each.log_times, each.publish_times, each.spans)
        for each in run.sample_blocks(samples, (TIME,))
    ]
    return _timeline(run, _joined(places), blocks), found


def _in_file(
    file: RecordedFile, samples: str, others: Callable[[str], bool]
) -> tuple[list[Placed], Integers, int]:
    """Wanted messages of a file, the places of those with samples, and how many there are."""
    found: list[Placed] = []
    places: list[Integers] = []
    received: list[Integers] = []
    written = 0
    for contents in file.contents():
        messages, channels = contents.messages, file.known.channels
        topics = tuple(channel.topic for channel in channels.values() if others(channel.topic))
        if topics:
            here = (written + _places(file, messages, topics)).tolist()
            found += map(Placed, file.raw_of(messages, topics), here)
        places.append(written + _places(file, messages, (samples,)))
        received.append(messages.heads['log_time'].astype(np.int64))
        written += len(messages.heads)
    of_samples = _joined(places)
    if not is_mixed_up(file, samples):
        return found, of_samples, written
    # As the samples are handed out.
    rank = np.empty(written, np.int64)
    rank[np.argsort(_joined(received), kind='stable')] = np.arange(written)
    placed = [each._replace(place=int(rank[each.place])) for each in found]
    return sorted(placed, key=lambda each: each.place), np.sort(rank[of_samples]), written


def _places(file: RecordedFile, messages: Messages, topics: tuple[str, ...]) -> Integers:
    """Where in a chunk the messages of some topics are."""
    numbers = [n for n, channel in file.known.channels.items() if channel.topic in topics]
    return np.flatnonzero(np.isin(messages.heads['channel'], numbers))


class _Ends(NamedTuple):
    """What is kept of blocks (n,): of their samples the first and last times alone."""

    rows: Integers
    received: Integers
    published: Integers
    spans: Array


def _joined(parts: list[Integers]) -> Integers:
    return np.concatenate(parts) if parts else np.zeros(0, np.int64)


def blocks_as_written(run: Run, samples: str) -> Iterator[SampleBlocks]:
    """The blocks of a lathe in the order of `Timeline`.

    Raises:
        RunReadError: If a file is damaged.
        LayoutError: If a message is no block of samples.
    """
    for blocks in run.sample_blocks(samples):
        some = blocks.rows > 0
        yield blocks._replace(
            rows=blocks.rows[some],
            log_times=blocks.log_times[some],
            publish_times=blocks.publish_times[some],
        )


def _timeline(run: Run, places: Integers, blocks: list[_Ends]) -> Timeline:
    # The two were read one after the other, and a run that is recorded has grown meanwhile.
    count = min(len(places), sum(len(each.rows) for each in blocks))
    places, rows = places[:count], _joined([each.rows for each in blocks])[:count]
    some = rows > 0
    received = _joined([each.received for each in blocks])[:count][some]
    published = _joined([each.published for each in blocks])[:count][some]
    spans = np.hstack([np.zeros((2, 0)), *(each.spans for each in blocks)])
    first, last = spans[:, :count][:, some]
    back, sizes = steps_back(received)
    since = np.zeros(len(received), np.int64)
    since[back + 1] = sizes
    offsets = np.cumsum(since)
    received = received - offsets
    steps = [
        (place, size / 1e9) for place, size in zip(back.tolist(), sizes.tolist(), strict=True)
    ]
    notes = [note.values for note in run.notes() if note.name == CLOCK]
    noted = noted_steps(notes[-1]) if notes else []
    if noted:  # by who saw it, so also those forward
        stamps = received + offsets
        steps = []
        for step in noted:
            seen = back if step.seconds < 0.0 else back[:0]
            steps.append((_block_before(stamps, seen, step.before), step.seconds))
    return Timeline(
        places[some],
        received,
        np.minimum(published - offsets, received),
        first,
        last,
        rows[some],
        tuple((float(last[k]) if len(last) else 0.0, seconds) for k, seconds in steps),
        offsets,
    )


def _block_before(stamps: Integers, back: Integers, before: int) -> int:
    """The last block before a step that was seen after the clock had shown `before`.

    Args:
        stamps: When each block was received, ns since the epoch.
        back: Blocks after which stamps go back; none for a step forward.
        before: ns since the epoch.
    """
    if len(back):
        return int(back[np.argmin(np.abs(stamps[back] - before))])
    later = np.flatnonzero(stamps > before)
    return max(int(later[0]) - 1, 0) if len(later) else max(len(stamps) - 1, 0)
