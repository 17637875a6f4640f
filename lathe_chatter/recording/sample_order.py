"""Samples in the order in which they were taken, whatever their order in a file.

A writer may mix its chunks up, and then the times of reception tell; but the clock that dates the
reception may step, and then the file does. Simulated time decides between the two.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from lathe_chatter.array_types import Array
from lathe_chatter.recording.recorded_file import RecordedFile
from lathe_chatter.recording.sample_blocks import SampleBlocks
from lathe_chatter.recording.sample_reader import Spans, as_received, as_written


def sample_blocks(
    file: RecordedFile, topic: str, wanted: Sequence[str] | None = None, received: Spans = ()
) -> Iterator[SampleBlocks]:
    """The samples of a topic in a file, some 4 s at a time.

    As they were written, unless simulated time goes back less often in the order of reception.

    Args:
        file: Which.
        topic: Of the samples.
        wanted: Columns, in any order, besides the time; all where None.
        received: If given, what was received outside of these spans may be left out.

    Raises:
        OSError: If the file cannot be read.
        LayoutError: If a message is no block of samples.
    """
    if file.in_time_order:
        for blocks in as_written(file, topic, wanted, received):
            # What is out of order is so within a chunk, and no chunk is halved here.
            in_order = (blocks.log_times[1:] >= blocks.log_times[:-1]).all()
            yield blocks if in_order else _better(blocks)
    elif is_mixed_up(file, topic):
        yield from as_received(file, topic, wanted)
    else:
        yield from as_written(file, topic, wanted)


def _better(blocks: SampleBlocks) -> SampleBlocks:
    received = blocks.by_reception()
    return received if _steps_back(received.spans) < _steps_back(blocks.spans) else blocks


def is_mixed_up(file: RecordedFile, topic: str) -> bool:
    """Whether the samples of a topic in a file are handed out in the order of reception.

    Simulated time goes back less often then than as they were written.

    Raises:
        OSError: If the file cannot be read.
        LayoutError: If a message is no block of samples.
    """
    if file.in_time_order:
        return False
    written = [(blocks.spans, blocks.log_times) for blocks in as_written(file, topic, ())]
    if not written:
        return False
    spans = np.concatenate([each for each, _ in written], axis=1)
    order = np.argsort(np.concatenate([each for _, each in written]), kind='stable')
    return _steps_back(spans[:, order]) < _steps_back(spans)


def _steps_back(spans: Array) -> int:
    """How often simulated time goes back from block to block, by the spans of these (2, n)."""
    return int(np.count_nonzero(spans[0, 1:] <= spans[1, :-1]))
