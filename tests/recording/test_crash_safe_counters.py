"""A recorder that was killed: the record says how much of what it had taken is lost."""

from __future__ import annotations

import shutil
import signal
import struct
import subprocess
import sys
from pathlib import Path

import pytest
from support.recorded import number, topic

from lathe_chatter.recording import RunWriter, recover, verify
from lathe_chatter.recording.crash_safe_counters import FILE_NAME, UnfinishedCounts, taken

TESTS = Path(__file__).resolve().parents[1]
CHILD = """
import sys
from pathlib import Path
from support.recorded import number, topic
from lathe_chatter.recording import RunWriter
writer = RunWriter(Path(sys.argv[1]))
writer.add_topic(topic('/often'))
writer.add_topic(topic('/seldom'))
for k in range(120):
    writer.write('/often', number(k), log_time=10**18 + k * 10**7, publish_time=0, sequence=k + 1)
    if k % 40 == 0:
        writer.write('/seldom', number(k), log_time=10**18 + k * 10**7, publish_time=0)
    if k == 29:
        writer.split()
    if k == 49:
        writer.commit()
    if k == 100:
        writer.add_topic(topic('/late'))
        writer.write('/late', number(k), log_time=1, publish_time=0)
print('ready', flush=True)
sys.stdin.read()
"""


def test_a_kill_costs_what_verify_says(tmp_path: Path) -> None:
    run = tmp_path / 'run'
    with subprocess.Popen(
        [sys.executable, '-c', CHILD, str(run)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        cwd=TESTS,
    ) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == 'ready\n'
        child.send_signal(signal.SIGKILL)
    found = verify(run)
    assert found.messages == {'/often': 50, '/seldom': 2}
    said = [finding.text for finding in found.findings if finding.loss]
    assert said == [
        '/often: 70 messages that had come are not there, in the last 0.700 s.',
        '/seldom: 1 messages that had come are not there, in the last 0.400 s.',
        'a topic that is not there either: none of the 1 messages that had come are there.',
        'The recorder did not finish: what came at the end is not there.',
    ]
    saved = recover(run, tmp_path / 'saved')
    assert saved.damage == []
    assert saved.lost == said
    again = [finding.text for finding in verify(tmp_path / 'saved').findings]
    assert again[1:] == [f'Before the recovery: {text}' for text in saved.lost]


def test_what_is_recovered_of_a_whole_run_is_whole(tmp_path: Path) -> None:
    with RunWriter(tmp_path / 'run') as writer:
        writer.note('lathe_chatter/made_by', {'lathe_chatter': '0'})
        writer.add_topic(topic('/n'))
        writer.write('/n', number(1), log_time=7, publish_time=7, sequence=1)
    saved = recover(tmp_path / 'run', tmp_path / 'saved')
    assert saved.damage == saved.lost == []
    assert verify(tmp_path / 'saved').complete


def test_a_run_that_was_finished_has_no_counts(tmp_path: Path) -> None:
    with RunWriter(tmp_path / 'run') as writer:
        writer.add_topic(topic('/n'))
        writer.write('/n', number(1), log_time=7, publish_time=7)
        assert taken(tmp_path / 'run') == {1: (1, 7)}
    assert not (tmp_path / 'run' / FILE_NAME).exists()
    assert verify(tmp_path / 'run').findings == []


def test_the_counts_are_laid_out_as_the_format_of_a_run_says(tmp_path: Path) -> None:
    """docs/reference/run_format.md: others read it too."""
    counts = UnfinishedCounts(tmp_path)
    for channel, when in ((1, 7), (3, 10**18), (3, 10**18 + 1)):
        counts.count(channel, when)
    data = (tmp_path / FILE_NAME).read_bytes()
    assert len(data) == 65536
    assert data[:16] == b'lathe_chatter 1\n'
    entries = [*struct.iter_unpack('<QQ', data[16:])]
    assert len(entries) == 4095
    assert entries[:4] == [(0, 0), (1, 7), (0, 0), (2, 10**18 + 1)]
    assert set(entries[4:]) == {(0, 0)}
    counts.close(finished=False)


@pytest.mark.parametrize('data', [b'', b'what', bytes(1 << 16)])
def test_counts_that_are_damaged_tell_nothing(data: bytes, tmp_path: Path) -> None:
    writer = RunWriter(tmp_path / 'run')
    writer.note('lathe_chatter/made_by', {'lathe_chatter': '0'})
    writer.abandon()
    (tmp_path / 'run' / FILE_NAME).write_bytes(data)
    (finding,) = verify(tmp_path / 'run').findings
    assert finding.text == 'The recorder did not finish: what came at the end is not there.'


def test_where_counts_cannot_be_kept_nothing_else_fails(tmp_path: Path) -> None:
    (tmp_path / FILE_NAME).write_bytes(b'of another')
    counts = UnfinishedCounts(tmp_path)
    counts.count(1, 7)
    counts.close(finished=True)
    assert (tmp_path / FILE_NAME).read_bytes() == b'of another'


def test_channels_beyond_the_page_are_not_counted(tmp_path: Path) -> None:
    counts = UnfinishedCounts(tmp_path)
    for channel in (0, 1, 4094, 4095, 65535):
        counts.count(channel, 5)
    assert set(taken(tmp_path)) == {0, 1, 4094}


def test_a_file_cut_off_amid_a_write_accuses_no_topic_of_being_absent(tmp_path: Path) -> None:
    writer = RunWriter(tmp_path / 'run')
    writer.add_topic(topic('/numbers'))
    writer.add_topic(topic('/others'))
    for k in range(1, 41):
        for name in ('/numbers', '/others'):
            writer.write(name, number(k), log_time=k, publish_time=k, sequence=k)
        if k % 10 == 0:
            writer.commit()
    shutil.copytree(tmp_path / 'run', tmp_path / 'killed')
    writer.close()
    (file,) = (tmp_path / 'killed').glob('*.mcap')
    file.write_bytes(file.read_bytes()[:-60])
    for found in (
        [finding.text for finding in verify(tmp_path / 'killed').findings],
        recover(tmp_path / 'killed', tmp_path / 'saved').lost,
    ):
        assert any(
            'The recorder did not finish: all that it had taken is there' in t for t in found
        )
        assert not [text for text in found if 'that had come' in text]
