"""What a lathe says of its cut while it cuts: the depth, and how its bearing carries."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import ParameterEvent
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import QoSProfile

from lathe_chatter.nodes.parameter_node import ParameterNode
from lathe_chatter.nodes.remote_parameters import CONTACT, RemoteParameters

_DEPTH = 'depth_of_cut'


class LatheCutWatch:
    """Tells the depth of cut of a lathe whenever it is another, and when its bearing contact is.

    Args:
        node: That wants to know; the lathe is the node `lathe` beside it, remappable like its
            topics.
        on_depth: Called with the depth, m; with nan before where it has changed from one that is
            not known.
        on_contact: Called when the contact of the bearing is another.
    """

    def __init__(
        self,
        node: ParameterNode,
        on_depth: Callable[[float], None],
        on_contact: Callable[[], None],
    ) -> None:
        """Nothing is known yet."""
        self._on_depth, self._on_contact = on_depth, on_contact
        self._depth = math.nan
        self._parameters = RemoteParameters(node, self._take)
        self._lathe = node.full_name_of('lathe')
        node.create_subscription(
            ParameterEvent, '/parameter_events', self._on_event, QoSProfile(depth=100)
        )
        node.every(1.0, self._look)

    def forget(self) -> None:
        """It may be another lathe."""
        self._depth = math.nan
        self._parameters.want_again('lathe')

    def _look(self) -> None:
        self._parameters.ask('lathe')
        self._parameters.look()

    def _take(self, _name: str, values: dict[str, Any]) -> None:
        if isinstance(depth := values.get(_DEPTH), float):
            self._depth = depth
            self._on_depth(depth)

    def _on_event(self, event: ParameterEvent) -> None:
        if event.node != self._lathe:
            return
        for entry in (*event.new_parameters, *event.changed_parameters):
            depth = parameter_value_to_python(entry.value)
            if entry.name == _DEPTH and isinstance(depth, float):  # anybody may publish events
                before, self._depth = self._depth, depth
                if math.isnan(before):
                    self._on_depth(math.nan)
                if before != self._depth:
                    self._on_depth(self._depth)
            elif entry.name == CONTACT:
                self._on_contact()
