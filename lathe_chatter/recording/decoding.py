"""Messages as objects, by the definitions of their types that stand in the file itself.

A type of the same name may have other fields in another ROS, so what is installed here says
nothing about a recorded message.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

from lathe_chatter.recording.recorded_file import Raw
from lathe_chatter.recording.ros_messages import types


class Recorded(NamedTuple):
    """A recorded message.

    Attributes:
        topic: Its name.
        log_time: When it was received, ns since the epoch.
        sequence: Its number among those of its publisher.
        message: As rosbags decodes it.
        publish_time: When it was published, ns since the epoch.
    """

    topic: str
    log_time: int
    sequence: int
    message: Any
    publish_time: int


def decoded(raw: Raw) -> Recorded | str:
    """A message as an object, or one sentence that says why it is not decoded."""
    if raw.channel.message_encoding != 'cdr':
        return _refused(raw, f'are encoded as {raw.channel.message_encoding!r}, and not as CDR')
    if raw.schema is None:
        return _refused(raw, 'have no schema')
    try:
        type_hash = str(raw.channel.metadata.get('topic_type_hash', ''))
        store = _store(raw.type, raw.schema.encoding, bytes(raw.schema.data), type_hash)
        message = store.deserialize_cdr(raw.data, raw.type)
    except _UnknownTypeError as error:
        return _refused(raw, str(error))
    except Exception as error:  # noqa: BLE001 -- of a library, about bytes that may be anything
        reason = f'{type(error).__name__} {error}'.strip()
        return _refused(raw, f'do not fit the definition of their type in the file ({reason})')
    return Recorded(raw.topic, raw.log_time, raw.sequence, message, raw.publish_time)


def _refused(raw: Raw, reason: str) -> str:
    of_type = f' of type {raw.type}' if raw.type else ''
    return f'Messages of {raw.topic}{of_type} {reason}: they are not decoded.'


class _UnknownTypeError(Exception):
    """A type whose definition is none that is understood; the text is a phrase."""


@lru_cache(maxsize=256)
def _store(name: str, encoding: str, data: bytes, type_hash: str) -> Any:
    """What decodes a type.

    Raises:
        _UnknownTypeError: If its definition is none that is understood.
    """
    if not data.strip():
        # Some writers leave the definition out; its hash proves that ours is the same.
        if type_hash and name in types().fielddefs and types().hash_rihs01(name) == type_hash:
            return types()
        raise _UnknownTypeError('have no definition of their type in the file')
    if encoding not in {'ros2msg', 'ros2idl'}:
        raise _UnknownTypeError(f'are described in {encoding!r}, and not in a language of ROS')
    store = get_typestore(Stores.EMPTY)
    text = data.decode()
    if encoding == 'ros2msg':
        store.register(get_types_from_msg(text, name))
    else:
        for part in _idl_files(text):
            store.register(get_types_from_idl(part))
    return store


def _idl_files(text: str) -> list[str]:
    """The files of a definition in IDL, each after a line of its own that names it."""
    parts: list[list[str]] = [[]]
    for line in text.splitlines():
        if line.startswith(('====', 'IDL: ')):
            parts.append([])
        else:
            parts[-1].append(line)
    return ['\n'.join(part) for part in parts if any(line.strip() for line in part)]
