"""What was done to the nodes of the chaos, and what a witness heard of them meanwhile."""

from __future__ import annotations

import re
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Bool, Float64MultiArray

from lathe_chatter.nodes.diagnostics import DiagnosticsListener
from lathe_chatter.nodes.polled_subscription import PolledSubscription

NEVER_TRUE = re.compile(
    r'publish .*, not one lathe|several publish|not the only|another supervisor|publish /clock'
)
"""There is one of each, whatever the graph has of those that were killed."""
SILENCE = 0.9
"""s without samples of which a node may say that none come."""
_SPEAKS_AFTER, _SPEAKS_EVERY = 45.0, 15.0
"""s from its start, and from one time to the next, after which a node that says nothing hangs."""
_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@dataclass
class Session:
    """One life of a node, its times in s since the epoch.

    Attributes:
        lost: Samples that it counts as lost, if it is a monitor.
    """

    name: str
    started: float
    ended: float = 0.0
    code: int = 0
    lost: int = 0


@dataclass
class Done:
    """What was done, and what came of it.

    Attributes:
        stops: Who stood still, from when to when; likewise the others, s since the epoch.
        silences: From the last block of samples to the next, by the clock of who sent them.
    """

    faults: list[str] = field(default_factory=list)
    sessions: list[Session] = field(default_factory=list)
    stops: list[tuple[str, float, float]] = field(default_factory=list)
    clock_stops: list[tuple[float, float]] = field(default_factory=list)
    clock_jumps: list[float] = field(default_factory=list)
    silences: list[tuple[float, float]] = field(default_factory=list)
    finished: list[Path] = field(default_factory=list)
    killed: list[Path] = field(default_factory=list)

    def of(self, name: str) -> list[Session]:
        """All lives of a node."""
        return [each for each in self.sessions if each.name == name]

    def newest(self, name: str) -> Session:
        """The one that goes on, or was the last."""
        return self.of(name)[-1]


class Witness:
    """Listens to the samples, the flag and the diagnostics of nodes to which things are done."""

    def __init__(self, node: Node, done: Done) -> None:
        """Listen."""
        self.flag, self._done, self._last = False, done, 0.0
        self._heard = DiagnosticsListener()
        self._took_at = self._listens_since = 0.0
        self._told: set[str] = set()
        depth = QoSProfile(depth=20_000)
        self._samples = PolledSubscription(node, Float64MultiArray, '/lathe/samples', depth)
        node.create_subscription(Bool, '/chatter_monitor/chatter', self._on_flag, _LATCHED)
        node.create_subscription(
            DiagnosticArray, '/diagnostics', self._on_diagnostics, QoSProfile(depth=100)
        )

    def _on_flag(self, message: Bool) -> None:
        self.flag = message.data

    def take(self) -> None:
        """Note when samples were sent; called again and again."""
        now = time.monotonic()
        if now > self._took_at + SILENCE:  # the witness itself stood still
            self._listens_since = now
        self._took_at = now
        for _, info in self._samples.take():
            sent = info['source_timestamp'] / 1e9
            if self._last and sent - self._last > SILENCE:
                self._done.silences.append((self._last, sent))
            self._last = sent

    def _on_diagnostics(self, message: Any) -> None:
        self._heard.take(message)
        for status in message.status:
            if NEVER_TRUE.search(status.message) and status.message not in self._told:
                self._told.add(status.message)
                self._done.faults.append(f'/diagnostics, {status.name}: {status.message}')
        lost = self._heard.number('/chatter_monitor', 'samples', 'samples lost', 0.0)
        monitor = self._done.newest('chatter_monitor')
        if not monitor.ended:
            monitor.lost = int(lost)

    def look(self) -> None:
        """See that all speak who run and were not disturbed just now."""
        for each in self._done.sessions:
            listened = time.monotonic() - self._listens_since
            silent = min(listened, self._heard.silence(f'/{each.name}'))
            old = time.time() - each.started > _SPEAKS_AFTER
            if old and not each.ended and each.name != 'operator_page' and silent > _SPEAKS_EVERY:
                self._done.faults.append(f'{each.name} has said nothing for {silent:.0f} s')
