"""`/diagnostics` as standard tools show it: a few statuses, once a second and on change."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.qos import QoSProfile

from lathe_chatter.nodes.parameter_node import ParameterNode

OK, WARN = DiagnosticStatus.OK, DiagnosticStatus.WARN
ERROR, STALE = DiagnosticStatus.ERROR, DiagnosticStatus.STALE

_MAX_NODES = 1000
"""Nodes whose statuses are kept: anybody may make up names."""


@dataclass(frozen=True)
class Status:
    """One line of a diagnostics viewer.

    Attributes:
        part: Which part of the node; its full name is put before it.
        level: OK, WARN, ERROR or STALE.
        message: One phrase.
        values: What stands below it, in this order.
    """

    part: str
    level: bytes
    message: str
    values: Mapping[str, object] = field(default_factory=dict)


class Diagnostics:
    """Publishes the statuses of one node.

    Args:
        node: Whose they are; its full name tells two cells apart.
        hardware: What they are about.
    """

    def __init__(self, node: ParameterNode, hardware: str) -> None:
        """Create the publisher."""
        self._node = node
        self._name = node.get_fully_qualified_name()
        self._hardware = self._name.rpartition('/')[0].lstrip('/')
        self._hardware = f'{self._hardware} {hardware}'.strip()
        self._publisher = node.advertise(DiagnosticArray, '/diagnostics', QoSProfile(depth=10))
        self._shown: list[tuple[str, bytes, str]] = []

    def publish(self, statuses: Iterable[Status]) -> None:
        """Publish these, changed or not."""
        statuses = list(statuses)
        self._shown = [(s.part, s.level, s.message) for s in statuses]
        message = DiagnosticArray(status=[self._message(status) for status in statuses])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)

    def publish_changes(self, statuses: Iterable[Status]) -> None:
        """Publish these if a level or a message is new."""
        statuses = list(statuses)
        if self._shown != [(s.part, s.level, s.message) for s in statuses]:
            self.publish(statuses)

    def _message(self, status: Status) -> Any:
        return DiagnosticStatus(
            level=status.level,
            name=f'{self._name}: {status.part}',
            message=status.message,
            hardware_id=self._hardware,
            values=[KeyValue(key=key, value=_text(v)) for key, v in status.values.items()],
        )


class DiagnosticsListener:
    """What the nodes say in /diagnostics, and when they spoke last.

    Attributes:
        statuses: Newest status of each part of each node: level, message and values, as texts.
    """

    def __init__(self) -> None:
        """Begin with nothing."""
        self.statuses: dict[str, dict[str, dict[str, Any]]] = {}
        self._spoke_at: dict[str, float] = {}

    def take(self, message: DiagnosticArray) -> None:
        """Keep the newest status of each part."""
        for status in message.status:
            node, _, part = status.name.partition(': ')
            if node not in self.statuses and len(self.statuses) >= _MAX_NODES:
                continue
            self.spoke(node)
            self.statuses[node] = {**self.statuses.get(node, {}), part: {
                'level': int.from_bytes(status.level, 'little'),
                'message': status.message,
                'values': {each.key: each.value for each in status.values},
            }}  # fmt: skip

    def spoke(self, name: str) -> None:
        """Something came from there."""
        self._spoke_at[name] = time.monotonic()

    def silence(self, name: str) -> float:
        """How long nothing came from there, s."""
        return time.monotonic() - self._spoke_at.get(name, -math.inf)

    def number(self, node: str, part: str, key: str, otherwise: float = math.nan) -> float:
        """One of the newest values of a part, where it is a finite number."""
        with suppress(KeyError, ValueError):
            found = float(self.values(node, part)[key])
            return found if math.isfinite(found) else otherwise
        return otherwise

    def values(self, node: str, part: str) -> dict[str, str]:
        """The newest values of a part; empty where there are none."""
        found: dict[str, str] = self.statuses.get(node, {}).get(part, {}).get('values', {})
        return found


def _text(value: object) -> str:
    return f'{value:.6g}' if isinstance(value, float) else str(value)
