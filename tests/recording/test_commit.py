"""A kill in the middle of a commit: whatever call is the last, the file opens in every reader."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import Footer
from mcap.stream_reader import StreamReader
from rosbags.rosbag2 import Reader
from support.recorded import topic

from lathe_chatter.recording import RunWriter, mcap_writer, read_run

PAGE = 4096
BLOCK = np.random.default_rng(1).bytes(100_000)
"""That no compression makes smaller."""


class _Killed(BaseException):
    """Nothing of the process goes on after this."""


def counts(folder: Path) -> set[int]:
    """How many messages each reader finds."""
    with (folder / 'run_0.mcap').open('rb') as stream:
        by_mcap = sum(1 for _ in make_reader(stream).iter_messages())
    with Reader(folder) as reader:
        by_rosbags = sum(1 for _ in reader.messages())
    # Some read it as a stream: chunks, the end of the data, a summary, and the end of the file.
    with (folder / 'run_0.mcap').open('rb') as stream:
        records = [*StreamReader(stream).records]
    assert isinstance(records[-1], Footer)
    return {by_mcap, by_rosbags, len(list(read_run(folder).raw_messages()))}


@pytest.mark.parametrize('blocks', [1, 20])
@pytest.mark.parametrize('written', [0.0, 0.3, 1.0])
def test_a_kill_within_any_call_leaves_the_commit_before_or_this_one(
    written: float, blocks: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The system stops between two pages: of a call that is killed, some pages are there."""
    calls: list[str] = []

    def leave_off(at: int) -> Path:
        folder = tmp_path / f'{at}' / 'run'
        writer = RunWriter(folder)
        writer.add_topic(topic('/numbers', 'std_msgs/msg/String'))
        for k in range(3):
            writer.write('/numbers', BLOCK, log_time=k + 1, publish_time=k + 1)
        writer.commit()
        for k in range(blocks):
            writer.write('/numbers', BLOCK, log_time=k + 4, publish_time=k + 4)
        calls.clear()
        real_write, real_truncate = os.pwrite, os.ftruncate

        def pwrite(descriptor: int, data: memoryview, offset: int) -> int:
            calls.append('pwrite')
            if len(calls) == at + 1:
                pages = int(written * len(data)) // PAGE * PAGE
                real_write(descriptor, data[: pages if written < 1.0 else len(data)], offset)
            if len(calls) > at:
                raise _Killed
            return real_write(descriptor, data, offset)

        def ftruncate(descriptor: int, size: int) -> None:
            calls.append('ftruncate')
            if len(calls) > at:
                raise _Killed
            real_truncate(descriptor, size)

        with monkeypatch.context() as patch:
            patch.setattr(mcap_writer.os, 'pwrite', pwrite)
            patch.setattr(mcap_writer.os, 'ftruncate', ftruncate)
            with contextlib.suppress(_Killed):
                writer.commit()
        return folder

    found = [counts(leave_off(at)) for at in range(9)]
    # Before the end is cut off it leads to the commit before, for every reader.
    assert found == [{3}] * 7 + [{3 + blocks}] * 2
    assert calls == ['pwrite'] * 6 + ['ftruncate']
