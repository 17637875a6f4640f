"""What sudden ends cost: the recorder killed, the machine without power, the disk full."""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader
from rosbags.rosbag2.errors import ReaderError
from runs import PER_COMMIT, START, TICK, blocks, samples_topic, scratch

from lathe_chatter.recording import RunWriter, recover, verify
from lathe_chatter.recording.provenance import IDENTITY, identity

_LOST = re.compile(r'^/lathe/samples: (\d+) messages that had come are not there')
_TESTS = Path(__file__).parents[2] / 'tests' / 'recording'
_CORE = ('@mcap/core@2.2.2', '@mcap/support@1.1.0')
_IMAGE = 64 << 20


def record_for_ever(run: str) -> None:
    """Record 500 messages a second until killed, saying the last number that was written."""
    writer = RunWriter(Path(run))
    writer.note(IDENTITY, identity())
    writer.add_topic(samples_topic())
    began = time.monotonic()
    for k, data in enumerate(blocks(1 << 30)):
        told = START + k * TICK
        writer.write('/lathe/samples', data, log_time=told, publish_time=told, sequence=k + 1)
        if k % PER_COMMIT == PER_COMMIT - 1:
            writer.commit_soon()
        os.write(1, (k + 1).to_bytes(8, 'little'))
        time.sleep(max(began + (k + 1) * TICK / 1e9 - time.monotonic(), 0.0))


class _Recorder:
    """A process that records for ever, and how far it got."""

    def __init__(self, run: Path) -> None:
        package = str(Path(__file__).parent)
        self.process = subprocess.Popen(  # noqa: S603 -- ourselves
            [sys.executable, package, '--record', str(run)], stdout=subprocess.PIPE
        )
        assert self.process.stdout is not None  # noqa: S101 -- for the types
        self._out = self.process.stdout
        self._said = self._out.read(8)

    def written(self) -> int:
        """The number of the last message, of a process that stands still."""
        os.set_blocking(self._out.fileno(), False)
        while more := self._out.read(1 << 16):
            self._said = (self._said + more)[-8:]
        return int.from_bytes(self._said, 'little')

    def kill(self) -> int:
        """Kill it; the number of the last message that it had written."""
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()
        return self.written()


def kills(count: int) -> None:
    """What a kill at a random instant costs, and whether verify says just that."""
    generator = np.random.default_rng()
    lost: list[float] = []
    refused, off = 0, 0
    files: list[Path] = []
    expected: list[int] = []
    with scratch() as place:
        for number in range(count):
            run = place / f'run{number}'
            recorder = _Recorder(run)
            time.sleep(float(generator.uniform(0.3, 1.5)))
            written = recorder.kill()
            try:
                there, said = count_by_verify(run)
                found = {count_by_mcap(run), count_by_rosbags(run), there}
            except Exception as error:  # noqa: BLE001 -- whatever a reader raises is a refusal
                refused += 1
                print(f'kills: {run.name} was refused: {error}')
                continue
            assert len(found) == 1  # noqa: S101 -- all readers read the same
            files.append(run / f'{run.name}_0.mcap')
            expected.append(there)
            lost.append((written - there) * TICK / 1e9)
            # Between its record of a message and its word to us it may have been killed.
            off += said - (written - there) not in (0, 1)
        core = by_mcap_core(place, files, expected)
    print(
        f'kills: {count - refused} of {count} files open in mcap and rosbags, {core}; lost at '
        f'most {max(lost):.3f} s (goal 0.5), {np.median(lost):.3f} s in the median; verify says '
        f'how many messages in {len(lost) - off} of {len(lost)}'
    )


def by_mcap_core(place: Path, files: list[Path], expected: list[int]) -> str:
    """Whether the reader of Foxglove's viewers finds the same, by index and as a stream."""
    node, npm = shutil.which('node'), shutil.which('npm')
    if node is None or npm is None:
        return '@mcap/core not tried: there is no node'
    script = shutil.copy(_TESTS / 'read_with_mcap_core.mjs', place)
    install = [npm, 'install', '--no-audit', '--no-fund', '--prefix', str(place), *_CORE]
    if subprocess.run(install, check=False, capture_output=True).returncode:  # noqa: S603 -- npm
        return '@mcap/core not tried: npm could not install it'
    done = subprocess.run(  # noqa: S603 -- our script
        [node, script, *map(str, files)], check=False, capture_output=True, text=True
    )
    if done.returncode:
        return f'@mcap/core refused: {done.stderr.strip().splitlines()[-1]}'
    found = json.loads(done.stdout)
    same = sum(each == {'indexed': n, 'streamed': n} for each, n in zip(found, expected))  # noqa: B905 -- of one length
    return f'{same} in @mcap/core'


def count_by_mcap(run: Path) -> int:
    """Messages that mcap finds by the index."""
    with (run / f'{run.name}_0.mcap').open('rb') as stream:
        return sum(1 for _ in make_reader(stream, validate_crcs=True).iter_messages())


def count_by_rosbags(run: Path) -> int:
    """Messages that rosbags finds."""
    with Reader(run) as reader:
        return sum(1 for _ in reader.messages())


def count_by_verify(run: Path) -> tuple[int, int]:
    """Messages that verify finds in a run that was not finished, and that it misses."""
    found = verify(run)
    assert not found.complete  # noqa: S101 -- it was killed
    matches = [_LOST.match(finding.text) for finding in found.findings]
    said = sum(int(match[1]) for match in matches if match)
    return found.messages['/lathe/samples'], said


@contextlib.contextmanager
def _mounted(place: Path, *options: str) -> Iterator[Path]:
    place.mkdir()
    subprocess.run(['mount', *options, str(place)], check=True)  # noqa: S603, S607 -- by root
    try:
        yield place
    finally:
        subprocess.run(['umount', '-l', str(place)], check=True)  # noqa: S603, S607 -- by root


def power(cuts: int) -> None:
    """What a loss of power costs: copies of the image of a disk that is being written to."""
    if os.geteuid():
        print('power: only root can mount the image of a disk')
        return
    generator = np.random.default_rng()
    copies: list[tuple[Path, int]] = []
    lost: list[float] = []
    with scratch() as place:
        image = place / 'disk.img'
        with image.open('wb') as stream:
            stream.truncate(_IMAGE)
        subprocess.run(['mkfs.ext4', '-q', str(image)], check=True)  # noqa: S603, S607 -- by root
        with _mounted(place / 'disk', '-o', 'loop', str(image)) as disk:
            recorder = _Recorder(disk / 'run')
            for number in range(cuts):
                time.sleep(float(generator.uniform(0.5, 2.0)))
                # The disk as it is at this instant; who writes must not go on while it is copied.
                recorder.process.send_signal(signal.SIGSTOP)
                copy = Path(shutil.copy(image, place / f'copy{number}.img'))
                copies.append((copy, recorder.written()))
                recorder.process.send_signal(signal.SIGCONT)
            recorder.kill()
        opened = 0
        for copy, written in copies:
            with _mounted(place / copy.stem, '-o', 'loop', str(copy)) as disk:
                try:
                    found = count_by_rosbags(disk / 'run')
                    opened += 1
                except ReaderError:
                    # Amid a sync: a new chunk stands where the end was, and there is no new end.
                    saved = recover(disk / 'run', place / f'saved{len(lost)}')
                    found = saved.messages['/lathe/samples']
                lost.append((written - found) * TICK / 1e9)
    print(
        f'power: {opened} of {cuts} copies of the disk open in rosbags, the others after recover; '
        f'lost at most {max(lost):.3f} s (goal 1), {np.median(lost):.3f} s in the median'
    )


def disk() -> None:
    """What a disk that fills up leaves."""
    if os.geteuid():
        print('disk: only root can mount a small disk')
        return
    with scratch() as place, _mounted(place / 'd', '-t', 'tmpfs', '-o', 'size=4m', 'tmpfs') as d:
        writer = RunWriter(d / 'run')
        writer.add_topic(samples_topic())
        committed = written = 0
        sent = []
        try:
            for k, data in enumerate(blocks(100_000)):
                told = START + k * TICK
                writer.write('/lathe/samples', data, log_time=told, publish_time=told)
                sent.append(data)
                written += 1
                if k % PER_COMMIT == PER_COMMIT - 1:
                    writer.commit()
                    committed = written
        except OSError as error:
            reason = error.strerror
        writer.abandon()
        with (d / 'run' / 'run_0.mcap').open('rb') as stream:
            messages = make_reader(stream, validate_crcs=True).iter_messages()
            found = [message.data for _, _, message in messages]
        there, said = count_by_verify(d / 'run')
    print(
        f'disk: "{reason}" after {written} messages; {len(found)} are there, of {committed} that '
        f'were committed, every byte as it was: {found == sent[:committed]}; verify finds '
        f'{there} and says that {said} are lost'
    )
