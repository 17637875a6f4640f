"""A run is read while its writer goes on: what was committed by then is there, and is sound."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from support.recorded import number, topic

from lathe_chatter.cli.main import main
from lathe_chatter.recording import RunWriter, read_run, recover, verify

TESTS = Path(__file__).resolve().parents[1]
LOOKS = 40
WRITER = """
import sys
import time
from itertools import count
from pathlib import Path
from support.recorded import topic
from lathe_chatter.recording import RunWriter
import numpy as np
noise = np.random.default_rng(1).bytes(1 << 20)  # that no compression makes smaller
writer = RunWriter(Path(sys.argv[1]), split_size=2e7)
writer.note('lathe_chatter/made_by', {'lathe_chatter': '0'})
writer.add_topic(topic('/numbers', 'std_msgs/msg/String'))
k = 0
for commit in count(1):
    for _ in range(1 + 20 * (commit % 9 == 0)):  # now and then a commit is a large one
        size = 40 + (k % 7) * 4000
        data = k.to_bytes(8, 'little') + noise[k % 1000 : k % 1000 + size]
        k += 1
        writer.write('/numbers', data, log_time=k, publish_time=k, sequence=k)
    writer.commit()
    time.sleep(0.01)
    if commit == 1:
        print('begun', flush=True)
"""


@contextmanager
def being_written(run: Path) -> Iterator[None]:
    command = [sys.executable, '-c', WRITER, str(run)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=TESTS) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == 'begun\n'
        try:
            yield
        finally:
            child.kill()


def test_a_run_that_grows_is_sound_at_every_look(tmp_path: Path) -> None:
    before, first = 0, math.inf
    with being_written(tmp_path / 'run'):
        for _ in range(LOOKS):
            run = read_run(tmp_path / 'run')
            assert set(run.topics) == {'/numbers'}
            said = run.count_of_messages()
            found = [int.from_bytes(raw.data[:8], 'little') for raw in run.raw_messages()]
            assert found == list(range(said))
            assert said >= before
            before, first = said, min(first, said)
    assert before > first  # it did grow


def test_verify_says_of_a_run_that_grows_that_it_does(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with being_written(tmp_path / 'run'):
        for _ in range(LOOKS // 3):
            found = verify(tmp_path / 'run')
            assert [finding.text for finding in found.findings] == [
                'The run is still being recorded: this is what is on disk of it.'
            ]
            assert not found.complete
            assert not found.lossy
        capsys.readouterr()
        assert main(['verify', str(tmp_path / 'run')]) == 3
        said = capsys.readouterr().out
        assert 'UNSURE The run is still being recorded' in said
        assert 'not complete yet: nothing is missing so far' in said
        assert 'WRONG' not in said
    assert main(['verify', str(tmp_path / 'run')]) == 1
    found = verify(tmp_path / 'run')
    said = [finding.text for finding in found.findings if finding.loss]
    assert 'The recorder did not finish' in said[-1]


def test_what_is_saved_of_a_run_that_grows_is_whole_so_far(tmp_path: Path) -> None:
    with being_written(tmp_path / 'run'):
        for k in range(10):
            saved = recover(tmp_path / 'run', tmp_path / f'saved{k}')
            assert saved.damage == []
            assert saved.lost == [
                'The run is still being recorded: this is what is on disk of it.'
            ]


def test_a_run_that_was_closed_is_not_being_recorded(tmp_path: Path) -> None:
    with RunWriter(tmp_path / 'run') as writer:
        writer.note('lathe_chatter/made_by', {'lathe_chatter': '0'})
        writer.add_topic(topic('/numbers'))
        writer.write('/numbers', number(1.0), log_time=7, publish_time=7, sequence=1)
        writer.commit()
        assert not verify(tmp_path / 'run').complete
    assert verify(tmp_path / 'run').complete
