"""Runs to measure with: a lathe's samples, made as fast as they are wanted."""

from __future__ import annotations

import contextlib
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from rosbags.typesys import Stores, get_typestore

from lathe_chatter.array_types import Array
from lathe_chatter.recording import Topic
from lathe_chatter.samples import SAMPLE_COLUMNS

STORE = get_typestore(Stores.ROS2_JAZZY)
ARRAY = 'std_msgs/msg/Float64MultiArray'
START = 1_700_000_000_000_000_000
TICK = 2_000_000
"""ns, of a lathe of 500 ticks a second."""
PER_COMMIT = 125
"""Ticks in 0.25 s."""


def samples_topic(name: str = '/lathe/samples') -> Topic:
    """The topic of a lathe's samples."""
    definition, _ = STORE.generate_msgdef(ARRAY, ros_version=2)
    return Topic(name, ARRAY, definition, STORE.hash_rihs01(ARRAY))


def block(samples: Array) -> bytes:
    """A block of samples as a lathe sends it."""
    rows, width = samples.shape
    dim = STORE.types['std_msgs/msg/MultiArrayDimension']
    layout = STORE.types['std_msgs/msg/MultiArrayLayout'](
        dim=[
            dim(label='sample', size=rows, stride=rows * width),
            dim(label=','.join(SAMPLE_COLUMNS), size=width, stride=width),
        ],
        data_offset=0,
    )
    message = STORE.types[ARRAY](layout=layout, data=samples.ravel())
    return bytes(STORE.serialize_cdr(message, ARRAY))


def blocks(count: int) -> Iterator[bytes]:
    """Blocks of 20 samples of noise, which do not compress, with times that go on."""
    generator = np.random.default_rng(0)
    frame = bytearray(block(np.zeros((20, len(SAMPLE_COLUMNS)))))
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
