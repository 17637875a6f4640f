"""The parameters of other nodes, asked for once and without waiting."""

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
        self._found: dict[str, float] = {}
        self._known: set[str] = set()

    def want(self, name: str) -> None:
        """Ask a node, by its full name, for its parameters; again is not asked."""
        if name in self._known or name == self._node.get_fully_qualified_name():
            return
        self._known.add(name)
        self._wanted[name] = (
            self._node.create_client(ListParameters, f'{name}/list_parameters'),
            self._node.create_client(GetParameters, f'{name}/get_parameters'),
        )

    def look(self) -> None:
        """Ask those that can answer by now."""
        for name, clients in list(self._wanted.items()):
            if not all(client.service_is_ready() for client in clients):
                self._found.pop(name, None)
            elif time.monotonic() - self._found.setdefault(name, time.monotonic()) > _SETTLING:
                del self._wanted[name]
                self._list(name, *clients)

    def _list(self, name: str, lister: Client, getter: Client) -> None:
        def got(future: Any) -> None:
            names = list(future.result().result.names)
            request = GetParameters.Request(names=names)
            getter.call_async(request).add_done_callback(lambda f: values(f, names))

        def values(future: Any, names: list[str]) -> None:
            found = [parameter_value_to_python(value) for value in future.result().values]
            self._node.destroy_client(lister)
            self._node.destroy_client(getter)
            self._tell(name, dict(zip(names, found, strict=True)))

        lister.call_async(ListParameters.Request()).add_done_callback(got)
