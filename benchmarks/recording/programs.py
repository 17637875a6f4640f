"""kill -9 of the three programs that write runs: what is left opens, and how much is lost."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from endings import by_mcap_core, count_by_mcap, count_by_rosbags
from runs import scratch

from lathe_chatter.recording import read_run, verify
from lathe_chatter.recording.crash_safe_counters import taken

_SAMPLES = 30
"""Messages of one topic that no other has before the samples."""
_STARTED = 60.0
"""s within which a program has begun to write."""
_NODES = 'lathe_chatter.nodes.entry_points'


def _commands(run: Path) -> dict[str, list[str]]:
    node = [sys.executable, '-m']
    return {
        'simulate': [
            *node, 'lathe_chatter.cli.main', 'simulate', '--output', str(run),
            '--duration', '9999',
        ],
        'record': [*node, _NODES, 'lathe', '--ros-args', '-p', f'record:={run}'],
        'recorder': [
            *node, _NODES, 'run_recorder', '--ros-args', '-p', f'output:={run}',
        ],
    }  # fmt: skip


@contextmanager
def _process(command: list[str]) -> Iterator[subprocess.Popen[bytes]]:
    quiet = subprocess.DEVNULL
    process = subprocess.Popen(command, stdout=quiet, stderr=quiet)  # noqa: S603 -- our own
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def programs(count: int) -> None:
    """Kill each program at random instants, `count` times in all."""
    generator = np.random.default_rng()
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    os.environ.setdefault('ROS_DOMAIN_ID', '93')
    for name in ('recorder', 'record', 'simulate'):
        with scratch() as place:
            if name == 'recorder':
                with _process([sys.executable, '-m', _NODES, 'lathe']):
                    _kill_often(name, place, (count + 2) // 3, generator)
            else:
                _kill_often(name, place, (count + 2) // 3, generator)


def _kill_often(name: str, place: Path, count: int, generator: np.random.Generator) -> None:
    opened, honest, lost, files, expected = 0, 0, [], [], []
    for number in range(count):
        run = place / f'{name}{number}'
        with _process(_commands(run)[name]) as process:
            began = _wait_for_samples(run)
            time.sleep(float(generator.uniform(0.0, 1.5)))
            process.send_signal(signal.SIGKILL)
            process.wait()
            elapsed = time.monotonic() - began
        file = run / f'{run.name}_0.mcap'
        try:
            there = sum(1 for _ in read_run(run).raw_messages())
            counts = {there, count_by_mcap(run), count_by_rosbags(run)}
            found = verify(run)
        except Exception as error:  # noqa: BLE001 -- whatever a reader raises is a refusal
            print(f'{name}: {run.name} was refused: {error}')
            continue
        opened += len(counts) == 1
        honest += not found.complete and any('did not finish' in f.text for f in found.findings)
        files.append(file)
        expected.append(there)
        lost.append(_lost(run, name, elapsed))
    core = by_mcap_core(place, files, expected)
    print(
        f'{name}: {opened} of {count} runs open after kill -9 in lathe_chatter, mcap and rosbags, '
        f'{core}; lost at most {max(lost):.3f} s of wall time (goal 0.25), '
        f'{np.median(lost):.3f} s in the median; {honest} say that they did not finish'
    )


def _wait_for_samples(run: Path) -> float:
    """When a run has its first messages, s."""
    end = time.monotonic() + _STARTED
    while time.monotonic() < end:
        if any(channel.messages > _SAMPLES for channel in taken(run).values()):
            return time.monotonic()
        time.sleep(0.005)
    raise SystemExit(f'{run.name} did not begin.')


def _lost(run: Path, name: str, elapsed: float) -> float:
    """Wall time of which the samples are not there, s."""
    channels = {
        number: channel.topic
        for file in read_run(run).opened
        for number, channel in file.known.channels.items()
    }
    counts = {channels.get(number): each for number, each in taken(run).items()}
    had = counts.get('/lathe/samples')
    there = [raw.log_time for raw in read_run(run).raw_messages('/lathe/samples')]
    if had is None:  # nothing was committed since they came
        return elapsed
    if not there:
        return elapsed
    if name == 'simulate':  # dated by simulated time, which runs evenly
        return (had.messages - len(there)) / had.messages * elapsed
    return (had.last - max(there)) / 1e9
