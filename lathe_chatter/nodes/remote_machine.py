"""The machine that a lathe says it is, asked from its parameter service."""

from __future__ import annotations

from collections.abc import Callable

from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from rclpy.task import Future

from lathe_chatter.errors import ParameterError
from lathe_chatter.model import Machine
from lathe_chatter.model.parameters import MACHINE_ROWS, machine_from

_NAMES = [row.name for row in MACHINE_ROWS]


class AskedMachine:
    """Asks for the machine without waiting for it.

    Args:
        node: That asks; the lathe is the node `lathe` beside it, remappable like its topics.
        on_answer: Called with the machine.
    """

    def __init__(self, node: Node, on_answer: Callable[[Machine], None]) -> None:
        """Nothing is asked yet."""
        self._node, self._on_answer = node, on_answer
        self._client = node.create_client(GetParameters, 'lathe/get_parameters')
        self._question: Future | None = None
        self.answered = False

    def ask(self) -> None:
        """Ask, if there is somebody to ask; an older question without an answer is given up."""
        self.answered = False
        if not self._client.service_is_ready():
            return
        if self._question is not None:
            self._client.remove_pending_request(self._question)
        self._question = self._client.call_async(GetParameters.Request(names=_NAMES))
        self._question.add_done_callback(self._take)

    def _take(self, question: Future) -> None:
        answer = question.result()
        if question is not self._question or answer is None:
            return
        self._question = None
        values = {
            name: value.double_value
            for name, value in zip(_NAMES, answer.values, strict=False)
            if value.type == ParameterType.PARAMETER_DOUBLE
        }
        try:
            machine = machine_from(values)
        except ParameterError as error:
            self._complain(str(error))
            return
        if lacking := [name for name in _NAMES if name not in values]:
            self._complain(f'it has no parameter {lacking[0]}.')
            return
        self.answered = True
        self._on_answer(machine)

    def _complain(self, reason: str) -> None:
        self._node.get_logger().error(
            f'The lathe does not say what machine it is: {reason}', throttle_duration_sec=60.0
        )
