"""What of the quality of service of a publisher may be chosen at the start."""

from __future__ import annotations

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions

from lathe_chatter.errors import ParameterError


def publisher_overrides(node: Node, topic: str) -> QoSOverridingOptions:
    """Options of a publisher: history, depth and reliability, where nobody has to wait then.

    Args:
        node: Whose publisher it is.
        topic: As the node names it.

    Returns:
        Options that raise a `ParameterError` for a history that keeps all: its publisher would
        wait for every reader, also for one that never reads.
    """

    def check(qos: QoSProfile) -> SetParametersResult:
        if qos.history == HistoryPolicy.KEEP_ALL:
            name = f'qos_overrides.{node.resolve_topic_name(topic)}.publisher.history'
            allowed = 'keep_last, for a node does not wait for its readers'
            raise ParameterError(name, 'keep_all', '', allowed)
        return SetParametersResult(successful=True)

    return QoSOverridingOptions.with_default_policies(callback=check)
