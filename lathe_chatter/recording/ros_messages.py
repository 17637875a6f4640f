"""Messages of ROS without ROS: rosbags knows the types that a run of ours needs."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

from lathe_chatter.recording.metadata_yaml import Topic

LOG_TYPE = 'rcl_interfaces/msg/Log'
PARAMETER_EVENT_TYPE = 'rcl_interfaces/msg/ParameterEvent'
_SECOND = 10**9
_INFO = 20
_KINDS = ((bool, 1, 'bool_value'), (int, 2, 'integer_value'), (float, 3, 'double_value'))
_TEXT, _TEXTS = 4, 9


@cache
def types() -> Any:
    """The messages of Jazzy, as rosbags has them."""
    return get_typestore(Stores.ROS2_JAZZY)


def namespace_of(topic: str) -> str:
    """Of the node whose private topic it is: `/cell1` of `/cell1/lathe/samples`."""
    return topic.rsplit('/', 2)[0]


def topic_of_type(name: str, kind: str) -> Topic:
    """A topic of a type that rosbags knows.

    Raises:
        KeyError: If it does not.
    """
    definition, _ = types().generate_msgdef(kind, ros_version=2)
    return Topic(name, kind, definition, types().hash_rihs01(kind))


def message_bytes(kind: str, **fields: Any) -> bytes:
    """A message of a type, serialised."""
    return bytes(types().serialize_cdr(types().types[kind](**fields), kind))


def log_bytes(name: str, sentence: str, stamp: int) -> bytes:
    """A sentence as a node logs it on /rosout.

    Args:
        name: Of its logger.
        sentence: What it says.
        stamp: When, ns since the epoch.
    """
    return message_bytes(
        LOG_TYPE,
        stamp=_time(stamp),
        level=_INFO,
        name=name,
        msg=sentence,
        file='',
        function='',
        line=0,
    )


def parameters_bytes(node: str, values: dict[str, Any], stamp: int) -> bytes:
    """The parameters of a node as it announces them on /parameter_events."""
    parameter = types().types['rcl_interfaces/msg/Parameter']
    return message_bytes(
        PARAMETER_EVENT_TYPE,
        stamp=_time(stamp),
        node=node,
        new_parameters=[parameter(name=n, value=_value(v)) for n, v in values.items()],
        changed_parameters=[],
        deleted_parameters=[],
    )


def _time(stamp: int) -> Any:
    seconds, rest = divmod(stamp, _SECOND)
    return types().types['builtin_interfaces/msg/Time'](sec=seconds, nanosec=rest)


def _value(value: Any) -> Any:
    """A value as an rcl_interfaces ParameterValue."""
    fields: dict[str, Any] = {
        'type': 0,
        'bool_value': False,
        'integer_value': 0,
        'double_value': 0.0,
        'string_value': '',
        'byte_array_value': np.zeros(0, np.uint8),
        'bool_array_value': np.zeros(0, bool),
        'integer_array_value': np.zeros(0, np.int64),
        'double_array_value': np.zeros(0),
        'string_array_value': [],
    }
    for kind, number, name in _KINDS:
        if isinstance(value, kind):
            return _filled(fields, number, name, value)
    if isinstance(value, str):
        return _filled(fields, _TEXT, 'string_value', value)
    return _filled(fields, _TEXTS, 'string_array_value', [str(each) for each in value])


def _filled(fields: dict[str, Any], number: int, name: str, value: Any) -> Any:
    known = types().types['rcl_interfaces/msg/ParameterValue']
    return known(**{**fields, 'type': number, name: value})
