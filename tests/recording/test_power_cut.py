"""A loss of power: what the disk had then, as the copy of a disk image, opens again."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from rosbags.rosbag2 import Reader, ReaderError
from support.recorded import NUMBER, STORE

from lathe_chatter.recording import read_run, recover

CHILD = """
import sys, time
from pathlib import Path
from support.recorded import number, topic
from lathe_chatter.recording import RunWriter
writer = RunWriter(Path(sys.argv[1]))
writer.add_topic(topic('/numbers'))
k = 0
while True:
    for _ in range(10):
        writer.write('/numbers', number(float(k)), log_time=k, publish_time=k, sequence=k + 1)
        k += 1
    writer.commit_soon()
    print(writer.safe_messages, flush=True)
    time.sleep(0.01)
"""


@contextmanager
def mounted(image: Path, place: Path) -> Iterator[Path]:
    place.mkdir()
    command = ['mount', '-o', 'loop', str(image), str(place)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip(f'no image can be mounted: {done.stderr.strip()}')
    try:
        yield place
    finally:
        subprocess.run(['umount', str(place)], check=True)


@pytest.fixture
def image(tmp_path: Path) -> Path:
    """A disk of 16 MB."""
    if os.geteuid() != 0:
        pytest.skip('only root can mount a disk image')
    file = tmp_path / 'disk.img'
    with file.open('wb') as stream:
        stream.truncate(16 << 20)
    try:
        subprocess.run(['mkfs.ext4', '-q', str(file)], check=True)
    except FileNotFoundError:
        pytest.skip('mkfs.ext4 is not installed')
    return file


@pytest.fixture
def writer() -> Iterator[Callable[[Path], subprocess.Popen[str]]]:
    started: list[subprocess.Popen[str]] = []

    def start(folder: Path) -> subprocess.Popen[str]:
        tests = Path(__file__).resolve().parents[1]
        command = [sys.executable, '-c', CHILD, str(folder)]
        started.append(subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=tests))
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.communicate()


def still(process: subprocess.Popen[str]) -> None:
    """Stop every thread, also one that waits for the disk."""
    process.send_signal(signal.SIGSTOP)
    tasks = Path(f'/proc/{process.pid}/task')
    while any(
        task.joinpath('stat').read_text().rpartition(')')[2].split()[0] != 'T'
        for task in tasks.iterdir()
    ):
        os.sched_yield()


def numbers(run: Path) -> list[float]:
    with Reader(run) as reader:
        return [STORE.deserialize_cdr(data, NUMBER).data for *_, data in reader.messages()]


def test_what_was_said_to_be_safe_is_there_after_a_loss_of_power(
    image: Path, writer: Callable[[Path], subprocess.Popen[str]], tmp_path: Path
) -> None:
    copies: list[tuple[Path, int]] = []
    with mounted(image, tmp_path / 'disk') as disk:
        process = writer(disk / 'run')
        assert process.stdout is not None
        safe = 0
        for number in range(4):
            wanted = safe + 100
            while safe < wanted:
                safe = int(process.stdout.readline())
            still(process)
            copy = tmp_path / f'copy{number}.img'
            copy.write_bytes(image.read_bytes())
            copies.append((copy, safe))
            process.send_signal(signal.SIGCONT)
        process.kill()
        process.wait()
    for copy, safe in copies:
        with mounted(copy, tmp_path / copy.stem) as disk:
            run = disk / 'run'
            try:
                found = numbers(run)
            except ReaderError:  # the power went amid a sync
                run = tmp_path / f'recovered {copy.stem}'
                recover(disk / 'run', run)
                found = numbers(run)
            assert found == [float(k) for k in range(len(found))]
            assert len(found) >= safe
            assert len(list(read_run(run).raw_messages('/numbers'))) == len(found)
