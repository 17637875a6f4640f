"""A run written by whoever has the lathe itself: no ROS, the same files, equal arrays."""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from lathe_chatter.array_types import Array
from lathe_chatter.recording.clock_steps import CLOCK, ClockWatch
from lathe_chatter.recording.cut_log import logger_of
from lathe_chatter.recording.provenance import (
    IDENTITY,
    PARAMETERS,
    ended_by,
    identity,
    parameter_values,
)
from lathe_chatter.recording.recording_statistics import RunLog
from lathe_chatter.recording.ros_messages import (
    LOG_TYPE,
    PARAMETER_EVENT_TYPE,
    log_bytes,
    message_bytes,
    parameters_bytes,
    topic_of_type,
)
from lathe_chatter.recording.run_summary import note_end
from lathe_chatter.recording.run_writer import RunWriter
from lathe_chatter.samples import SAMPLE_COLUMNS, sample_columns
from lathe_chatter.samples.codec import SAMPLES_TYPE, encode_block

_COMMIT_PERIOD, _SIMULATED_COMMIT_PERIOD = 0.1, 0.05
"""s between two commits: with the time that one takes this is what a kill can lose. Of a
simulation a commit has more to write, some 100 MB a second."""
_SECOND = 10**9


class LatheRun(AbstractContextManager['LatheRun']):
    """Records one lathe: samples, parameters, and the sentences of what happens to the cut.

    What it leaves is read, verified, resimulated and reported as a run of the recorder is. As a
    context it closes itself.

    Args:
        folder: To make.
        parameters: Of the lathe at its start, by name (`lathe_parameter_table.parameters_of`).
        name: Of the lathe, beginning with a slash: its topics are below.
        simulated: Whether messages are dated by simulated time since now, instead of when they
            were written.
        options: As for `RunWriter`.

    Raises:
        RunExistsError: If the folder exists.
        OSError: If it cannot be made or written.
    """

    def __init__(
        self,
        folder: Path,
        parameters: Mapping[str, Any],
        *,
        name: str = '/lathe',
        simulated: bool = False,
        **options: Any,
    ) -> None:
        """Make the run, with its parameters in it."""
        self.name = name
        self.writer = RunWriter(folder, **options)
        self._samples = f'{name}/samples'
        self._begun = self._now = time.time_ns()
        self._simulated = simulated
        self._sequences: dict[str, int] = {}
        self._period = _SIMULATED_COMMIT_PERIOD if simulated else _COMMIT_PERIOD
        self._closed = False
        self._clock = ClockWatch()
        self._log, self._parameters = RunLog(), dict(parameters)
        self._kinds: dict[str, str] = {}
        self.writer.note(IDENTITY, identity())
        self.writer.note(PARAMETERS + name, parameter_values([(parameters, self._begun)]))
        for topic, kind in (
            (self._samples, SAMPLES_TYPE),
            ('/rosout', LOG_TYPE),
            ('/parameter_events', PARAMETER_EVENT_TYPE),
        ):
            self._announce(topic, kind)
        announced = parameters_bytes(name, dict(parameters), self._begun)
        self._add('/parameter_events', announced)
        self.commit()  # which has the disk keep metadata.yaml: that takes its time once

    def write(self, samples: Array) -> None:
        """Write a block of samples (n, 8) or (n, 10), n > 0; from time to time put it all on disk.

        Raises:
            LatheChatterError: If the disk has too little room left.
            OSError: If it refuses.
        """
        if self._simulated:
            self._now = self._begun + round(float(samples[-1, 0]) * _SECOND)
        columns = sample_columns(accelerometers=samples.shape[1] > len(SAMPLE_COLUMNS))
        self._add(self._samples, encode_block(samples, columns))
        if time.monotonic() - self._committed > self._period:
            self.commit()

    def log(self, sentence: str) -> None:
        """Write what happened to the cut, a sentence of `change_and_knock_sentences`."""
        self._add('/rosout', log_bytes(logger_of(self.name), sentence, self._stamp()))

    def publish(self, topic: str, kind: str, **fields: Any) -> None:
        """Write a message of another topic, as `std_msgs/msg/Bool` with `data=True`."""
        if topic not in self._kinds:
            self._announce(topic, kind)
        self._add(topic, message_bytes(kind, **fields))

    def commit(self) -> None:
        """Have everything written so far put on disk.

        Raises:
            LatheChatterError: If the disk had too little room left for a commit before.
            OSError: If it refused.
        """
        self._committed = time.monotonic()
        if not self._simulated and self._clock.look():
            self.writer.note(CLOCK, self._clock.values())
        # Of a simulation no data may pile up that is not on disk: it waits for the disk.
        (self.writer.commit if self._simulated else self.writer.commit_soon)()

    def close(self, ended_early: str = '') -> None:
        """Finish the run, with its summary; a second time does nothing.

        Args:
            ended_early: Why it has not all that it was to have, a sentence; else empty.

        Raises:
            OSError: If the disk refuses.
        """
        if self._closed:
            return
        self._closed = True
        told = {self.name: [(self._parameters, self._begun)]}
        note_end(self.writer, self._log, told, ended_early)
        self.writer.close()

    def abandon(self) -> None:
        """Leave what the last commit left: the disk takes no more."""
        self._closed = True
        self.writer.abandon()

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> None:
        """Close; after an exception the run says that it ended early."""
        self.close(ended_by(error))

    def _announce(self, topic: str, kind: str) -> None:
        self.writer.add_topic(topic_of_type(topic, kind))
        self._kinds[topic] = kind

    def _stamp(self) -> int:
        return self._now if self._simulated else time.time_ns()

    def _add(self, topic: str, data: bytes) -> None:
        number = self._sequences[topic] = self._sequences.get(topic, 0) + 1
        stamp = self._stamp()
        self.writer.write(topic, data, log_time=stamp, publish_time=stamp, sequence=number)
        self._log.receive(topic, self._kinds[topic], data, stamp, stamp)
