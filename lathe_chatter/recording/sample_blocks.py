"""Blocks of samples as arrays: columns of many messages at a time, out of the bytes of chunks.

The messages of samples in a chunk are mostly evenly spaced, so that a column of all of them is a
strided view of the bytes of the chunk.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lathe_chatter.array_types import Array, Integers
from lathe_chatter.errors import LayoutError, ParameterError
from lathe_chatter.recording.chunk_messages import Messages
from lathe_chatter.samples.codec import BlockLayout, block_layout

TIME = 'time'
AT_ONCE = 16
"""Chunks that are read together: 4 s of a recording, some MB."""


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

    def some(self, begin: int, end: int) -> SampleBlocks:
        """The blocks from one up to another."""
        ends = np.concatenate(([0], np.cumsum(self.rows)))
        return SampleBlocks(
            self.columns,
            self.signals[:, ends[begin] : ends[end]],
            self.rows[begin:end],
            self.log_times[begin:end],
            self.publish_times[begin:end],
        )


def one_cut(parts: Iterable[SampleBlocks], wanted: int) -> Iterator[SampleBlocks]:
    """The blocks of one cut: a new one begins where simulated time goes back.

    Args:
        parts: All blocks, in order.
        wanted: The number of the cut, the first being 0.

    Raises:
        ParameterError: If there is no such cut.
    """
    cut, last = 0, -np.inf
    for part in parts:
        some = np.flatnonzero(part.rows)
        if not some.size:
            continue
        first, end = part.spans[:, some]
        cuts = cut + np.cumsum(~(first > np.concatenate(([last], end[:-1]))))
        cut, last = int(cuts[-1]), float(end[-1])
        chosen = some[cuts == wanted]
        if chosen.size:
            yield part.some(int(chosen[0]), int(chosen[-1]) + 1)
    if wanted not in range(cut + 1):
        raise ParameterError('cut', wanted, '', f'a whole number from 0 to {cut}')


class CutsInARow:
    """Dates the blocks of several cuts behind each other, each where that before it ended."""

    def __init__(self) -> None:
        """Begin with the first."""
        self._last, self._before = -np.inf, 0.0

    def before(self, first: Array, last: Array) -> Array:
        """How long the cuts took that were before those of some blocks, s (n,).

        Args:
            first: Simulated time of the first sample of each (n,); it goes back at a new cut.
            last: Of the last one.
        """
        ends = np.concatenate(([self._last], last))
        back = first <= ends[:-1]
        before: Array = self._before + np.cumsum(np.where(back, ends[:-1], 0.0))
        self._last, self._before = ends[-1], np.append(self._before, before)[-1]
        return before


class Stretch(NamedTuple):
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

    @property
    def samples(self) -> int:
        """How many samples they have."""
        return len(self.log_times) * self.layout.rows

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


def stretches_of(messages: Messages) -> Iterator[Stretch]:
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
        memory, first, stride = evenly_spaced(messages.records, messages.starts[begun:after], size)
        heads: NDArray[np.uint8] = np.ndarray(
            (after - begun, layout.start), np.uint8, memory, first, (stride, 1)
        )
        if not (same := (heads == heads[0]).all(axis=1)).all():
            after = begun + int(np.argmin(same))
        yield Stretch(
            memory,
            first,
            stride,
            layout,
            messages.heads['log_time'][begun:after].astype(np.int64),
            messages.heads['publish_time'][begun:after].astype(np.int64),
        )
        begun = after


def evenly_spaced(
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


class BlockJoiner:
    """Copies stretches behind each other, each while its bytes are near the processor.

    Args:
        wanted: Columns besides the time; all where None.
    """

    def __init__(self, wanted: Sequence[str] | None) -> None:
        """Begin with none."""
        self._wanted = wanted
        self._done: list[SampleBlocks] = []
        self._columns: tuple[str, ...] = ()
        self._names: tuple[str, ...] = ()
        self._signals: Array = np.empty((0, 0))
        self._size = 0
        self._parts: list[Stretch] = []

    def add(self, stretch: Stretch) -> None:
        """Add the next one.

        Raises:
            LayoutError: If the samples have no time.
        """
        if stretch.layout.columns != self._columns:
            self._end()
            self._columns = stretch.layout.columns
            self._names = _chosen(self._columns, self._wanted)
        begin, end = self._size, self._size + stretch.samples
        if end > self._signals.shape[1]:
            room = max(2 * begin, AT_ONCE * stretch.samples)
            signals = np.empty((len(self._names), begin + room))
            if begin:
                signals[:, :begin] = self._signals[:, :begin]
            self._signals = signals
        stretch.copy_to(self._signals[:, begin:end], self._names)
        self._size = end
        self._parts.append(stretch._replace(memory=b''))

    def add_all(self, stretches: Iterable[Stretch]) -> None:
        """Add some, as `add` does.

        Raises:
            LayoutError: If the samples have no time.
        """
        for stretch in stretches:
            self.add(stretch)

    def taken(self) -> list[SampleBlocks]:
        """All that was added, as few arrays as their columns allow; then it begins anew."""
        self._end()
        done, self._done = self._done, []
        return done

    def _end(self) -> None:
        parts = self._parts
        if parts:
            rows = np.repeat([p.layout.rows for p in parts], [len(p.log_times) for p in parts])
            log_times = np.concatenate([part.log_times for part in parts])
            publish_times = np.concatenate([part.publish_times for part in parts])
            signals = self._signals[:, : self._size]
            self._done.append(SampleBlocks(self._names, signals, rows, log_times, publish_times))
        self._signals, self._size, self._parts = np.empty((len(self._names), 0)), 0, []


def _chosen(columns: tuple[str, ...], wanted: Sequence[str] | None) -> tuple[str, ...]:
    if TIME not in columns:
        raise LayoutError(f'The samples have no column {TIME}, only {", ".join(columns)}.')
    return tuple(name for name in columns if wanted is None or name in wanted or name == TIME)
