"""A node whose parameters are a table: declared, refused with a sentence, and followed as one.

A set is rewritten first (a whole number, or a text that is a number, becomes a double), then
validated without side effects, and handed over once it is accepted.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from typing import Any

from rcl_interfaces.msg import ParameterEvent, ParameterType, SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile

from lathe_chatter.errors import ParameterError, UnknownParameterError
from lathe_chatter.model.parameter_table import ParameterTable, Value
from lathe_chatter.nodes.command_line_parameters import OF_QOS, OF_RCLPY
from lathe_chatter.nodes.log_rate_limit import BoundedLog, QuickLog
from lathe_chatter.nodes.parameter_descriptor import descriptor_of
from lathe_chatter.nodes.polled_subscription import is_polled
from lathe_chatter.nodes.qos_overrides import publisher_overrides
from lathe_chatter.nodes.real_time_loop import RequestLoad

_SET_SERVICES = (SetParameters, SetParametersAtomically)
_MAX_ENTRIES = 200
"""Parameters in one request, twice those of any node here: each takes rclpy half a ms."""


class ParameterNode(Node):  # type: ignore[misc]  # rclpy has no type information
    """A node with a table of parameters.

    Args:
        name: Of the node, before remapping.
        table: Its parameters.
        options: As for `rclpy.node.Node`.

    Attributes:
        bounded_log: Its logger, bounded for each kind of sentence.
        requests: What serving them takes.
        set_together: Names in the request that is being served, as of a dump that is loaded:
            rclpy sets them one by one.

    Raises:
        ParameterError: If an override is not allowed; the sentence names it.
        UnknownParameterError: If a name is nearly that of a parameter; the sentence says which.
    """

    def __init__(self, name: str, table: ParameterTable, **options: Any) -> None:
        """Declare every row with its override, or else its default."""
        # rclpy's own declaration would end a wrong override in a traceback that says neither
        # unit nor limits. Declared from the overrides first, without type or range, they can be
        # read, checked by the table, and declared again as the table has them.
        self.requests = RequestLoad()
        self.set_together: frozenset[str] = frozenset()
        super().__init__(name, automatically_declare_parameters_from_overrides=True, **options)
        self.bounded_log = BoundedLog(QuickLog(self.get_logger()))
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        if hasattr(self.context, 'untrack_node'):
            # From Kilted on a context ends its nodes, one too whose making was given up half-way.
            self.context.untrack_node(self)
        self._table = table
        self._values = table.complete(self._take_overrides())
        for row in table:
            # A body of several modes has no one mass: what has no value is not declared.
            if (value := self._values.get(row.name)) is not None:
                self.declare_parameter(row.name, value, descriptor_of(row), ignore_override=True)
        self.add_on_set_parameters_callback(self._validate)
        self.add_post_set_parameters_callback(self._accept)
        self.every(1.0, self.bounded_log.look)

    @property
    def values(self) -> Mapping[str, Value]:
        """The present value of every parameter of the table."""
        return self._values

    @property
    def subscriptions(self) -> Iterator[Any]:
        """Those that executors serve: from one that is polled they would take its messages."""
        return (each for each in super().subscriptions if not is_polled(each))

    def parameters_accepted(self, changed: Mapping[str, Value]) -> None:
        """Follow a set that was accepted; `values` has it already. Does nothing by itself.

        Args:
            changed: What the set named, all of one atomic set in one call.
        """

    def begin(self) -> None:
        """Begin what has to be finished: called once, when the node is whole."""

    def finish(self) -> None:
        """Put on disk what must be kept, before the node goes. Does nothing by itself."""

    def destroy_node(self) -> None:
        """Finish, say what is still to be said, and go."""
        try:
            self.finish()
            # Kilted destroys nodes, too, that were refused half-made.
            if hasattr(self, 'bounded_log'):
                self.bounded_log.end()
        finally:
            super().destroy_node()

    def every(self, period: float, task: Callable[[], object]) -> None:
        """Have something done again and again, each s of a clock that nobody sets."""
        self.create_timer(period, task, clock=self._steady)

    def advertise(self, kind: Any, topic: str, qos: QoSProfile) -> Publisher:
        """A publisher, of whose quality of service the user may choose some at the start."""
        options = publisher_overrides(self, topic)
        return self.create_publisher(kind, topic, qos, qos_overriding_options=options)

    def full_name_of(self, name: str) -> str:
        """Of a node beside this one, which is remapped as its topics are."""
        return str(self.resolve_service_name(f'{name}/get_parameters')).rpartition('/')[0]

    def announce(self) -> None:
        """Publish every parameter of the table as an event again.

        An event is not kept: those of the declarations are gone before anybody can listen.
        """
        event = ParameterEvent(node=self.get_fully_qualified_name())
        event.stamp = self.get_clock().now().to_msg()
        event.new_parameters = [
            self.get_parameter(row.name).to_parameter_msg() for row in self._table
        ]
        for publisher in self.publishers:
            if publisher.msg_type is ParameterEvent:
                publisher.publish(event)

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """Set all or nothing; rclpy's services for one and for several come through here.

        rclpy refuses a wrong type, a wrong range, a read-only and an undeclared name before it
        asks any callback, in words that lack the name or the unit: refused here, they have a
        sentence of ours.
        """
        converted = [self._converted(parameter) for parameter in parameter_list]
        refusal = self._refusal(converted)
        if refusal:
            result = SetParametersResult(successful=False, reason=refusal)
        else:
            result = super().set_parameters_atomically(converted)
        if not result.successful:  # who asked is told; who reads the log or the record is, too
            self.bounded_log.warning(f'Refused: {result.reason}', 'refused')
        return result

    def declare_parameters(
        self,
        namespace: str,
        parameters: Any,
        ignore_override: Any = False,  # noqa: FBT002 -- rclpy's
    ) -> Any:
        """Declare parameters; an empty list among the overrides comes from rcl as no value."""
        given = [
            (entry[0], [], *entry[2:]) if len(entry) > 1 and entry[1] is None else entry
            for entry in parameters
        ]
        return super().declare_parameters(namespace, given, ignore_override)

    def create_service(
        self, srv_type: Any, srv_name: str, callback: Callable[..., Any], **options: Any
    ) -> Any:
        """Create a service, whose requests are counted in `requests`.

        Those that set parameters survive a type that ROS does not know: rclpy raises ValueError
        on it inside the callback, which would end the node. Without a value it is refused as any
        other wrong value.
        """
        if srv_type in _SET_SERVICES:
            callback = self._noting_names(_without_unknown_types(callback))

        def serve(request: Any, response: Any) -> Any:
            began = time.monotonic_ns()
            try:
                if (count := _entries(request)) > _MAX_ENTRIES:
                    return self._refused(count, response)
                return callback(request, response)
            finally:
                self.requests.note(began)

        return super().create_service(srv_type, srv_name, serve, **options)

    def _refused(self, count: int, response: Any) -> Any:
        """The answer to one request that would hold up all others, and the cut, for seconds."""
        said = f'At most {_MAX_ENTRIES} parameters fit in one request, and these are {count}.'
        self.bounded_log.warning(f'Refused: {said}', 'refused')
        result = SetParametersResult(successful=False, reason=said)
        if isinstance(response, SetParameters.Response):
            response.results = [result] * count
        elif isinstance(response, SetParametersAtomically.Response):
            response.result = result
        return response  # to who asks for values without any, as rclpy does of an unknown name

    def _noting_names(self, callback: Callable[..., Any]) -> Callable[..., Any]:
        def answer(request: Any, response: Any) -> Any:
            self.set_together = frozenset(entry.name for entry in request.parameters)
            try:
                return callback(request, response)
            finally:
                self.set_together = frozenset()

        return answer

    def _take_overrides(self) -> dict[str, object]:
        """Undeclare everything that the overrides declared, and return it."""
        overrides = self.get_parameters_by_prefix('')
        if not isinstance(overrides['use_sim_time'].value, bool):
            value = overrides['use_sim_time'].value
            raise ParameterError('use_sim_time', value, '', 'true or false')
        for name in OF_RCLPY:
            overrides.pop(name, None)
        for name in overrides:
            self.undeclare_parameter(name)
            if name not in self._table and not name.startswith(OF_QOS):
                if self._table.nearest(name):
                    raise UnknownParameterError(self._table.unknown(name))
                # As from a file of parameters for all nodes of a system.
                self.bounded_log.warning(self._table.unknown(name), 'unknown')
        return {
            name: self._table[name].parsed(parameter.value)
            for name, parameter in overrides.items()
            if name in self._table
        }

    def _converted(self, parameter: Parameter) -> Parameter:
        """A number as its row has it, where it was given as a text or as a whole number."""
        if parameter.name not in self._table:
            return parameter
        row = self._table[parameter.name]
        value = row.parsed(parameter.value)
        if isinstance(row.default, float) and isinstance(value, int) and value is not True:
            with suppress(ParameterError):
                value = row.check(value)
        return parameter if value is parameter.value else Parameter(row.name, value=value)

    def _refusal(self, parameters: list[Parameter]) -> str:
        """Why a set would be refused, as a sentence; empty where it is accepted."""
        for parameter in parameters:
            name = parameter.name
            if name in OF_RCLPY:
                return f'{name} can be given at the start only.'
            if name not in self._table:
                if self.has_parameter(name):
                    continue  # rclpy's own, and for rclpy to judge
                return self._table.unknown(name)
            row = self._table[name]
            if parameter.value is None:  # as of one that is to be deleted
                return f'{name} cannot be without a value.'
            if not row.run_time:
                return f'{name} can be given at the start only.'
            try:
                row.check(parameter.value)
            except ParameterError as error:
                return str(error)
        return ''

    def _validate(self, parameters: list[Parameter]) -> SetParametersResult:
        refusal = self._refusal([p for p in parameters if p.name in self._table])
        return SetParametersResult(successful=not refusal, reason=refusal)

    def _accept(self, parameters: list[Parameter]) -> None:
        changed = {
            p.name: self._table[p.name].check(p.value) for p in parameters if p.name in self._table
        }
        if changed:
            self._values = {**self._values, **changed}
            self.parameters_accepted(changed)


def _entries(request: Any) -> int:
    """How many parameters a request names; 0 of one about something else."""
    fields = ('parameters', 'names', 'prefixes')
    return max(len(getattr(request, field, ())) for field in fields)


def _without_unknown_types(callback: Callable[..., Any]) -> Callable[..., Any]:
    known = {kind.value for kind in Parameter.Type}

    def answer(request: Any, response: Any) -> Any:
        for parameter in request.parameters:
            if parameter.value.type not in known:
                parameter.value.type = ParameterType.PARAMETER_NOT_SET
        return callback(request, response)

    return answer
