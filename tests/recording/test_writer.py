"""What RunWriter leaves on disk, read back by other people's readers."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader
from support.recorded import (
    BOOL,
    NUMBER,
    STORE,
    WRITER_CHILD,
    number,
    topic,
    values_by_mcap,
    values_by_rosbags,
)

from lathe_chatter.recording import RunWriter, Topic
from lathe_chatter.recording.writer import DiskFullError, RunExistsError

START = 1_700_000_000_000_000_000


def fill(writer: RunWriter, first: int, last: int) -> None:
    for k in range(first, last):
        time = START + k * 1_000_000
        writer.write(
            '/numbers', number(float(k)), log_time=time, publish_time=time - 5, sequence=k
        )


def test_rosbags_and_mcap_read_every_message_back(tmp_path: Path, numbers: Topic) -> None:
    folder = tmp_path / 'run'
    with RunWriter(folder) as writer:
        writer.add_topic(numbers)
        fill(writer, 0, 1000)
    assert values_by_rosbags(folder) == values_by_mcap(folder / 'run_0.mcap')
    assert values_by_rosbags(folder) == [float(k) for k in range(1000)]
    with (folder / 'run_0.mcap').open('rb') as stream:
        messages = [message for _, _, message in make_reader(stream).iter_messages()]
    assert [m.sequence for m in messages] == list(range(1000))
    assert messages[7].log_time == START + 7_000_000
    assert messages[7].publish_time == messages[7].log_time - 5


def test_the_file_is_complete_after_every_commit(tmp_path: Path, numbers: Topic) -> None:
    folder = tmp_path / 'run'
    writer = RunWriter(folder)
    assert values_by_mcap(folder / 'run_0.mcap') == []
    writer.add_topic(numbers)
    for k in range(30):
        fill(writer, 10 * k, 10 * (k + 1))
        writer.commit()
        # As it would be found after a kill at this instant: by both readers, with its index.
        expected = [float(j) for j in range(10 * (k + 1))]
        assert values_by_mcap(folder / 'run_0.mcap') == expected
        assert values_by_rosbags(folder) == expected
    writer.close()


def test_what_is_not_committed_is_not_there_and_harms_nothing(
    tmp_path: Path, numbers: Topic
) -> None:
    writer = RunWriter(tmp_path / 'run')
    writer.add_topic(numbers)
    fill(writer, 0, 10)
    writer.commit()
    fill(writer, 10, 20)
    assert values_by_rosbags(tmp_path / 'run') == [float(k) for k in range(10)]
    writer.close()
    assert values_by_rosbags(tmp_path / 'run') == [float(k) for k in range(20)]


def test_a_topic_may_come_late_and_types_may_differ(tmp_path: Path, numbers: Topic) -> None:
    folder = tmp_path / 'run'
    with RunWriter(folder) as writer:
        writer.add_topic(numbers)
        fill(writer, 0, 5)
        writer.commit()
        writer.add_topic(topic('/flag', BOOL))
        raw = bytes(STORE.serialize_cdr(STORE.types[BOOL](data=True), BOOL))
        writer.write('/flag', raw, log_time=START, publish_time=START)
    with Reader(folder) as reader:
        assert {c.topic: (c.msgtype, c.msgcount) for c in reader.connections} == {
            '/numbers': (NUMBER, 5),
            '/flag': (BOOL, 1),
        }


def test_the_pieces_of_a_split_run_hold_every_message_once(tmp_path: Path, numbers: Topic) -> None:
    folder = tmp_path / 'run'
    with RunWriter(folder) as writer:
        writer.add_topic(numbers)
        for k in range(3):
            fill(writer, 100 * k, 100 * (k + 1))
            if k < 2:
                writer.split()
    assert sorted(file.name for file in folder.glob('*.mcap')) == [
        'run_0.mcap', 'run_1.mcap', 'run_2.mcap',
    ]  # fmt: skip
    assert values_by_rosbags(folder) == [float(k) for k in range(300)]


def test_metadata_is_rosbag2s_from_the_first_moment(tmp_path: Path, numbers: Topic) -> None:
    folder = tmp_path / 'run'
    writer = RunWriter(folder, distribution='jazzy')
    early = yaml.safe_load((folder / 'metadata.yaml').read_text())
    assert early['rosbag2_bagfile_information']['relative_file_paths'] == ['run_0.mcap']
    writer.add_topic(numbers)
    fill(writer, 0, 10)
    writer.close()
    late = yaml.safe_load((folder / 'metadata.yaml').read_text())['rosbag2_bagfile_information']
    assert late['version'] == 9
    assert late['storage_identifier'] == 'mcap'
    assert late['message_count'] == 10
    assert late['starting_time']['nanoseconds_since_epoch'] == START
    assert late['duration']['nanoseconds'] == 9_000_000
    described = late['topics_with_message_count'][0]['topic_metadata']
    assert described['type_description_hash'].startswith('RIHS01_')


def test_no_run_is_overwritten(tmp_path: Path) -> None:
    RunWriter(tmp_path / 'run').close()
    with pytest.raises(RunExistsError, match=r'run exists already, and no recorded run'):
        RunWriter(tmp_path / 'run')


def test_a_disk_without_room_ends_it_with_everything_kept(tmp_path: Path, numbers: Topic) -> None:
    writer = RunWriter(tmp_path / 'run', min_free_space=1 << 60)
    writer.add_topic(numbers)
    fill(writer, 0, 10)
    with pytest.raises(DiskFullError, match='must stay free'):
        writer.commit()
    assert values_by_rosbags(tmp_path / 'run') == [float(k) for k in range(10)]


@pytest.mark.parametrize('commits', [1, 3, 20, 100])
def test_a_killed_writer_leaves_a_file_that_opens(commits: int, tmp_path: Path) -> None:
    folder = tmp_path / 'run'
    tests = Path(__file__).resolve().parents[1]
    with subprocess.Popen(
        [sys.executable, '-c', WRITER_CHILD, str(folder)],
        stdout=subprocess.PIPE,
        text=True,
        cwd=tests,
    ) as child:
        assert child.stdout is not None
        said = [int(child.stdout.readline()) for _ in range(commits)]
        child.send_signal(signal.SIGKILL)
        said += [int(line) for line in child.stdout if line.strip()]
    found = values_by_rosbags(folder)
    assert found == [float(k) for k in range(len(found))]
    assert len(found) >= said[-1]
    assert values_by_mcap(folder / 'run_0.mcap') == found
