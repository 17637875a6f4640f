"""`simulate` is killed while it writes as fast as it can: what is left opens in every reader."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader

from lathe_chatter.lathe import VirtualLathe
from lathe_chatter.recording import LatheRun, lathe_run_writer, read_run, verify

PATIENCE = 300.0
"""s."""


def test_what_is_made_is_committed_before_much_more_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A kill costs a quarter of a second of work, the time that a commit takes included."""
    now = [100.0]
    monkeypatch.setattr(lathe_run_writer, 'time', SimpleNamespace(
        monotonic=lambda: now[0], time_ns=time.time_ns
    ))  # fmt: skip
    lathe = VirtualLathe()
    run = LatheRun(tmp_path / 'run', {}, simulated=True)
    assert verify(tmp_path / 'run').messages == {'/parameter_events': 1}
    for _ in range(10):
        run.write(lathe.advance(500))
        now[0] += 0.03
    assert verify(tmp_path / 'run').messages['/lathe/samples'] >= 8
    run.close()


@pytest.mark.parametrize('size', [1 << 20, 5 << 20, 20 << 20])
def test_a_killed_simulation_opens_and_says_that_it_did_not_finish(
    size: int, tmp_path: Path
) -> None:
    run = tmp_path / 'amid'
    file = run / 'amid_0.mcap'
    command = [
        sys.executable, '-m', 'lathe_chatter.cli.main', 'simulate',
        '--output', str(run), '--duration', '6000',
    ]  # fmt: skip
    quiet = subprocess.DEVNULL
    with subprocess.Popen(command, stdout=quiet, stderr=quiet) as process:
        end = time.monotonic() + PATIENCE
        before = 0
        # At the moment at which the file grows: in the middle of a commit, or right after it.
        while before < size or file.stat().st_size == before:
            assert time.monotonic() < end
            before = file.stat().st_size if file.exists() else 0
            time.sleep(1e-4)  # a core is left to it
        process.send_signal(signal.SIGKILL)
        process.wait()
    with file.open('rb') as stream:
        by_mcap = sum(1 for _ in make_reader(stream, validate_crcs=True).iter_messages())
    with Reader(run) as reader:
        by_rosbags = sum(1 for _ in reader.messages())
    there = sum(1 for _ in read_run(run).raw_messages())
    assert by_mcap == by_rosbags == there > 0
    found = verify(run)
    assert not found.complete
    assert any('The recorder did not finish' in each.text for each in found.findings)
    samples = read_run(run).samples()
    assert samples.gaps == []
