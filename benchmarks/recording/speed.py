"""How fast a run is written and read, in the process that has the samples or wants them."""

from __future__ import annotations

import re
import resource
import statistics
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore
from runs import PER_COMMIT, START, TICK, blocks, samples_topic, scratch

from lathe_chatter.recording import RunWriter, read_run
from lathe_chatter.samples import SAMPLE_COLUMNS
from lathe_chatter.samples.codec import SAMPLES_TYPE
from lathe_chatter.scenario import Scenario
from lathe_chatter.scenario.simulation import simulate

_TIMES = 7
"""That a run is read."""


def writing() -> None:
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


def reading() -> None:
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
            child = [
                sys.executable,
                str(Path(__file__).parent),
                '--read',
                str(place / 'run'),
                columns,
            ]
            subprocess.run(child, check=True)  # noqa: S603 -- ourselves
        _read_by_others(place / 'run')


def _read_by_others(run: Path) -> None:
    """One column of the same run by the libraries that read bags, each as its manual has it."""
    column, store = SAMPLE_COLUMNS.index('tool_displacement'), get_typestore(Stores.ROS2_JAZZY)

    def by_rosbags() -> int:
        with Reader(run) as reader:
            parts = [
                store.deserialize_cdr(data, SAMPLES_TYPE).data.reshape(-1, len(SAMPLE_COLUMNS))[
                    :, column
                ]
                for _, _, data in reader.messages()
            ]
        return len(np.concatenate(parts))

    def by_mcap() -> int:
        size = 20 * len(SAMPLE_COLUMNS)
        parts = []
        for file in sorted(run.glob('*.mcap')):
            with file.open('rb') as stream:
                for _, _, message in make_reader(stream).iter_messages():
                    numbers = np.frombuffer(message.data[-8 * size :])  # the end of the payload
                    parts.append(numbers[column :: len(SAMPLE_COLUMNS)])
        return len(np.concatenate(parts))

    for name, read in (('rosbags', by_rosbags), ('mcap, payload cut by hand', by_mcap)):
        began, busy = time.perf_counter(), time.process_time()
        count = read()
        print(
            f'reading: {count / 1e6:.0f} million samples, 1 column, by {name} in '
            f'{time.perf_counter() - began:.2f} s ({time.process_time() - busy:.2f} s of '
            'processor time)'
        )


def report(seconds: float) -> None:
    """Time and memory of the report of a long run, in a process of its own."""
    with scratch() as place:
        simulate(Scenario('long', 'A long run', seconds), place / 'run', monitor=False)
        verb = [sys.executable, '-m', 'lathe_chatter.cli', 'report', str(place / 'run')]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        began, peak = time.perf_counter(), 0.0
        process = subprocess.Popen(verb, stdout=subprocess.DEVNULL)  # noqa: S603 -- ourselves
        # Not ru_maxrss, in which the kernel counts what this process had when it started that one.
        while process.poll() is None:
            peak = max(peak, _peak_memory(process.pid))
            time.sleep(0.05)
        taken = time.perf_counter() - began
        assert not process.returncode  # noqa: S101 -- or there is no figure
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    busy = usage.ru_utime + usage.ru_stime - before.ru_utime - before.ru_stime
    print(
        f'report: {seconds:g} s at 10 kHz in {taken:.1f} s ({busy:.1f} s of processor time; goal '
        f'15 s) with at most {peak:.2f} GB (goal 0.7)'
    )


def _peak_memory(pid: int) -> float:
    """The most that a running process has had resident, GB; 0 where it is gone."""
    found = re.search(r'VmHWM:\s*(\d+)', Path(f'/proc/{pid}/status').read_text())
    return int(found[1]) / 1e6 if found else 0.0


def read_here(run: str, columns: str) -> None:
    """Read columns of a run some times, and say what it took.

    The first time the system gives the process its memory, page by page: in a virtual machine that
    may take longer than all else.
    """
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    taken, busy, memory, found = [], [], 0.0, None
    for _ in range(_TIMES):
        del found
        began, busy_before = time.perf_counter(), time.process_time()
        found = read_run(run).samples(columns=columns.split(','))
        taken.append(time.perf_counter() - began)
        busy.append(time.process_time() - busy_before)
        memory = memory or (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1e6
    assert found is not None  # noqa: S101 -- for the types
    size = len(next(iter(found.columns.values())))
    print(
        f'reading: {size / 1e6:.0f} million samples, {len(found.columns)} columns, in '
        f'{statistics.median(taken):.2f} s ({statistics.median(busy):.2f} s of processor time; '
        f'medians of {_TIMES}, at first {taken[0]:.2f} and {busy[0]:.2f}) with {memory:.2f} GB '
        f'more than before, gaps {len(found.gaps)}'
    )
