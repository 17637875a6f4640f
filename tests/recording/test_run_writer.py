"""What RunWriter leaves on disk, read back by other people's readers."""

from __future__ import annotations

import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
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

from lathe_chatter.errors import DiskFullError, RunExistsError
from lathe_chatter.recording import (
    Finding,
    RunWriter,
    Topic,
    read_run,
    recover,
    split_file_writer,
    verify,
)
from lathe_chatter.recording.open_chunk import Compression

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


def test_metadata_is_renewed_while_it_is_recorded(
    tmp_path: Path, numbers: Topic, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(split_file_writer, '_RENEWAL_PERIOD', 0.0)
    with RunWriter(tmp_path / 'run') as writer:
        writer.add_topic(numbers)
        for k in range(3):
            fill(writer, 10 * k, 10 * (k + 1))
            writer.commit()
            while counted(tmp_path / 'run') != 10 * (k + 1):
                time.sleep(0.01)  # the disk is asked in the background


def test_verify_says_of_metadata_that_is_older_than_a_killed_run(
    tmp_path: Path, numbers: Topic
) -> None:
    with RunWriter(tmp_path / 'run') as writer:
        writer.note('lathe_chatter/made_by', {'lathe_chatter': '0'})
        writer.add_topic(numbers)
        fill(writer, 0, 10)
        writer.commit()
        fill(writer, 10, 30)
        writer.commit()
        said = [finding.text for finding in verify(tmp_path / 'run').findings]
        assert not [text for text in said if 'older' in text]  # it is being written
        shutil.copytree(tmp_path / 'run', tmp_path / 'killed')
    assert counted(tmp_path / 'killed') == 10
    assert verify(tmp_path / 'killed').findings[-1] == Finding(
        loss=False,
        text='metadata.yaml is older than the files: it counts 10 messages, and 30 are there. '
        '`lathe-chatter recover` makes a run in which it counts them all.',
    )
    recover(tmp_path / 'killed', tmp_path / 'saved')
    assert counted(tmp_path / 'saved') == 30


def counted(run: Path) -> int:
    described = yaml.safe_load((run / 'metadata.yaml').read_text())
    count: int = described['rosbag2_bagfile_information']['message_count']
    return count


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


@pytest.mark.parametrize('compression', [*Compression])
def test_every_compression_is_read_back(
    compression: Compression, tmp_path: Path, numbers: Topic
) -> None:
    with RunWriter(tmp_path / 'run', compression=compression) as writer:
        writer.add_topic(numbers)
        fill(writer, 0, 100)
    expected = [float(k) for k in range(100)]
    assert values_by_rosbags(tmp_path / 'run') == expected
    assert values_by_mcap(tmp_path / 'run' / 'run_0.mcap') == expected
    with (tmp_path / 'run' / 'run_0.mcap').open('rb') as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    name = '' if compression is Compression.NONE else compression.value
    assert {index.compression for index in summary.chunk_indexes} == {name}
    assert verify(tmp_path / 'run').complete


def test_a_type_that_changes_goes_on_in_a_channel_of_its_own(tmp_path: Path) -> None:
    flag = bytes(STORE.serialize_cdr(STORE.types[BOOL](data=True), BOOL))
    with RunWriter(tmp_path / 'run') as writer:
        writer.add_topic(topic('/x'))
        writer.write('/x', number(1.0), log_time=START, publish_time=START, sequence=1)
        writer.add_topic(topic('/x', BOOL))
        writer.write('/x', flag, log_time=START + 1, publish_time=START + 1, sequence=1)
        writer.split()
        writer.add_topic(topic('/x'))
        writer.write('/x', number(2.0), log_time=START + 2, publish_time=START + 2, sequence=2)
    found = [(raw.type, raw.data) for raw in read_run(tmp_path / 'run').raw_messages()]
    assert found == [(NUMBER, number(1.0)), (BOOL, flag), (NUMBER, number(2.0))]
    assert verify(tmp_path / 'run').complete


def test_files_after_a_split_begin_with_what_a_late_reader_would_get(tmp_path: Path) -> None:
    folder = tmp_path / 'run'
    with RunWriter(folder) as writer:
        writer.add_topic(replace(topic('/map'), repeated=2))
        writer.add_topic(topic('/numbers'))
        for k in range(3):
            stamp = START + k
            writer.write(
                '/map', number(10.0 * k), log_time=stamp, publish_time=stamp, sequence=k + 1
            )
        fill(writer, 0, 2)
        for _ in range(2):
            writer.split()
        fill(writer, 2, 4)
        repeated = dict(writer.repeated)
    assert repeated == {'/map': 4}
    for name in ('run_1.mcap', 'run_2.mcap'):
        with (folder / name).open('rb') as stream:
            found = [
                (channel.topic, STORE.deserialize_cdr(message.data, NUMBER).data)
                for _, channel, message in make_reader(stream).iter_messages()
            ]
        assert found[:2] == [('/map', 10.0), ('/map', 20.0)]
    assert verify(folder).complete
