"""The last seconds of a longer run: what was changed before them is known all the same."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.lathe.change_and_knock_sentences import BEGINNING, change_sentence
from lathe_chatter.model.lathe_parameter_table import parameters_of
from lathe_chatter.recording import read_run, verify
from lathe_chatter.recording.provenance import PARAMETERS, parameter_values
from lathe_chatter.recording.ros_messages import LOG_TYPE, log_bytes, topic_of_type
from lathe_chatter.recording.run_summary import SUMMARY
from lathe_chatter.recording.snapshot import SnapshotBuffer
from lathe_chatter.report.run_history import read_history
from lathe_chatter.samples.codec import SAMPLES_TYPE, encode_block

SECONDS, LONG = 0.3, 1.5
"""s that are kept, and so long that the log of before is dropped, too."""


class Recorder:
    """What a recorder does with a snapshot."""

    def __init__(self) -> None:
        self.kept = SnapshotBuffer(SECONDS)
        self.answers: list[tuple[dict[str, Any], int]] = []
        self.kept.add_topic(topic_of_type('/lathe/samples', SAMPLES_TYPE))
        self.kept.add_topic(topic_of_type('/rosout', LOG_TYPE))

    def add(self, topic: str, data: bytes) -> None:
        now = time.time_ns()
        self.kept.write(topic, data, log_time=now, publish_time=now)

    def say(self, sentence: str) -> None:
        self.add('/rosout', log_bytes('lathe', sentence, time.time_ns()))

    def begin(self, **values: float) -> VirtualLathe:
        """A lathe begins, and answers."""
        lathe = VirtualLathe()
        lathe.retune(lathe.cut.with_changes(**values))
        self.say(BEGINNING)
        self.answers.append((parameters_of(lathe), time.time_ns()))
        self.kept.note(f'{PARAMETERS}/lathe', parameter_values(self.answers))
        return lathe

    def cut(self, lathe: VirtualLathe, seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.add('/lathe/samples', encode_block(lathe.advance(20)))
            time.sleep(0.01)

    def deepen(self, lathe: VirtualLathe, depth: float) -> None:
        cut = lathe.cut.with_changes(depth_of_cut=depth)
        self.say(change_sentence(lathe.time, lathe.cut, cut))
        lathe.retune(cut)

    def save(self, folder: Path) -> Path:
        self.kept.save(folder, 'It was asked for.', {'/lathe': self.answers})
        return folder


def test_a_change_of_long_before_is_in_the_parameters_of_a_snapshot(tmp_path: Path) -> None:
    recorder = Recorder()
    lathe = recorder.begin()
    recorder.cut(lathe, 0.1)
    recorder.deepen(lathe, 0.0007)
    recorder.cut(lathe, LONG)
    recorder.deepen(lathe, 0.0008)
    recorder.cut(lathe, 0.1)
    folder = recorder.save(tmp_path / 'run')
    history = read_history(folder)
    assert history.sessions[0].start.depth_of_cut == 0.0007
    assert [change.new for change in history.changes] == [{'depth_of_cut': 0.0008}]
    assert not history.remarks
    (summary,) = [note.values for note in read_run(folder).notes() if note.name == SUMMARY]
    first = read_run(folder).samples().columns['time'][0]
    assert (
        f'[{{"time": {first}, "spindle_speed_rpm": 3000.0, "depth_of_cut": 0.0007'
        in (summary['linear_model'])
    )
    assert verify(folder).complete


def test_a_lathe_that_began_in_a_snapshot_has_its_own_parameters(tmp_path: Path) -> None:
    recorder = Recorder()
    recorder.cut(recorder.begin(depth_of_cut=0.0004), LONG)
    recorder.cut(recorder.begin(depth_of_cut=0.0006), 0.1)
    history = read_history(recorder.save(tmp_path / 'both'))
    starts = [session.start.depth_of_cut for session in history.sessions]
    assert starts == [0.0004, 0.0006]
    recorder.cut(recorder.begin(depth_of_cut=0.0009), 2 * SECONDS)
    history = read_history(recorder.save(tmp_path / 'last'))
    assert history.sessions[0].start.depth_of_cut == 0.0009
