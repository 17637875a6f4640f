"""Node `run_recorder`: records topics as they come, undecoded, into a run."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from importlib import import_module
from pathlib import Path
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.duration import Infinite
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from rosbags.typesys import Stores, get_typestore
from std_srvs.srv import Trigger

from lathe_chatter.errors import LatheChatterError
from lathe_chatter.nodes.diagnostics import ERROR, OK, WARN, Diagnostics, Status
from lathe_chatter.nodes.parameter_node import ParameterNode
from lathe_chatter.nodes.parameters import RECORDER
from lathe_chatter.nodes.running import run_node
from lathe_chatter.recording import RunWriter, Topic

_COMMIT_PERIOD = 0.25
"""s between two commits: what a kill can lose."""
_LOOK_PERIOD = 0.1
"""s between two looks for topics that have appeared."""
_BACKLOG = 5000
"""Messages that may wait here: 10 s of a lathe of 500 ticks a second."""
_INFINITE = {'sec': 9223372036, 'nsec': 854775807}


@dataclass
class _Channel:
    """A topic that is being recorded."""

    topic: Topic
    subscription: Subscription
    single: bool
    last: int | None = None
    lost: int = 0
    messages: int = 0


class RecorderNode(ParameterNode):
    """Records raw messages of the topics in its parameter, whenever they appear.

    What a publisher keeps for late readers is asked for, so that the record has the first
    message too. The number that each publisher gives its messages tells of every loss.

    Args:
        options: As for `rclpy.node.Node`.

    Raises:
        ParameterError: If a parameter given at the start is not allowed.
        RunExistsError: If the folder to make exists.
    """

    def __init__(self, **options: Any) -> None:
        """Begin to record, unless `autostart` is false."""
        super().__init__('run_recorder', RECORDER, **options)
        self._types = get_typestore(Stores.ROS2_JAZZY)
        self._writer: RunWriter | None = None
        self._channels: dict[str, _Channel] = {}
        self._refused: set[str] = set()
        self._failure = ''
        self._split_at = 0.0
        self._diagnostics = Diagnostics(self, 'run recorder')
        self.create_service(Trigger, '~/start', self._on_start)
        self.create_service(Trigger, '~/stop', self._on_stop)
        self.create_service(Trigger, '~/split', self._on_split)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(_LOOK_PERIOD, self._look, clock=steady)
        self.create_timer(_COMMIT_PERIOD, self._commit, clock=steady)
        self.create_timer(1.0, self._report, clock=steady)
        if self.values['autostart']:
            self.start()

    @property
    def run(self) -> Path | None:
        """The folder that is being recorded into."""
        return None if self._writer is None else self._writer.folder

    def messages_of(self, name: str) -> int:
        """How many messages of a topic, by its full name, were recorded."""
        return self._channels[name].messages if name in self._channels else 0

    def lost_of(self, name: str) -> int:
        """How many of its messages are known to be missing."""
        return self._channels[name].lost if name in self._channels else 0

    def start(self) -> Path:
        """Begin a run.

        Raises:
            RunExistsError: If its folder exists.
            LatheChatterError: If a run is being recorded already, or the folder cannot be made.
        """
        if self._writer is not None:
            raise LatheChatterError(f'Already recording into {self._writer.folder}.')
        values: Mapping[str, Any] = self.values
        now = f'{datetime.now().astimezone():%Y%m%d-%H%M%S}'
        folder = Path(values['output'] or Path('runs', now))
        try:
            self._writer = RunWriter(folder, min_free_space=values['min_free_space'])
        except OSError as error:
            raise LatheChatterError(f'The run {folder} cannot be made: {error}.') from None
        self._failure = ''
        self._split_at = time.monotonic() + values['split_duration']
        for channel in self._channels.values():
            self._writer.add_topic(channel.topic)
        self.get_logger().info(f'Recording into {folder}.')
        self._look()
        return folder

    def stop(self) -> str:
        """Finish the run, with everything that has arrived; a sentence about it."""
        if self._writer is None:
            return 'Nothing is being recorded.'
        for name, channel in self._channels.items():
            _drain(channel.subscription, lambda data, info, n=name: self._take(n, data, info))
        writer, self._writer = self._writer, None
        try:
            writer.close()
        except OSError as error:
            self._failure = f'The end of {writer.folder} is not on disk: {error}.'
            return self._failure
        lost = sum(channel.lost for channel in self._channels.values())
        count = sum(channel.messages for channel in self._channels.values())
        return f'{writer.folder} holds {count} messages, and {lost} were lost on the way.'

    def destroy_node(self) -> None:
        """Finish the run before the node goes."""
        if self._writer is not None:
            said = self.stop()
            self.get_logger().info(said)
        super().destroy_node()

    # -- what comes ------------------------------------------------------------------------

    def _look(self) -> None:
        """Subscribe to wanted topics that have appeared."""
        if self._writer is None:
            return
        topics: Any = self.values['topics']
        for name in map(self.resolve_topic_name, topics):
            if name not in self._channels and name not in self._refused:
                self._join(name)

    def _join(self, name: str) -> None:
        """Record a topic if it has a publisher yet."""
        offers = self.get_publishers_info_by_topic(name)
        if not offers or self._writer is None:
            return
        kind = offers[0].topic_type
        if kind not in self._types.fielddefs:
            self._refused.add(name)
            self.get_logger().warning(f'{name} is not recorded: its type {kind} is not known.')
            return
        definition, _ = self._types.generate_msgdef(kind, ros_version=2)
        topic = Topic(
            name,
            kind,
            definition,
            self._types.hash_rihs01(kind),
            tuple(_profile(offer.qos_profile) for offer in offers),
        )
        self._writer.add_topic(topic)
        subscription = self.create_subscription(
            _message_class(kind),
            name,
            lambda data, info: self._take(name, data, info),
            _matching([offer.qos_profile for offer in offers]),
            raw=True,
        )
        self._channels[name] = _Channel(topic, subscription, single=len(offers) == 1)

    def _take(self, name: str, data: bytes, info: Mapping[str, int]) -> None:
        """Write a message as it came, and see whether one before it is missing."""
        if self._writer is None:
            return
        channel = self._channels[name]
        sequence = info['publication_sequence_number']
        if channel.single and sequence is not None:
            # Numbers begin with 1; a publisher that was started again counts from there.
            expected = 1 if channel.last is None else channel.last + 1
            channel.lost += max(sequence - expected, 0)
            channel.last = sequence
        channel.messages += 1
        self._writer.write(
            name,
            data,
            log_time=info['received_timestamp'] or time.time_ns(),
            publish_time=info['source_timestamp'] or time.time_ns(),
            sequence=sequence or 0,
        )

    # -- what is done with it --------------------------------------------------------------

    def _commit(self) -> None:
        """Put what has come on disk; split where it is time."""
        if self._writer is None:
            return
        try:
            if time.monotonic() >= self._split_at:
                self._split()
            self._writer.commit()
        except (OSError, LatheChatterError) as error:
            self._failure = str(error)
            self.get_logger().error(self._failure)
            self._writer.abandon()
            self._writer = None
            self._report()

    def _split(self) -> None:
        duration: Any = self.values['split_duration']
        self._split_at = time.monotonic() + duration
        if self._writer is not None:
            self._writer.split()

    def _on_start(self, _request: Any, response: Any) -> Any:
        try:
            response.message = f'Recording into {self.start()}.'
            response.success = True
        except LatheChatterError as error:
            response.success, response.message = False, str(error)
        return response

    def _on_stop(self, _request: Any, response: Any) -> Any:
        response.success = self._writer is not None
        response.message = self.stop()
        return response

    def _on_split(self, _request: Any, response: Any) -> Any:
        response.success = self._writer is not None
        self._split()
        response.message = 'Going on in a new file.' if response.success else self.stop()
        return response

    def _report(self) -> None:
        self._diagnostics.publish([self._status()])

    def _status(self) -> Status:
        lost = {name: channel.lost for name, channel in self._channels.items() if channel.lost}
        values = {
            'run': str(self.run or ''),
            'messages': str(sum(channel.messages for channel in self._channels.values())),
            'lost': str(sum(lost.values())),
            'topics': str(len(self._channels)),
        }
        if self._failure:
            return Status('recording', ERROR, self._failure, values)
        if lost:
            named = ', '.join(f'{count} of {name}' for name, count in lost.items())
            return Status('recording', WARN, f'messages were lost: {named}', values)
        return Status('recording', OK, 'recording' if self._writer else 'not recording', values)


def _message_class(kind: str) -> Any:
    """The class of a type named as `std_msgs/msg/Bool`."""
    package, _, name = kind.split('/')
    return getattr(import_module(f'{package}.msg'), name)


def _matching(offers: list[QoSProfile]) -> QoSProfile:
    """The most demanding profile that every publisher can serve, and a deep queue."""
    reliable = all(offer.reliability == ReliabilityPolicy.RELIABLE for offer in offers)
    kept = all(offer.durability == DurabilityPolicy.TRANSIENT_LOCAL for offer in offers)
    return QoSProfile(
        depth=_BACKLOG,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if kept else DurabilityPolicy.VOLATILE,
    )


def _profile(qos: QoSProfile) -> dict[str, Any]:
    """A profile as rosbag2 writes it."""

    def lasting(duration: Any) -> dict[str, int]:
        if duration == Infinite:
            return dict(_INFINITE)
        seconds, rest = divmod(duration.nanoseconds, 10**9)
        return {'sec': seconds, 'nsec': rest}

    return {
        'history': qos.history.name.lower(),
        'depth': qos.depth,
        'reliability': qos.reliability.name.lower(),
        'durability': qos.durability.name.lower(),
        'deadline': lasting(qos.deadline),
        'lifespan': lasting(qos.lifespan),
        'liveliness': qos.liveliness.name.lower(),
        'liveliness_lease_duration': lasting(qos.liveliness_lease_duration),
        'avoid_ros_namespace_conventions': qos.avoid_ros_namespace_conventions,
    }


def _drain(subscription: Subscription, take: Any) -> None:
    """Take what has arrived and was not yet served."""
    with subscription.handle:
        while (found := subscription.handle.take_message(subscription.msg_type, True)) is not None:  # noqa: FBT003 -- raw
            take(*found)


def main() -> None:
    """Run the node until it is told to end."""
    # The executor driven by events fails on callbacks that take the message info too.
    run_node(RecorderNode, by_events=False)


if __name__ == '__main__':
    main()
