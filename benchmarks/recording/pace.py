"""A lathe far faster than real time, recorded over DDS and by itself: what is lost."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from runs import scratch

from lathe_chatter.recording import read_run, verify

_NODES = 'lathe_chatter.nodes.entry_points'


def pace(factor: float, seconds: float) -> None:
    """Record a lathe at a factor of real time for some seconds."""
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    os.environ.setdefault('ROS_DOMAIN_ID', '94')
    with scratch() as place:
        run = place / 'recorder'
        recorder = _node('run_recorder', f'output:={run}')
        lathe = _node('lathe', f'real_time_factor:={factor}', 'await_readers:=1')
        _wait(run)
        time.sleep(seconds)
        for process in (lathe, recorder):
            process.send_signal(signal.SIGINT)
            process.wait(60)
        _say(f'recorder, real-time factor {factor:g}', run, seconds)
        run = place / 'record'
        lathe = _node('lathe', 'real_time_factor:=0.0', f'record:={run}')
        _wait(run)
        time.sleep(seconds)
        lathe.send_signal(signal.SIGINT)
        lathe.wait(60)
        _say('the lathe with `record`, as fast as it can', run, seconds)


def _node(name: str, *values: str) -> subprocess.Popen[bytes]:
    words = [word for value in values for word in ('-p', value)]
    command = [sys.executable, '-m', _NODES, name, '--ros-args', *words]
    return subprocess.Popen(command, stderr=subprocess.DEVNULL)  # noqa: S603 -- our own


def _wait(run: Path) -> None:
    """Until a run has samples."""
    file = run / f'{run.name}_0.mcap'
    end = time.monotonic() + 60.0
    while time.monotonic() < end and not (file.exists() and file.stat().st_size > 200_000):
        time.sleep(0.01)


def _say(what: str, run: Path, seconds: float) -> None:
    found = verify(run)
    count = found.samples['/lathe/samples']
    log_times = [raw.log_time for raw in read_run(run).raw_messages('/lathe/samples')]
    took = (max(log_times) - min(log_times)) / 1e9
    wrong = [finding.text for finding in found.findings if finding.loss]
    print(
        f'{what}: {count.samples} samples, {(count.last - count.first) / took:.1f} times real '
        f'time over {took:.1f} s of {seconds:g} s; '
        f'{"complete" if found.complete else f"NOT complete: {wrong[:2]}"}'
    )
