"""What is lost when the recorder stands still 0.3 s in every second: real nodes, real DDS."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from runs import scratch

from lathe_chatter.precompile import precompile
from lathe_chatter.recording import verify

_NODES = 'lathe_chatter.nodes.entry_points'


def seconds_of(process: subprocess.Popen[bytes]) -> float:
    """Processor time that a process has had, s."""
    fields = Path(f'/proc/{process.pid}/stat').read_text(encoding='ascii').rpartition(')')[2]
    return sum(map(int, fields.split()[11:13])) / os.sysconf('SC_CLK_TCK')


def stalls(seconds: float) -> None:
    """What is lost when the recorder stands still 0.3 s in every second."""
    import domain_coordinator

    precompile()  # or the lathe would compile while it is waited for
    with scratch() as place, domain_coordinator.domain_id() as domain:
        environment = {
            **os.environ,
            'ROS_DOMAIN_ID': str(domain),
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        }

        def node(name: str, *parameters: str) -> subprocess.Popen[bytes]:
            words = [word for parameter in parameters for word in ('-p', parameter)]
            return subprocess.Popen(  # noqa: S603 -- our own modules
                [sys.executable, '-m', _NODES, name, '--ros-args', *words],
                env=environment,
                stderr=subprocess.DEVNULL,
            )

        run = place / 'run'
        recorder = node('run_recorder', f'output:={run}')
        others = [node('chatter_monitor'), node('lathe')]
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
