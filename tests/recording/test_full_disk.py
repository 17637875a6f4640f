"""A disk that takes no more: the run ends with its last good state, whole."""

from __future__ import annotations

import resource
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from support.recorded import STORE, topic

from lathe_chatter.recording import RunWriter, read_run, verify

ARRAY = 'std_msgs/msg/Float64MultiArray'
START = 1_700_000_000_000_000_000


def message(k: int) -> bytes:
    """Some 8 kB that do not compress."""
    layout = STORE.types['std_msgs/msg/MultiArrayLayout'](dim=[], data_offset=0)
    data = np.random.default_rng(k).standard_normal(1000)
    return bytes(STORE.serialize_cdr(STORE.types[ARRAY](layout=layout, data=data), ARRAY))


def fill(folder: Path) -> tuple[RunWriter, int]:
    """Write until the disk refuses: the writer, and how many messages were committed."""
    writer = RunWriter(folder)
    writer.add_topic(topic('/noise', ARRAY))
    for k in range(10_000):
        time = START + k
        writer.write('/noise', message(k), log_time=time, publish_time=time, sequence=k + 1)
        if k % 7 == 6:
            try:
                writer.commit()
            except OSError:
                return writer, k - 6
    raise AssertionError('the disk never was full')


def check(folder: Path, committed: int) -> None:
    """The last commit, as mcap and our reader find it."""
    with (folder / f'{folder.name}_0.mcap').open('rb') as stream:
        found = [m.data for _, _, m in make_reader(stream, validate_crcs=True).iter_messages()]
    assert len(found) == committed > 0
    assert found == [message(k) for k in range(committed)]
    assert len(list(read_run(folder).raw_messages('/noise'))) == committed


@pytest.fixture
def small_files() -> Iterator[None]:
    """The system refuses files of more than 300 kB, in the middle of a write."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, hard))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.usefixtures('small_files')
def test_a_write_that_is_refused_half_way_leaves_the_commit_before(tmp_path: Path) -> None:
    writer, committed = fill(tmp_path / 'run')
    check(tmp_path / 'run', committed)
    writer.abandon()
    check(tmp_path / 'run', committed)
    metadata = (tmp_path / 'run' / 'metadata.yaml').read_text()
    assert f'message_count: {committed}' in metadata


def test_a_full_disk_leaves_the_commit_before(small_disk: Path) -> None:
    writer, committed = fill(small_disk / 'run')
    writer.abandon()
    check(small_disk / 'run', committed)
    losses = [finding.text for finding in verify(small_disk / 'run').findings if finding.loss]
    assert losses == [
        '/noise: 7 messages that had come are not there, in the last 0.000 s.',
        'The recorder did not finish: what came at the end is not there.',
    ]


def test_a_disk_with_room_again_takes_what_waited(tmp_path: Path) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, hard))
    try:
        writer, committed = fill(tmp_path / 'run')
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    writer.close()
    check(tmp_path / 'run', committed + 7)
