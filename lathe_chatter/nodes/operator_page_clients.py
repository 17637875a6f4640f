"""What the operator's page asks of the nodes of one lathe: services and parameters."""

from __future__ import annotations

import asyncio
import time
from collections import defaultdict
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    ListParameters,
    SetParametersAtomically,
)
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.qos import QoSProfile
from std_msgs.msg import Float64
from std_srvs.srv import SetBool, Trigger

from lathe_chatter.errors import LatheChatterError
from lathe_chatter.lathe.virtual_lathe import IMPULSE
from lathe_chatter.nodes.polled_subscription import node_gids

_NODES = {
    'monitor': 'chatter_monitor',
    'recorder': 'run_recorder',
    'supervisor': 'chatter_supervisor',
}
_SERVICES = {
    'pause': ('lathe', SetBool, 'pause', {'data': True}),
    'resume': ('lathe', SetBool, 'pause', {'data': False}),
    'step': ('lathe', Trigger, 'step', {}),
    'reset': ('lathe', Trigger, 'reset', {}),
    'record_start': ('recorder', Trigger, 'start', {}),
    'record_stop': ('recorder', Trigger, 'stop', {}),
    'record_split': ('recorder', Trigger, 'split', {}),
    'record_snapshot': ('recorder', Trigger, 'snapshot', {}),
    'accept': ('supervisor', Trigger, 'accept', {}),
}
"""What may be called: of which node, which kind, its name, and what with."""
_SET = 'set_parameters_atomically'
_PARAMETER_SERVICES = {
    'list_parameters': ListParameters,
    'describe_parameters': DescribeParameters,
    'get_parameters': GetParameters,
    _SET: SetParametersAtomically,
}
_DESCRIBED = ('lathe', 'supervisor')
_PATIENCE, _SETTLING = 3.0, 1.0
"""s for an answer; and until a node knows a client well enough to answer it."""
Put = Callable[[str, Any], None]


class CellClients:
    """Clients of a lathe, its monitor, its recorder and its supervisor.

    Args:
        node: In whose name.
        lathe: Full name of the lathe.
        put: Takes what is known of parameters, by name: `lathe_rows`, `lathe_values`.

    Attributes:
        names: Full names of the nodes.
        values: Parameters of the nodes that have told them.
        awaited: Requests without an answer yet.
    """

    def __init__(self, node: Node, lathe: str, put: Put) -> None:
        """Get to know the services."""
        space = lathe.rpartition('/')[0]
        self.names = {'lathe': lathe, **{k: f'{space}/{name}' for k, name in _NODES.items()}}
        self.values: dict[str, dict[str, Any]] = {}
        self.awaited = 0
        self._node, self._put = node, put
        self._types: dict[str, dict[str, int]] = {}
        self._ready: dict[str, float] = {}
        self._gids = defaultdict[str, frozenset[tuple[int, ...]]](frozenset)  # of those asked
        self._asking: set[str] = set()
        services = {(who, name): kind for who, kind, name, _ in _SERVICES.values()}
        for who in _DESCRIBED:
            services |= {(who, name): kind for name, kind in _PARAMETER_SERVICES.items()}
        self._clients = {
            (who, name): node.create_client(kind, f'{self.names[who]}/{name}')
            for (who, name), kind in services.items()
        }
        self._knocks = node.create_publisher(Float64, f'{lathe}/knock', QoSProfile(depth=10))

    def end(self) -> None:
        """Ask no more."""
        for client in self._clients.values():
            self._node.destroy_client(client)
        self._node.destroy_publisher(self._knocks)

    # -- parameters ------------------------------------------------------------------------

    async def look(self) -> None:
        """Get to know the parameters of those that have come."""
        now, gids = time.monotonic(), node_gids(self._node)
        for who in _DESCRIBED:
            name = self.names[who]
            if not gids[name] <= self._gids[name]:
                self.values.pop(who, None)  # another one of its name has come
            if not self._clients[who, 'list_parameters'].service_is_ready():
                self._ready.pop(who, None)
                if self.values.pop(who, None) is not None and who != 'lathe':
                    self._put(f'{who}_rows', None)
                continue
            settled = now - self._ready.setdefault(who, now) > _SETTLING
            if settled and who not in self.values and who not in self._asking:
                await self._describe(who)

    async def _describe(self, who: str) -> None:
        """Ask a node what parameters it has, and what they are."""
        self._asking.add(who)
        self._gids[self.names[who]] = node_gids(self._node)[self.names[who]]
        try:
            names = sorted((await self._call(who, 'list_parameters')).result.names)
            described = await self._call(who, 'describe_parameters', names=names)
            got = await self._call(who, 'get_parameters', names=names)
        except LatheChatterError:
            return  # it is asked again
        finally:
            self._asking.discard(who)
        values = map(parameter_value_to_python, got.values)
        self.values[who] = dict(zip(names, values, strict=True))
        self._types[who] = {each.name: each.type for each in described.descriptors}
        self._put(f'{who}_rows', [_row(each) for each in described.descriptors])
        self._put(f'{who}_values', dict(self.values[who]))

    def on_event(self, event: Any) -> None:
        """Follow what has changed."""
        who = next((who for who, name in self.names.items() if name == event.node), None)
        if who in self.values:
            for each in (*event.new_parameters, *event.changed_parameters):
                if each.name in self.values[who]:
                    self.values[who][each.name] = parameter_value_to_python(each.value)
            self._put(f'{who}_values', dict(self.values[who]))
            if who == 'lathe':
                self._put('asked', False)  # noqa: FBT003 -- an offer was for the cut before

    async def set(self, who: str, values: Mapping[str, Any]) -> None:
        """Set parameters of a node, all or none.

        Raises:
            LatheChatterError: If it refuses, with its sentence.
        """
        if who not in _DESCRIBED:
            raise LatheChatterError(f'Nothing of {who!r:.40} can be set from here.')
        if who not in self._types:
            raise self.unknown(who)
        types = {name: Parameter.Type(number) for name, number in self._types[who].items()}
        parameters = [
            Parameter(name, value=float(v) if types.get(name) is Parameter.Type.DOUBLE else v)
            for name, v in values.items()
        ]
        messages = [parameter.to_parameter_msg() for parameter in parameters]
        answer = await self._call(who, _SET, parameters=messages)
        if not answer.result.successful:
            raise LatheChatterError(answer.result.reason)

    # -- services --------------------------------------------------------------------------

    async def call(self, service: str) -> str:
        """Call a service by its name here, and return what it said.

        Raises:
            LatheChatterError: If it refuses, with its sentence, or does not answer.
        """
        who, _, name, given = _SERVICES[service]
        answer = await self._call(who, name, **given)
        if not answer.success:
            raise LatheChatterError(answer.message)
        return str(answer.message)

    def knock(self, impulse: float, *, there: bool) -> None:
        """Hit the tool with an impulse, N s, of a lathe that speaks or does not.

        Raises:
            LatheChatterError: If it is none, or nobody is there to take it.
        """
        if not (there and self._knocks.get_subscription_count()):
            raise self._not_there('lathe')
        self._knocks.publish(Float64(data=IMPULSE.check('impulse', impulse)))

    def unknown(self, who: str) -> LatheChatterError:
        """Why the parameters of a node are not known."""
        if not self._clients[who, _SET].service_is_ready():
            return self._not_there(who)
        return LatheChatterError(f'The parameters of {self.names[who]} are not known yet.')

    def _not_there(self, who: str) -> LatheChatterError:
        return LatheChatterError(f'{self.names[who]} is not there.')

    async def _call(self, who: str, name: str, **given: Any) -> Any:
        client = self._clients[who, name]
        if not client.service_is_ready():
            raise self._not_there(who)
        answered: asyncio.Future[Any] = asyncio.get_running_loop().create_future()
        future = client.call_async(client.srv_type.Request(**given))
        future.add_done_callback(partial(_hand_on, answered))
        self.awaited += 1
        try:
            return (await asyncio.wait_for(answered, _PATIENCE)).result()
        except asyncio.TimeoutError:
            client.remove_pending_request(future)
            raise LatheChatterError(
                f'{self.names[who]} did not answer within {_PATIENCE:g} s.'
            ) from None
        finally:
            self.awaited -= 1


def _hand_on(answered: asyncio.Future[Any], done: Any) -> None:
    if not answered.done():
        answered.set_result(done)


def _row(descriptor: Any) -> dict[str, Any]:
    """A parameter as the page makes a control of it."""
    meaning, _, unit = descriptor.description.partition(' [')
    ranges = [*descriptor.floating_point_range, *descriptor.integer_range]
    allowed = descriptor.additional_constraints
    words = allowed.removeprefix('must be one of ')
    return {
        'name': descriptor.name,
        'meaning': meaning,
        'unit': unit.rstrip(']'),
        'allowed': allowed,
        'type': descriptor.type,
        'fixed': descriptor.read_only,
        'choices': words.split(', ') if words != allowed else [],
        'low': ranges[0].from_value if ranges else None,
        'high': ranges[0].to_value if ranges else None,
    }
