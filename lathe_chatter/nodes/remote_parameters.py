"""The parameters of other nodes, asked for without waiting until they are known."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.client import Client
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python

_SETTLING = 1.0
"""s from when this node has found the services of another to when the other has found it too: an
answer to a client that it does not know yet would hold the other up."""

_UNKNOWN = '_UNKNOWN_'
"""In the name of a node of which the graph has a publisher before it has the name."""
_PATIENCE = 1.0
"""s after which an unanswered node is asked again: on a busy machine answers may be lost."""

Tell = Callable[[str, dict[str, Any]], None]
"""Takes the full name of a node and its parameters."""


class ParameterSnapshots:
    """Asks each wanted node, once it answers.

    Args:
        node: In whose name.
        tell: What to do with an answer; called by the executor.
    """

    def __init__(self, node: Node, tell: Tell) -> None:
        """Begin with nothing wanted."""
        self._node = node
        self._tell = tell
        self._wanted: dict[str, tuple[Client, Client]] = {}
        self._due: dict[str, float] = {}
        self._known: set[str] = set()

    def want(self, namespace: str, node_name: str) -> None:
        """Ask a node for its parameters, once the graph knows its name; again is not asked."""
        if _UNKNOWN in node_name:
            return
        name = f'{namespace.rstrip("/")}/{node_name}'  # a namespace is / or ends without one
        if name in self._known or name == self._node.get_fully_qualified_name():
            return
        self._known.add(name)
        self._wanted[name] = (
            self._node.create_client(ListParameters, f'{name}/list_parameters'),
            self._node.create_client(GetParameters, f'{name}/get_parameters'),
        )

    def want_again(self, name: str) -> None:
        """Ask a node, by its full name, once more: another of its name has been started."""
        if name not in self._wanted:
            self._known.discard(name)

    def look(self) -> None:
        """Ask those that can answer by now, and have not."""
        now = time.monotonic()
        for name, clients in list(self._wanted.items()):
            if not all(client.service_is_ready() for client in clients):
                self._due.pop(name, None)
            elif now > self._due.setdefault(name, now + _SETTLING):
                self._due[name] = now + _PATIENCE
                self._list(name, *clients)

    def _list(self, name: str, lister: Client, getter: Client) -> None:
        def got(future: Any) -> None:
            if name not in self._wanted:  # answered meanwhile
                return
            names = list(future.result().result.names)
            request = GetParameters.Request(names=names)
            getter.call_async(request).add_done_callback(lambda f: values(f, names))

        def values(future: Any, names: list[str]) -> None:
            if self._wanted.pop(name, None) is None:
                return
            found = [parameter_value_to_python(value) for value in future.result().values]
            self._node.destroy_client(lister)
            self._node.destroy_client(getter)
            self._tell(name, dict(zip(names, found, strict=True)))

        lister.call_async(ListParameters.Request()).add_done_callback(got)
