"""The least that nodes of rclpy take for a lathe's messages: the peer of `cpu`.

python benchmarks/nodes/bare.py publish|read

One publishes 500 blocks a second of 20 samples and does nothing else, the other takes them from
the middleware 50 times a second and throws them away; neither has an executor.
"""

from __future__ import annotations

import sys
import time

import numpy as np
import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Float64MultiArray

from lathe_chatter.nodes.polled_subscription import PolledSubscription
from lathe_chatter.samples import SAMPLE_COLUMNS
from lathe_chatter.samples.codec import encode_block

TOPIC = '/bare/samples'
TICK, SAMPLES = 0.002, 20
LOOK = 0.02


def publish(node: Node) -> None:
    """Publish the same block again and again."""
    qos = QoSProfile(depth=2000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    publisher = node.create_publisher(Float64MultiArray, TOPIC, qos)
    block = encode_block(np.ones((SAMPLES, len(SAMPLE_COLUMNS))), SAMPLE_COLUMNS)
    due = time.monotonic()
    while True:
        due += TICK
        time.sleep(max(due - time.monotonic(), 0.0))
        publisher.handle.publish_raw(block)


def read(node: Node) -> None:
    """Take what has come."""
    samples = PolledSubscription(node, Float64MultiArray, TOPIC, QoSProfile(depth=1000))
    while True:
        time.sleep(LOOK)
        for _ in samples.take():
            pass


if __name__ == '__main__':
    rclpy.init()
    {'publish': publish, 'read': read}[sys.argv[1]](Node(f'bare_{sys.argv[1]}'))
