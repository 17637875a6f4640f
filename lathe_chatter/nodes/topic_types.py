"""The types of topics: what a recorder has to know to subscribe to any, and to describe it."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from rclpy.topic_endpoint_info import TopicEndpointInfo

from lathe_chatter.recording.ros_messages import types

_SEPARATOR = f'{"=" * 80}\nMSG: '


class MessageType(NamedTuple):
    """A type of messages.

    Attributes:
        name: As `std_msgs/msg/Bool`.
        message_class: To subscribe with.
        definition: Its text and that of all types that it uses; empty where it is not known.
        type_hash: RIHS01.
    """

    name: str
    message_class: Any
    definition: str
    type_hash: str


class MissingTypeError(Exception):
    """A type that is not installed here; the text says what is missing."""


def message_type(offer: TopicEndpointInfo) -> MessageType:
    """The type that a publisher offers.

    Raises:
        MissingTypeError: If it is not installed.
    """
    name = offer.topic_type
    published = str(offer.topic_type_hash)
    definition, known = _known_definition(name)
    if not definition or (published.startswith('RIHS') and published != known):
        definition, known = _installed_definition(name), published
    type_hash = published if published.startswith('RIHS') else known
    return MessageType(name, _message_class(name), definition, type_hash)


def _message_class(name: str) -> Any:
    """The class of a type; also of requests, events and feedback, which are messages as well."""
    try:
        package, kind, short = name.split('/')
        module = import_module(f'{package}.{kind}')
        if hasattr(module, short):
            return getattr(module, short)
        owner, _, part = short.rpartition('_')
        found = getattr(module, owner)
        return getattr(found, part) if hasattr(found, part) else getattr(found.Impl, part)
    except ImportError:
        raise MissingTypeError(f'the package of its type {name} is not installed here') from None
    except (ValueError, AttributeError):
        raise MissingTypeError(f'its type {name} is not in the package installed here') from None


@cache
def _known_definition(name: str) -> tuple[str, str]:
    """Definition and hash of a type that rosbags knows, else empty."""
    if name not in types().fielddefs:
        return '', ''
    definition, _ = types().generate_msgdef(name, ros_version=2)
    return definition, types().hash_rihs01(name)


@cache
def _installed_definition(name: str) -> str:
    """The definition of a type as it is installed; empty where its files are not there."""
    text = _file_of(name)
    if not text:
        return ''
    parts, waiting, done = [text], _used_in(name, text), {name}
    while waiting:
        used = waiting.pop(0)
        if used in done:
            continue
        done.add(used)
        text = _file_of(used)
        if not text:
            return ''  # half a definition is none
        package, _, short = used.split('/')
        parts.append(f'{_SEPARATOR}{package}/{short}\n{text}')
        waiting += _used_in(used, text)
    return '\n'.join(parts)


def _file_of(name: str) -> str:
    """The text of a message's file, beside the Python package that was generated from it."""
    package, kind, short = name.split('/')
    try:
        place = Path(str(import_module(package).__file__))
    except ImportError:
        return ''
    for folder in place.parents:
        file = folder / 'share' / package / kind / f'{short}.msg'
        if file.is_file():
            return file.read_text(encoding='utf-8')
    return ''


def _used_in(name: str, text: str) -> list[str]:
    """Names of the types of other messages in a definition."""
    package = name.split('/', maxsplit=1)[0]
    used: list[str] = []
    for line in text.splitlines():
        words = line.split('#')[0].split()
        kind = words[0].split('[')[0].split('<')[0] if len(words) > 1 else ''
        if '/' in kind:
            used.append(f'{kind.split("/")[0]}/msg/{kind.split("/")[-1]}')
        elif kind[:1].isupper():
            used.append(f'{package}/msg/{kind}')
    return used
