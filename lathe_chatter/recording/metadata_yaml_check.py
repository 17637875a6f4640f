"""Whether metadata.yaml says of a run what its files say."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from itertools import zip_longest
from typing import Any

import yaml

from lathe_chatter.recording.metadata_yaml import FILE_NAME
from lathe_chatter.recording.run import Run
from lathe_chatter.recording.verification_result import Verification

_NOTE = 'rosbag2'
"""Name of the record in which writers keep the same in the file itself."""
_LOADER = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)


def check_metadata(found: Verification) -> None:
    """That metadata.yaml says what is there; of a run that was not finished it may be older."""
    folder = found.run.folder
    if folder is None or folder.metadata is None:
        return
    if not found.finished:
        _remark_on_its_age(found, folder.metadata)
        return
    try:
        told = _counts(folder.metadata)
        total = int(folder.metadata.get('message_count', sum(told.values())))
    except (KeyError, TypeError, ValueError, AttributeError):
        found.add_loss(f'{FILE_NAME} does not count the messages of each topic.')
        return
    known = len(found.findings)
    for name in sorted({*told, *found.messages}):
        if told[name] != found.messages[name]:
            found.add_loss(
                f'{FILE_NAME} counts {told[name]} messages of {name}, and '
                f'{found.messages[name]} are there.'
            )
    if len(found.findings) == known and total != sum(told.values()):
        found.add_loss(f'{FILE_NAME} counts {total} messages, and {sum(told.values())} are there.')
    if len(found.findings) == known:
        for text in _differences(found.run, folder.metadata):
            found.add_loss(f'{FILE_NAME} {text}.')


def _remark_on_its_age(found: Verification, metadata: dict[str, Any]) -> None:
    """Say that it is older than the files: what reads it first says the same of the run."""
    told, there = metadata.get('message_count'), found.messages.total()
    live = any(file.being_written for file in found.run.opened)
    if isinstance(told, int) and told < there and not live:
        found.remark(
            f'{FILE_NAME} is older than the files: it counts {told} messages, and {there} are '
            'there. `lathe-chatter recover` makes a run in which it counts them all.'
        )


def _counts(metadata: dict[str, Any]) -> Counter[str]:
    told: Counter[str] = Counter()
    for entry in metadata.get('topics_with_message_count') or ():
        told[str(entry['topic_metadata']['name'])] += int(entry['message_count'])
    return told


def _differences(run: Run, metadata: dict[str, Any]) -> Iterator[str]:
    """Where it says something else than the files, as ends of sentences."""
    noted = [note.values for note in run.opened[-1].notes() if note.name == _NOTE]
    try:
        text = noted[-1]['serialized_metadata']
        expected = yaml.load(text, Loader=_LOADER)['rosbag2_bagfile_information']  # noqa: S506 -- a safe loader
    except (LookupError, TypeError, yaml.YAMLError):
        pass
    else:
        # Only of a last file that was closed with the run is it the last word.
        if expected.get('relative_file_paths') == metadata.get('relative_file_paths'):
            yield from _compared('', metadata, expected)
            return
    types = run.topics
    for entry in metadata.get('topics_with_message_count') or ():
        name, told = entry['topic_metadata']['name'], entry['topic_metadata'].get('type')
        if types.get(name, told) != told:
            yield f'has the type {told} for {name}, and its messages are of type {types[name]}'


def _compared(place: str, told: Any, expected: Any) -> Iterator[str]:
    """Where two trees of values are not the same."""
    if isinstance(told, dict) and isinstance(expected, dict):
        for name in [*expected, *(name for name in told if name not in expected)]:
            yield from _compared(f'{place} {name}'.strip(), told.get(name), expected.get(name))
    elif isinstance(told, list) and isinstance(expected, list):
        for number, (each, other) in enumerate(zip_longest(told, expected), 1):
            yield from _compared(f'{place} {number}', each, other)
    elif told != expected or type(told) is not type(expected):
        yield f'has {told!r} for {place}, and the last file notes {expected!r}'
