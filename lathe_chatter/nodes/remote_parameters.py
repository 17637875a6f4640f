"""The parameters of other nodes, asked for without waiting until they are known."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python

from lathe_chatter.errors import LatheChatterError
from lathe_chatter.model import Machine
from lathe_chatter.model.lathe_parameter_table import (
    MACHINE_FILE,
    MACHINE_ROWS,
    described_by,
    machine_in_cut,
)
from lathe_chatter.model.machine_file import MachineDescription
from lathe_chatter.nodes.parameter_node import ParameterNode

_SETTLING = 1.0
"""s from when this node has found the services of another to when the other has found it too: an
answer to a client that it does not know yet would hold the other up."""
_UNKNOWN = '_UNKNOWN_'
"""In the name of a node of which the graph has a publisher before it has the name."""
_PATIENCE = 1.0
"""s after which an unanswered node is asked again: on a busy machine answers may be lost."""
_LONGEST_WAIT = 30.0
"""s for which an answer is awaited where something depends on it."""
CONTACT = 'bearing_contact'

OnMachine = Callable[[Machine, MachineDescription | None], None]
Answer = Callable[[str, dict[str, Any]], None]
"""Takes the name of a node and its parameters; one that is not set is None."""


class RemoteParameters:
    """Asks each wanted node for all its parameters, once it can answer.

    For all, as a node that lacks one of those it is asked for answers with none at all.

    Args:
        node: In whose name.
        on_answer: What to do with an answer; called by the executor.
    """

    def __init__(self, node: Node, on_answer: Answer) -> None:
        """Begin with nothing wanted."""
        self._node = node
        self._on_answer = on_answer
        self._questions: dict[str, _Question] = {}
        self._done: list[_Question] = []
        self._answered: set[str] = set()

    def want(self, namespace: str, node_name: str) -> None:
        """Ask a node, once the graph knows its name; but only once."""
        name = f'{namespace.rstrip("/")}/{node_name}'  # a namespace is / or ends without one
        if _UNKNOWN not in node_name and name != self._node.get_fully_qualified_name():
            self.ask(name)

    def ask(self, name: str) -> None:
        """Ask a node, unless it is asked or has answered.

        Args:
            name: Full, or relative to the namespace of this node and remappable.
        """
        if name not in self._questions and name not in self._answered:
            self._questions[name] = _Question(self._node, name)

    def want_again(self, name: str) -> None:
        """Ask a node that has answered once more: another of its name has been started."""
        self._answered.discard(name)

    def look(self) -> None:
        """Ask those that can answer by now, and have not."""
        for name, question in self._questions.items():
            question.look(partial(self._take, name))
        for question in [each for each in self._done if each.is_idle()]:
            self._done.remove(question)
            question.close()

    def _take(self, name: str, values: dict[str, Any]) -> None:
        if (question := self._questions.pop(name, None)) is not None:
            self._done.append(question)
            self._answered.add(name)
            self._on_answer(name, values)


class _Question:
    """What one node is asked."""

    def __init__(self, node: Node, name: str) -> None:
        self._node = node
        self._get = node.create_client(GetParameters, f'{name}/get_parameters')
        self._list = node.create_client(ListParameters, f'{name}/list_parameters')
        self._due: float | None = None
        self._open: list[Any] = []
        self._is_answered = False

    def look(self, on_values: Callable[[dict[str, Any]], None]) -> None:
        """Ask, if it is time to."""
        now = time.monotonic()
        if not (self._get.service_is_ready() and self._list.service_is_ready()):
            self._due = None
        elif self._due is None:
            self._due = now + _SETTLING
        elif now > self._due:
            self._due = now + _PATIENCE
            self._ask(on_values)

    def _ask(self, on_values: Callable[[dict[str, Any]], None]) -> None:
        def get(names: Sequence[str]) -> None:
            # The second list of names of a node that was asked twice: the clients may have gone.
            if self._is_answered:
                return

            def got(future: Any) -> None:
                self._is_answered = True
                found = map(parameter_value_to_python, future.result().values)
                on_values(dict(zip(names, found, strict=False)))

            future = self._get.call_async(GetParameters.Request(names=names))
            self._open.append(future)
            future.add_done_callback(got)

        listed = self._list.call_async(ListParameters.Request())
        self._open.append(listed)
        listed.add_done_callback(lambda future: get(list(future.result().result.names)))

    def is_idle(self) -> bool:
        """Whether every answer has come.

        On a busy machine a node is asked twice, and answers twice: the executor that is driven by
        events crashes where the client of the second answer went with the first.
        """
        return all(future.done() for future in self._open)

    def close(self) -> None:
        """Ask no more."""
        self._node.destroy_client(self._get)
        self._node.destroy_client(self._list)


class RemoteMachine:
    """Asks for the machine that a lathe says it is, without waiting for it.

    Args:
        node: That asks; the lathe is the node `lathe` beside it, remappable like its topics.
        on_machine: Called with the machine, and with its file where it has one.
    """

    def __init__(self, node: ParameterNode, on_machine: OnMachine) -> None:
        """Nothing is asked yet."""
        self._node, self._on_machine = node, on_machine
        self._parameters = RemoteParameters(node, self._take)
        self._lathe = node.full_name_of('lathe')
        self.answered = False
        self._awaited_since = math.inf

    def is_awaited(self, publishers: Sequence[str]) -> bool:
        """Whether the lathe is one of these nodes, and has yet to answer.

        Args:
            publishers: Full names; of one that is not known yet, it may be the lathe.
        """
        there = any(name == self._lathe or _UNKNOWN in name.upper() for name in publishers)
        if self.answered or not there:
            return False
        now = time.monotonic()
        self._awaited_since = min(self._awaited_since, now)
        return now - self._awaited_since < _LONGEST_WAIT

    def ask(self) -> None:
        """Ask, if there is somebody to ask; called again and again until it is answered."""
        self.answered = False
        self._parameters.want_again('lathe')
        self._parameters.ask('lathe')
        self._parameters.look()

    def _take(self, _name: str, values: dict[str, Any]) -> None:
        self._awaited_since = -math.inf  # whatever it says
        known = {name: value for name, value in values.items() if value is not None}
        described = bool(known.get(MACHINE_FILE.name))
        lacking = [row.name for row in MACHINE_ROWS if not described and row.name not in known]
        try:
            machine, file = machine_in_cut(known), described_by(known)
        except LatheChatterError as error:
            self._complain(str(error))
        else:
            if lacking:
                self._complain(f'it has no parameter {lacking[0]}.')
                return
            self.answered, self._awaited_since = True, math.inf
            self._on_machine(machine, file)

    def _complain(self, reason: str) -> None:
        said = f'The lathe does not say what machine it is: {reason}'
        self._node.bounded_log.error(said, 'machine')
