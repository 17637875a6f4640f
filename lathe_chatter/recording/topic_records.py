"""Topics as the records of an MCAP file: their numbers are the same in every file of a run."""

from __future__ import annotations

from typing import NamedTuple

from mcap.records import Channel, Schema

from lathe_chatter.recording.metadata import Topic, dump_qos
from lathe_chatter.recording.open_chunk import record_bytes


class TopicRecords(NamedTuple):
    """A topic with its records.

    Attributes:
        topic: Which.
        schema: Of its type; empty where a topic before has the same.
        channel: The channel.
    """

    topic: Topic
    schema: bytes
    channel: bytes


class TopicTable:
    """Gives topics their numbers.

    Attributes:
        numbers: Of the channels, by name of topic.
        described: Schema and channel as a chunk has them, by number of the channel.
    """

    def __init__(self) -> None:
        """Begin empty."""
        self.numbers: dict[str, int] = {}
        self.described: dict[int, bytes] = {}
        self._schemas: dict[str, tuple[int, bytes]] = {}

    def add(self, topic: Topic) -> TopicRecords | None:
        """The records of a topic that is new; None for one that is known."""
        if topic.name in self.numbers:
            return None
        known = topic.type in self._schemas
        if not known:
            number = len(self._schemas) + 1
            data = topic.definition.encode()
            schema = Schema(id=number, name=topic.type, encoding='ros2msg', data=data)
            self._schemas[topic.type] = number, record_bytes(schema)
        schema_number, schema_record = self._schemas[topic.type]
        number = len(self.numbers) + 1
        channel = record_bytes(
            Channel(
                id=number,
                topic=topic.name,
                message_encoding='cdr',
                metadata={
                    'offered_qos_profiles': dump_qos(topic.qos),
                    'topic_type_hash': topic.type_hash,
                },
                schema_id=schema_number,
            )
        )
        self.described[number] = schema_record + channel
        self.numbers[topic.name] = number
        return TopicRecords(topic, b'' if known else schema_record, channel)
