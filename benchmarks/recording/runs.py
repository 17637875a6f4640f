"""Runs to measure with: a lathe's samples, made as fast as they are wanted."""

from __future__ import annotations

import contextlib
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from lathe_chatter.recording import Topic
from lathe_chatter.recording.ros_messages import topic_of_type
from lathe_chatter.samples import SAMPLE_COLUMNS
from lathe_chatter.samples.codec import SAMPLES_TYPE, encode_block

START = 1_700_000_000_000_000_000
TICK = 2_000_000
"""ns, of a lathe of 500 ticks a second."""
PER_COMMIT = 125
"""Ticks in 0.25 s."""


def samples_topic(name: str = '/lathe/samples') -> Topic:
    """The topic of a lathe's samples."""
    return topic_of_type(name, SAMPLES_TYPE)


def blocks(count: int) -> Iterator[bytes]:
    """Blocks of 20 samples of noise, which do not compress, with times that go on."""
    generator = np.random.default_rng(0)
    frame = bytearray(encode_block(np.zeros((20, len(SAMPLE_COLUMNS)))))
    for k in range(count):
        samples = generator.standard_normal((20, len(SAMPLE_COLUMNS)))
        samples[:, 0] = (np.arange(1, 21) + 20 * k) / 1e4
        frame[-samples.nbytes :] = samples.tobytes()
        yield bytes(frame)


@contextlib.contextmanager
def scratch() -> Iterator[Path]:
    """A folder for one measurement."""
    place = Path(tempfile.mkdtemp(prefix='lathe-chatter-recording-'))
    try:
        yield place
    finally:
        shutil.rmtree(place)
