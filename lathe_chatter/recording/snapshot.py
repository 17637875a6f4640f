"""The last seconds of a run in memory, which are written when somebody wants them: a black box."""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from lathe_chatter.lathe.change_and_knock_sentences import BEGINNING
from lathe_chatter.recording.cut_log import logger_of
from lathe_chatter.recording.metadata_yaml import Topic
from lathe_chatter.recording.provenance import PARAMETERS, parameter_values
from lathe_chatter.recording.recording_statistics import RunLog
from lathe_chatter.recording.ros_messages import LOG_TYPE, types
from lathe_chatter.recording.run_summary import note_end
from lathe_chatter.recording.run_writer import RunWriter

SNAPSHOT = 'lathe_chatter/snapshot'
"""Name of the record of a run that is the end of a longer one: `seconds`, and `reason`."""
_LONGER = 1.0
"""s for which a log is kept longer: what it says may be of samples that came later."""
_NEVER = 2**63

_Answers = Sequence[tuple[Mapping[str, Any], int]]


class _Message(NamedTuple):
    taken: float
    topic: Topic
    data: bytes
    log_time: int
    publish_time: int
    sequence: int


class SnapshotBuffer:
    """Takes what a `RunWriter` takes and keeps the last of it, until `save` makes a run of it.

    Args:
        seconds: How long messages are kept. What a late reader would get from a publisher is
            kept longer.
    """

    def __init__(self, seconds: float) -> None:
        """Begin empty."""
        self.seconds = seconds
        self.repeated: Counter[str] = Counter()
        self._topics: dict[str, Topic] = {}
        self._messages: deque[_Message] = deque()
        self._kept: dict[str, deque[_Message]] = {}
        self._log: deque[_Message] = deque()
        self._past = RunLog()
        self._notes: dict[str, dict[str, str]] = {}
        self._files: list[Path] = []

    def __len__(self) -> int:
        """How many messages there are."""
        return len(self._messages)

    def add_topic(self, topic: Topic) -> None:
        """Announce a topic before its first message."""
        self._topics[topic.name] = topic

    def write(
        self, name: str, data: bytes, *, log_time: int, publish_time: int, sequence: int = 0
    ) -> None:
        """Add a message, as to a `RunWriter`."""
        now = time.monotonic()
        topic = self._topics[name]
        message = _Message(now, topic, bytes(data), log_time, publish_time, sequence)
        self._messages.append(message)
        while self._messages[0].taken < now - self.seconds:
            old = self._messages.popleft()
            if old.topic.type == LOG_TYPE:
                self._log.append(old)
            elif old.topic.repeated:
                kept = self._kept.setdefault(old.topic.name, deque(maxlen=old.topic.repeated))
                kept.append(old)
        while self._log and self._log[0].taken < now - self.seconds - _LONGER:
            old = self._log.popleft()
            self._past.receive(old.topic.name, LOG_TYPE, old.data, old.log_time, old.publish_time)

    def note(self, name: str, values: Mapping[str, str]) -> None:
        """Keep named values for the runs to come."""
        self._notes[name] = dict(values)

    def attach_file(self, file: Path) -> None:
        """Attach a file to the runs to come.

        Raises:
            OSError: If it cannot be read.
        """
        file.read_bytes()
        self._files.append(file)

    def save(
        self,
        folder: Path,
        reason: str,
        parameters: Mapping[str, _Answers],
        **options: Any,
    ) -> int:
        """Write what is kept as a run of its own, and go on.

        Args:
            folder: To make.
            reason: Why, a sentence.
            parameters: Of lathes, as for `closing_summary`.
            options: As for `RunWriter`.

        Returns:
            How many messages it has.

        Raises:
            RunExistsError: If the folder exists.
            DiskFullError: If the disk has too little room.
            OSError: If it cannot be made or written.
        """
        log = RunLog()
        older = [message for kept in self._kept.values() for message in kept]
        messages = [*older, *self._log, *self._messages]
        parameters = {name: self._since(name, told, messages) for name, told in parameters.items()}
        with RunWriter(folder, **options) as writer:
            told = {PARAMETERS + node: parameter_values(each) for node, each in parameters.items()}
            for name, values in {**self._notes, **told}.items():
                writer.note(name, values)
            for file in self._files:
                writer.attach_file(file)
            for each in messages:
                writer.add_topic(each.topic)
                stamps = {'log_time': each.log_time, 'publish_time': each.publish_time}
                writer.write(each.topic.name, each.data, **stamps, sequence=each.sequence)
                log.receive(each.topic.name, each.topic.type, each.data, *stamps.values())
            writer.note(SNAPSHOT, {'seconds': f'{self.seconds:g}', 'reason': reason})
            note_end(writer, log, parameters)
            writer.commit()
        return len(messages)

    def _since(self, lathe: str, answers: _Answers, messages: Sequence[_Message]) -> _Answers:
        """The parameters of a lathe as they are where some messages begin, and of those after it.

        What it answered is of its start, and what was changed since is no longer in memory.
        """
        first, begins = 0, _NEVER
        for each in messages:
            if each.topic.name == f'{lathe}/samples':
                first = first or each.publish_time
            elif each.topic.type == LOG_TYPE:
                message = types().deserialize_cdr(each.data, LOG_TYPE)
                if message.name == logger_of(lathe) and message.msg == BEGINNING:
                    begins = each.publish_time
                    break
        log = self._past.cut_log_of(lathe)
        log.assign_parameters([each for each in answers if each[1] < begins])
        values = log.sessions[-1].at_its_end
        if begins == _NEVER and not (values and first):
            return answers
        here = [(values, first)] if values and first else []
        return [*here, *(each for each in answers if each[1] >= begins)]
