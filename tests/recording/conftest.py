from __future__ import annotations

import pytest
from rosbags.typesys import Stores, get_typestore

from lathe_chatter.recording import Topic

STORE = get_typestore(Stores.ROS2_JAZZY)
BOOL, NUMBER = 'std_msgs/msg/Bool', 'std_msgs/msg/Float64'


def topic(name: str, kind: str = NUMBER) -> Topic:
    definition, _ = STORE.generate_msgdef(kind, ros_version=2)
    return Topic(name, kind, definition, STORE.hash_rihs01(kind))


def number(value: float) -> bytes:
    return bytes(STORE.serialize_cdr(STORE.types[NUMBER](data=value), NUMBER))


@pytest.fixture
def numbers() -> Topic:
    return topic('/numbers')
