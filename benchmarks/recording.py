"""The recording's figures on this machine: writing, reading, kills, a stalled recorder.

    python benchmarks/recording.py [--kills 50] [--seconds 60] [writing] [reading] [kills] [stalls]

Everything is written to and read from the folder for temporary files. `stalls` runs the real
lathe and the real recorder, which is stopped for 0.3 s in every second.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import platform
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

from lathe_chatter.model import SAMPLE_COLUMNS, Array
from lathe_chatter.recording import RunWriter, Topic, read_run, verify
from lathe_chatter.recording.identity import IDENTITY, identity

STORE = get_typestore(Stores.ROS2_JAZZY)
ARRAY = 'std_msgs/msg/Float64MultiArray'
START = 1_700_000_000_000_000_000
TICK = 2_000_000
"""ns, of a lathe of 500 ticks a second."""
PER_COMMIT = 125
"""Ticks in 0.25 s."""


def samples_topic(name: str = '/lathe/samples') -> Topic:
    """The topic of a lathe's samples."""
    definition, _ = STORE.generate_msgdef(ARRAY, ros_version=2)
    return Topic(name, ARRAY, definition, STORE.hash_rihs01(ARRAY))


def block(samples: Array) -> bytes:
    """A block of samples as a lathe sends it."""
    rows, width = samples.shape
    dim = STORE.types['std_msgs/msg/MultiArrayDimension']
    layout = STORE.types['std_msgs/msg/MultiArrayLayout'](
        dim=[
            dim(label='sample', size=rows, stride=rows * width),
            dim(label=','.join(SAMPLE_COLUMNS), size=width, stride=width),
        ],
        data_offset=0,
    )
    message = STORE.types[ARRAY](layout=layout, data=samples.ravel())
    return bytes(STORE.serialize_cdr(message, ARRAY))


def blocks(count: int) -> Iterator[bytes]:
    """Blocks of 20 samples of noise, which do not compress, with times that go on."""
    generator = np.random.default_rng(0)
    frame = bytearray(block(np.zeros((20, len(SAMPLE_COLUMNS)))))
    for k in range(count):
        samples = generator.standard_normal((20, len(SAMPLE_COLUMNS)))
        samples[:, 0] = (np.arange(1, 21) + 20 * k) / 1e4
        frame[-samples.nbytes :] = samples.tobytes()
        yield bytes(frame)


@contextlib.contextmanager
def scratch() -> Iterator[Path]:
    """A folder for one measurement."""
    place = Path(tempfile.mkdtemp(prefix='lathe-chatter-recording-'))
    try:
        yield place
    finally:
        shutil.rmtree(place)


def measure_writing() -> None:
    """Messages a second, and how long a commit holds the producer up, in a file of 300 s."""
    with scratch() as place:
        ready = [bytes(1000)] * 1000
        began = time.perf_counter()
        with RunWriter(place / 'fast') as writer:
            writer.add_topic(samples_topic('/a'))
            for k in range(300_000):
                writer.write('/a', ready[k % 1000], log_time=START + k, publish_time=START)
                if k % 25_000 == 0:
                    writer.commit_soon()
        rate = 300_000 / (time.perf_counter() - began)
        print(f'writing: {rate / 1e3:.0f} thousand messages of 1 kB a second')
        held: list[float] = []
        with RunWriter(place / 'held') as writer:
            writer.add_topic(samples_topic())
            for k, data in enumerate(blocks(1200 * PER_COMMIT)):
                began = time.perf_counter()
                told = START + k * TICK
                writer.write('/lathe/samples', data, log_time=told, publish_time=told)
                if k % PER_COMMIT == PER_COMMIT - 1:
                    writer.commit_soon()
                held.append(time.perf_counter() - began)
        times = 1e3 * np.array(held)
        commits = times[PER_COMMIT - 1 :: PER_COMMIT]
        print(
            f'writing: a message holds its producer up {np.quantile(times, 0.999):.2f} ms at '
            f'p99.9; a commit {np.median(commits):.2f} ms at p50, '
            f'{np.quantile(commits, 0.999):.2f} ms at p99.9 over 1200 commits'
        )


def measure_reading() -> None:
    """Time and memory of reading 10 million samples, each in a process of its own."""
    with scratch() as place:
        with RunWriter(place / 'run', split_duration=300.0) as writer:
            writer.add_topic(samples_topic())
            for k, data in enumerate(blocks(500_000)):
                told = START + k * TICK
                writer.write('/lathe/samples', data, log_time=told, publish_time=told)
                if k % PER_COMMIT == PER_COMMIT - 1:
                    writer.commit_soon()
        for columns in ('tool_displacement', ','.join(SAMPLE_COLUMNS)):
            child = [sys.executable, __file__, '--read', str(place / 'run'), columns]
            subprocess.run(child, check=True)  # noqa: S603 -- ourselves


def read_here(run: str, columns: str) -> None:
    """Read columns of a run, and say what it took."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    began, busy = time.perf_counter(), time.process_time()
    found = read_run(run).samples(columns=columns.split(','))
    taken, busy = time.perf_counter() - began, time.process_time() - busy
    memory = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1e6
    size = len(next(iter(found.columns.values())))
    print(
        f'reading: {size / 1e6:.0f} million samples, {len(found.columns)} columns, in '
        f'{taken:.2f} s ({busy:.2f} s of processor time) with '
        f'{memory:.2f} GB more than before, gaps {len(found.gaps)}'
    )


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


def measure_kills(kills: int) -> None:
    """What a kill at a random instant costs."""
    generator = np.random.default_rng()
    lost: list[float] = []
    refused = 0
    with scratch() as place:
        for number in range(kills):
            run = place / f'run{number}'
            child = subprocess.Popen(  # noqa: S603 -- ourselves
                [sys.executable, __file__, '--record', str(run)], stdout=subprocess.PIPE
            )
            assert child.stdout is not None  # noqa: S101 -- for the types
            said = child.stdout.read(8)
            time.sleep(float(generator.uniform(0.3, 1.5)))
            child.send_signal(signal.SIGKILL)
            said = (said + child.stdout.read())[-8:]
            child.wait()
            written = int.from_bytes(said, 'little')
            try:
                found = {count_by_mcap(run), count_by_rosbags(run), count_by_verify(run)}
            except Exception as error:  # noqa: BLE001 -- whatever a reader raises is a refusal
                refused += 1
                print(f'kills: {run.name} was refused: {error}')
                continue
            assert len(found) == 1  # noqa: S101 -- all readers read the same
            lost.append((written - found.pop()) * TICK / 1e9)
    print(
        f'kills: {kills - refused} of {kills} files open in mcap and rosbags, and verify '
        f'counts the same; lost at most {max(lost):.3f} s, {np.median(lost):.3f} s in the median'
    )


def count_by_mcap(run: Path) -> int:
    """Messages that mcap finds by the index."""
    with (run / f'{run.name}_0.mcap').open('rb') as stream:
        return sum(1 for _ in make_reader(stream, validate_crcs=True).iter_messages())


def count_by_rosbags(run: Path) -> int:
    """Messages that rosbags finds."""
    with Reader(run) as reader:
        return sum(1 for _ in reader.messages())


def count_by_verify(run: Path) -> int:
    """Messages that verify finds in a run that, as it must say, was not finished."""
    found = verify(run)
    assert not found.complete  # noqa: S101 -- it was killed
    return found.messages['/lathe/samples']


def seconds_of(process: subprocess.Popen[bytes]) -> float:
    """Processor time that a process has had, s."""
    fields = Path(f'/proc/{process.pid}/stat').read_text(encoding='ascii').rpartition(')')[2]
    return sum(map(int, fields.split()[11:13])) / os.sysconf('SC_CLK_TCK')


def measure_stalls(seconds: float) -> None:
    """What is lost when the recorder stands still 0.3 s in every second."""
    import domain_coordinator

    with scratch() as place, domain_coordinator.domain_id() as domain:
        environment = {
            **os.environ,
            'ROS_DOMAIN_ID': str(domain),
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        }

        def node(module: str, *parameters: str) -> subprocess.Popen[bytes]:
            words = [word for parameter in parameters for word in ('-p', parameter)]
            return subprocess.Popen(  # noqa: S603 -- our own modules
                [sys.executable, '-m', f'lathe_chatter.nodes.{module}', '--ros-args', *words],
                env=environment,
                stderr=subprocess.DEVNULL,
            )

        run = place / 'run'
        recorder = node('recorder_node', f'output:={run}')
        others = [node('monitor_node'), node('lathe_node')]
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            time.sleep(0.7)
            recorder.send_signal(signal.SIGSTOP)
            time.sleep(0.3)
            recorder.send_signal(signal.SIGCONT)
        busy = seconds_of(recorder) / seconds
        for process in (*others[::-1], recorder):
            process.send_signal(signal.SIGINT)
            process.wait(60)
        found = verify(run)
        count = found.samples['/lathe/samples']
        print(
            f'stalls: {sum(found.messages.values())} messages and {count.samples} samples in '
            f'{seconds:.0f} s; complete: {found.complete}; recorder {100 * busy:.0f} % of a core, '
            'its start included'
        )
        for finding in found.findings:
            print(f'stalls: {finding.text}')


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])  # type: ignore[union-attr]  # it is above
    parser.add_argument('--kills', type=int, default=50, help='how many')
    parser.add_argument('--seconds', type=float, default=60.0, help='of the stalls')
    parser.add_argument('--record', help=argparse.SUPPRESS)
    parser.add_argument('--read', nargs=2, help=argparse.SUPPRESS)
    parser.add_argument('figures', nargs='*', metavar='figure')
    options = parser.parse_args(arguments)
    if options.record:
        record_for_ever(options.record)
        return
    if options.read:
        read_here(*options.read)
        return
    figures: dict[str, Callable[[], Any]] = {
        'writing': measure_writing,
        'reading': measure_reading,
        'kills': lambda: measure_kills(options.kills),
        'stalls': lambda: measure_stalls(options.seconds),
    }
    unknown = set(options.figures) - set(figures)
    if unknown:
        parser.error(f'no such figure: {", ".join(sorted(unknown))}')
    print(f'{os.cpu_count()} cores, {platform.release()}, Python {platform.python_version()}')
    for name in options.figures or figures:
        figures[name]()


if __name__ == '__main__':
    main()
