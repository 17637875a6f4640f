"""A client that floods a lathe: knocks and parameter sets at given rates, waiting for no answer.

python benchmarks/nodes/flood.py KNOCKS_A_SECOND SETS_A_SECOND
"""

from __future__ import annotations

import itertools
import sys
import time

import rclpy
from processes import executor_of
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from std_msgs.msg import Float64

KNOCK = 1e-6
"""N s: far from any guard."""


def main(knocks: float, sets: float) -> None:
    """Flood until it is killed."""
    rclpy.init()
    node = Node('flood')
    publisher = node.create_publisher(Float64, '/lathe/knock', QoSProfile(depth=1000))
    client = node.create_client(SetParameters, '/lathe/set_parameters')
    executor = executor_of(node)
    began, done_knocks, done_sets = time.monotonic(), 0, 0
    for k in itertools.count():
        elapsed = time.monotonic() - began
        while done_knocks < knocks * elapsed:
            publisher.publish(Float64(data=KNOCK))
            done_knocks += 1
        while done_sets < sets * elapsed and client.service_is_ready():
            value = Parameter('depth_of_cut', value=1e-4 + 1e-7 * (k % 1000))
            request = SetParameters.Request(parameters=[value.to_parameter_msg()])
            client.call_async(request).add_done_callback(client.remove_pending_request)
            done_sets += 1
        executor.spin_once(timeout_sec=0.002)


if __name__ == '__main__':
    main(*map(float, sys.argv[1:]))
