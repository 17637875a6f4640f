"""Messages and topics as tests record them, and what other people's readers find of them."""

from __future__ import annotations

from pathlib import Path

from mcap.reader import make_reader
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

from lathe_chatter.array_types import Array
from lathe_chatter.recording import Topic
from lathe_chatter.samples import SAMPLE_COLUMNS

STORE = get_typestore(Stores.ROS2_JAZZY)
BOOL, NUMBER = 'std_msgs/msg/Bool', 'std_msgs/msg/Float64'
ARRAY = 'std_msgs/msg/Float64MultiArray'
DIMENSION, LAYOUT = 'std_msgs/msg/MultiArrayDimension', 'std_msgs/msg/MultiArrayLayout'
WRITER_CHILD = """
import sys
from pathlib import Path
from support.recorded import number, topic
from lathe_chatter.recording import RunWriter
writer = RunWriter(Path(sys.argv[1]))
writer.add_topic(topic('/numbers'))
k = 0
while True:
    for _ in range(50):
        writer.write('/numbers', number(float(k)), log_time=k, publish_time=k, sequence=k)
        k += 1
    writer.commit()
    print(k, flush=True)
"""
"""A program that writes into the run that it is given, and says after each commit how many."""


def topic(name: str, kind: str = NUMBER) -> Topic:
    definition, _ = STORE.generate_msgdef(kind, ros_version=2)
    return Topic(name, kind, definition, STORE.hash_rihs01(kind))


def number(value: float) -> bytes:
    return bytes(STORE.serialize_cdr(STORE.types[NUMBER](data=value), NUMBER))


def block(samples: Array) -> bytes:
    rows, width = samples.shape
    dim = STORE.types[DIMENSION]
    layout = STORE.types[LAYOUT](
        dim=[
            dim(label='sample', size=rows, stride=rows * width),
            dim(label=','.join(SAMPLE_COLUMNS), size=width, stride=width),
        ],
        data_offset=0,
    )
    message = STORE.types[ARRAY](layout=layout, data=samples.ravel())
    return bytes(STORE.serialize_cdr(message, ARRAY))


def values_by_rosbags(folder: Path) -> list[float]:
    with Reader(folder) as reader:
        return [STORE.deserialize_cdr(raw, NUMBER).data for _, _, raw in reader.messages()]


def values_by_mcap(file: Path) -> list[float]:
    with file.open('rb') as stream:
        messages = make_reader(stream, validate_crcs=True).iter_messages()
        return [STORE.deserialize_cdr(message.data, NUMBER).data for _, _, message in messages]
