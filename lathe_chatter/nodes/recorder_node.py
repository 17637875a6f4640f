"""Node `run_recorder`: records topics as they come, undecoded, into a run."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

from rclpy.utilities import get_rmw_implementation_identifier

from lathe_chatter.errors import LatheChatterError, RecordingFailedError, reason_of
from lathe_chatter.nodes import recorder_services
from lathe_chatter.nodes.diagnostics import Diagnostics, Status
from lathe_chatter.nodes.node_main import run_node
from lathe_chatter.nodes.parameter_node import ParameterNode
from lathe_chatter.nodes.real_time_loop import Schedule, spin_in_ticks
from lathe_chatter.nodes.recorded_subscription import RecordedTopic
from lathe_chatter.nodes.recorder_diagnostics import log_news, mixture, recording_status
from lathe_chatter.nodes.recorder_parameters import RECORDER
from lathe_chatter.nodes.recorder_topic_selection import Sink, TopicWatch, selection
from lathe_chatter.nodes.remote_parameters import RemoteParameters
from lathe_chatter.nodes.run_folders import RunFolders
from lathe_chatter.nodes.simulation_control import Answer
from lathe_chatter.recording import RunWriter, Topic
from lathe_chatter.recording.clock_steps import CLOCK, ClockWatch, step_sentence
from lathe_chatter.recording.provenance import (
    IDENTITY,
    PARAMETERS,
    PAUSES,
    RECEPTION,
    ended_by,
    identity,
    parameter_values,
)
from lathe_chatter.recording.recorder_stalls import ReceiveStalls
from lathe_chatter.recording.recording_statistics import RunLog
from lathe_chatter.recording.ros_messages import LOG_TYPE
from lathe_chatter.recording.run_summary import note_end
from lathe_chatter.recording.snapshot import SnapshotBuffer

_COMMIT_PERIOD = 0.2
"""s between two commits: with the time that one takes it is what a kill can lose."""
_TAKE_PERIOD = 0.04
"""s between two times that what has arrived is taken."""
_LOOK_PERIOD = 0.1
"""s between two looks for topics that have appeared."""
_NEWS_PERIOD = 10.0
"""s after what was said of missing samples until more is."""
_ECHO = 0.5
"""s within which what it says last has come back to it, as it records its own log too."""
_FAILED = 1

_NOTHING = Answer(done=False, message='Nothing is being recorded.')


class RecorderNode(ParameterNode):
    """Records raw messages of the topics in its parameter, whenever they appear.

    What a publisher keeps for late readers is asked for, so that the record has the first
    message too. The number that each publisher gives its messages tells of every loss.

    Args:
        by_timer: Whether timers let it work, so that any executor will do; else its loop calls
            `wake` (`real_time_loop.spin_in_ticks`), which costs a third.
        options: As for `rclpy.node.Node`.

    Raises:
        ParameterError: If a parameter given at the start is not allowed.
    """

    def __init__(self, *, by_timer: bool = True, **options: Any) -> None:
        """Make the node; `begin` begins to record."""
        super().__init__('run_recorder', RECORDER, **options)
        self._writer: RunWriter | None = None
        self._snapshot: SnapshotBuffer | None = None
        self._watch: TopicWatch | None = None
        self._failure = ''
        self._folders = RunFolders(self.values)
        self._log, self._stalls = RunLog(), ReceiveStalls()
        self._clock_watch = ClockWatch()
        self._flags, self._next_news, self._awaited = 0, 0.0, b''
        self._diagnostics = Diagnostics(self, 'run recorder')
        recorder_services.create_services(self)
        tasks = (
            (_TAKE_PERIOD, self._take),
            (_LOOK_PERIOD, self._look),
            (_COMMIT_PERIOD, self._commit),
            (1.0, self._report),
        )
        self._schedule = Schedule(*tasks)
        if by_timer:
            for period, task in tasks:
                self.every(period, task)

    def next_wake(self) -> int:
        """When it works next, ns of time.monotonic_ns()."""
        return self._schedule.next_due()

    def wake(self) -> None:
        """Do what is due."""
        self._schedule.run()

    def update_scheduling(self) -> None:
        """It needs no place of its own in the scheduling: late is not lost."""

    def begin(self) -> None:
        """Begin to record, unless `autostart` is false.

        Raises:
            RunExistsError: If the folder to make exists.
            LatheChatterError: If it cannot be made.
        """
        if self.values['autostart']:
            self.start()

    @property
    def run(self) -> Path | None:
        """The folder that is being recorded into."""
        return None if self._writer is None else self._writer.folder

    @property
    def _sink(self) -> Sink | None:
        """What takes the messages."""
        return self._writer if self._snapshot is None else self._snapshot

    @property
    def _topics(self) -> dict[str, RecordedTopic]:
        """What this run has, or the last one had, by full names."""
        return {} if self._watch is None else self._watch.topics

    def messages_of(self, name: str) -> int:
        """How many messages of a topic, by its full name, this run has or the last one had."""
        return self._topics[name].messages if name in self._topics else 0

    def lost_of(self, name: str) -> int:
        """How many of its messages are known to be missing."""
        return self._topics[name].lost if name in self._topics else 0

    def start(self) -> Path | None:
        """Begin a run, or to keep the last seconds; the folder of the run, if there is one.

        Raises:
            RunExistsError: If its folder exists.
            LatheChatterError: If a run is being recorded already, or the folder cannot be made.
        """
        if self._writer is not None:
            raise LatheChatterError(f'Already recording into {self._writer.folder}.')
        if self._snapshot is not None:
            raise LatheChatterError('Already keeping the last in memory.')
        values: Any = self.values
        wanted = selection(self, values)
        if values['snapshot']:
            self._snapshot = SnapshotBuffer(values['snapshot'])
        else:
            self._writer = self._folders.new_run(RunWriter)
        sink: Any = self._sink
        self._failure = ''
        self._watch = TopicWatch(self, wanted, sink, self._write)
        self._log, self._stalls = RunLog(), ReceiveStalls()
        self._clock_watch, self._flags, self._left_out = ClockWatch(), 0, 0
        self._noted: dict[str, list[tuple[dict[str, Any], int]]] = {}
        self._remote = RemoteParameters(self, self._note_parameters)
        middleware = get_rmw_implementation_identifier()
        sink.note(IDENTITY, {**identity(), 'middleware': middleware})
        for name in values['attachments']:
            self._attach(sink, Path(name))
        where = f'into {self.run}' if self.run else f'the last {values["snapshot"]:g} s in memory'
        self.bounded_log.info(f'Recording {where}.', 'begun')
        self._look()
        return self.run

    def _attach(self, sink: Sink, file: Path) -> None:
        try:
            sink.attach_file(file)
        except OSError as error:
            said = f'{file} is not attached to the run: {reason_of(error)}.'
            self.bounded_log.warning(said, 'attachment')

    def stop(self, ended_early: str = '') -> Answer:
        """Finish the run, with everything that has arrived; also before its time, and why."""
        if self._watch is None or self._sink is None:
            return _NOTHING
        self._look(closely=True)  # who came a moment ago is no riddle later
        self._log_news(last=True)
        self._watch.end()
        writer = self._sink
        self._writer = self._snapshot = None
        if isinstance(writer, SnapshotBuffer):
            return Answer(done=True, message='What was in memory is dropped.')
        if writer is None:  # the disk took no more of what came last
            return _NOTHING
        try:
            writer.commit()
            if self._log.pauses:
                writer.note(PAUSES, self._log.pause_values())
            writer.note(RECEPTION, {**self._watch.reception(), **self._stalls.values()})
            note_end(writer, self._log, self._noted, ended_early, self.bounded_log.info)
            writer.close()
        except (OSError, LatheChatterError) as error:
            said = str(error) if isinstance(error, LatheChatterError) else reason_of(error)
            self._failure = f'The end of {writer.folder} is not on disk: {said}'.rstrip('.') + '.'
            writer.abandon()
            return Answer(done=False, message=self._failure)
        lost = sum(map(self.lost_of, self._topics))
        count = sum(map(self.messages_of, self._topics))
        held = f'{writer.folder} holds {count} messages, and {lost} were lost on the way.'
        return Answer(done=True, message=held)

    def split(self) -> Answer:
        """Go on in a new file of the run.

        Raises:
            RecordingFailedError: If the disk takes no more, which ends the node.
        """
        if self._writer is None:
            return _NOTHING
        try:
            self._writer.split()
        except OSError as error:
            self._fail(error)
        return Answer(done=True, message='Going on in a new file.')

    def snapshot(self, reason: str) -> Answer:
        """Write what is in memory as a run of its own, and go on."""
        kept = self._snapshot
        if kept is None or self._watch is None:
            said = 'Nothing is kept in memory: the parameter snapshot says how long to keep it.'
            return Answer(done=False, message=said)
        self._watch.take()

        def save(folder: Path, **options: Any) -> tuple[Path, int]:
            return folder, kept.save(folder, reason, self._noted, **options)

        try:
            folder, count = self._folders.new_run(save)
        except LatheChatterError as error:
            return Answer(done=False, message=str(error))
        return Answer(done=True, message=f'{folder} holds the last {count} messages.')

    def pause(self, *, pause: bool) -> Answer:
        """Leave out what comes from now on, or no longer; asking for what is so is no error."""
        if self._watch is None or self._sink is None:
            return _NOTHING
        if pause == self._watch.paused:
            return Answer(done=True, message='It is so already.')
        self._watch.pause(pause=pause)
        (self._log.pause if pause else self._log.resume)(time.time_ns())
        said = 'What comes is left out.' if pause else 'Recording goes on.'
        return Answer(done=True, message=said)

    def finish(self) -> None:
        """Finish the run, which says so where an error ends the node.

        Raises:
            RecordingFailedError: If its end is not on disk.
        """
        # Kilted destroys nodes, too, that were refused half-made.
        if getattr(self, '_writer', None) is None:
            return
        done, said = self.stop(ended_by(sys.exc_info()[1]))
        if not done:
            self.bounded_log.error(said)
            raise RecordingFailedError(said)
        self.bounded_log.info(said)

    # -- what comes ------------------------------------------------------------------------

    def _look(self, *, closely: bool = False) -> None:
        """Follow the graph: topics and nodes that have appeared."""
        if self._watch is not None and self._sink is not None:
            self._watch.look(self._remote.want, closely=closely)
            self._remote.look()

    def _take(self) -> None:
        """Take what has arrived."""
        if self._watch is None or self._sink is None:
            return
        step = self._clock_watch.look()
        if step is not None:
            for received in self._log.samples.values():
                received.clock_stepped(round(step.seconds * 1e9))
            self._sink.note(CLOCK, self._clock_watch.values())
            self.bounded_log.warning(f'Noted: {step_sentence(step.seconds)}', 'clock step')
        self._stalls.note(time.monotonic())
        self._watch.take()
        if self._snapshot is not None and len(self._log.flags) > self._flags:
            raised = any(up for _, _, up in self._log.flags[self._flags :])
            self._flags = len(self._log.flags)
            if raised:
                done, said = self.snapshot('Chatter was flagged.')
                (self.bounded_log.info if done else self.bounded_log.error)(said, 'snapshot')

    def _write(
        self, topic: Topic, data: bytes, log_time: int, publish_time: int, number: int
    ) -> None:
        """Write a message as it came."""
        sink, name, kind = self._sink, topic.name, topic.type
        if sink is None:
            return
        sink.write(name, data, log_time=log_time, publish_time=publish_time, sequence=number)
        if self._awaited and kind == LOG_TYPE and self._awaited in data:
            self._awaited = b''
        self._log.receive(name, kind, data, log_time, publish_time)

    def _note_parameters(self, node: str, parameters: dict[str, Any]) -> None:
        """Keep what another node was asked for, and when it answered."""
        if self._sink is not None:
            answers = self._noted.setdefault(node, [])
            answers.append((parameters, time.time_ns()))
            self._sink.note(PARAMETERS + node, parameter_values(answers))

    # -- what is done with it --------------------------------------------------------------

    def _commit(self) -> None:
        """Put what has come on disk.

        Raises:
            RecordingFailedError: If the disk takes no more. This ends the node; the lathe and
                the monitor go on.
        """
        if self._writer is None:
            return
        self._take()
        self._log_news()
        left_out = sum(len(each.pauses) for each in self._log.samples.values())
        if left_out != self._left_out:
            self._left_out = left_out
            self._writer.note(PAUSES, self._log.pause_values())
        try:
            self._writer.commit_soon()
        except (OSError, LatheChatterError) as error:
            self._fail(error)

    def _log_news(self, *, last: bool = False) -> None:
        """Say from when there are samples, and where they are missing."""
        for topic, received in self._log.samples.items():
            if received.restarted:
                received.restarted = False
                self._remote.want_again(topic.removesuffix('/samples'))
            if who := mixture(self, topic, received):
                self.bounded_log.error(who)
        now = time.monotonic()
        if not last and now <= self._next_news:
            return
        said = log_news(self.bounded_log, self._log)
        if said:  # a place where samples are missing seldom comes alone
            self._next_news = now + _NEWS_PERIOD
        if last and said and '/rosout' in self._topics:
            self._record_until(said)

    def _record_until(self, sentence: str) -> None:
        """Record until a sentence of its own has come."""
        self._awaited = sentence.encode()
        until = time.monotonic() + _ECHO
        while self._awaited and time.monotonic() < until:
            time.sleep(0.005)
            self._take()

    def _fail(self, error: Exception) -> None:
        said = str(error) if isinstance(error, LatheChatterError) else f'{self.run}: {error}.'
        self._failure = said
        self.bounded_log.error(said)
        if self._writer is not None:
            self._writer.abandon()
            self._writer = None
        self._report()
        raise RecordingFailedError(said) from None

    def _report(self) -> None:
        awaited = self._sink is not None and self._watch is not None and not self._watch.paused
        for received in self._log.samples.values():
            received.look(awaited=awaited)
        self._diagnostics.publish([self._status()])

    def _status(self) -> Status:
        return recording_status(self._sink, self._failure, self._watch, self._log, self._stalls)


def main() -> None:
    """Run the node until it is told to end.

    Raises:
        SystemExit: With 1 if the disk took no more.
    """
    try:
        run_node(
            lambda own: RecorderNode(by_timer=False, cli_args=own['run_recorder']),
            {'run_recorder': RECORDER},
            spin=spin_in_ticks,
        )
    except RecordingFailedError as error:
        sys.stderr.write(f'{error}\n')
        raise SystemExit(_FAILED) from None
