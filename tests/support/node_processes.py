"""Nodes as processes, and what of them can be heard: nothing of them runs in the test itself."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import Log
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Float64MultiArray

import lathe_chatter
from lathe_chatter.nodes.node_processes import die_with_parent
from lathe_chatter.samples.codec import SampleDecoder
from support.node_bench import LATCHED, Bench

NODES = [sys.executable, '-m', 'lathe_chatter.nodes.entry_points']
_PACKAGE = Path(lathe_chatter.__file__).parents[1]
_PLENTY = 50_000
"""Blocks that may wait for a test which the machine holds up: 100 s of a lathe."""


class NodeProcesses:
    """Starts and ends nodes as processes in a folder.

    Args:
        folder: Where they run; what each says is kept there too.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.started: list[subprocess.Popen[bytes]] = []
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        paths = [str(_PACKAGE), os.environ.get('PYTHONPATH', '')]
        self._environment = {**os.environ, 'PYTHONPATH': os.pathsep.join(filter(None, paths))}

    def start(self, node: str, *parameters: str, namespace: str = '') -> subprocess.Popen[bytes]:
        """Start a node with parameters as for `-p`."""
        words = [word for parameter in parameters for word in ('-p', parameter)]
        words += ['-r', f'__ns:={namespace}'] if namespace else []
        command = [*NODES, node, '--ros-args', *words]
        return self.start_program(f'{namespace}/{node}', command)

    def start_program(self, name: str, command: Sequence[str]) -> subprocess.Popen[bytes]:
        """Start any program."""
        log = self.folder / f'{name.strip("/").replace("/", ".")}-{len(self.started)}.log'
        with log.open('wb') as output:
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                cwd=self.folder,
                env=self._environment,
                preexec_fn=die_with_parent,  # noqa: PLW1509 -- only the main thread starts any
            )
        self.started.append(process)
        self._running[name] = process
        return process

    def kill(self, name: str) -> None:
        """End one as `kill -9` does."""
        process = self._running.pop(name)
        process.kill()
        process.wait()

    def signal(self, name: str, number: signal.Signals) -> None:
        """Stop one, or let it go on."""
        self._running[name].send_signal(number)

    def interrupt(self, name: str) -> None:
        """End one as Ctrl-C does; it must end well."""
        process = self._running.pop(name)
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 0, self.said()

    def end(self) -> None:
        """End all that still run."""
        for process in self.started:
            process.kill()
            process.wait()

    def said(self) -> str:
        """Everything that they said, for a test that fails and for one that looks for faults."""
        return '\n'.join(
            f'== {log.name}\n{log.read_text(errors="replace")}'
            for log in sorted(self.folder.glob('*.log'))
        )


class Samples:
    """The samples of a lathe as a reader gets them, with the times at which DDS had them sent.

    Args:
        bench: Who reads.
        topic: Of the samples.
        kept: Whether also those from before.

    Attributes:
        ends: Simulated time of the last sample of each block, s.
        sent: When each block was, ns since the epoch.
    """

    def __init__(self, bench: Bench, topic: str = '/lathe/samples', *, kept: bool = False) -> None:
        self.ends: list[float] = []
        self.sent: list[int] = []
        self._times: list[Any] = []
        self._decoder = SampleDecoder()
        durability = DurabilityPolicy.TRANSIENT_LOCAL if kept else DurabilityPolicy.VOLATILE
        qos = QoSProfile(depth=_PLENTY, durability=durability)
        bench.node.create_subscription(Float64MultiArray, topic, self._note, qos, raw=True)

    def _note(self, data: bytes, info: dict[str, int]) -> None:
        samples, columns = self._decoder.decode(data)
        self._times.append(samples[:, columns.index('time')].copy())
        self.ends.append(float(samples[-1, columns.index('time')]))
        self.sent.append(info['source_timestamp'])

    def __len__(self) -> int:
        """How many blocks have come."""
        return len(self.ends)

    def runs(self) -> list[Any]:
        """The times of the samples, one array (n,) for each time zero that they come from, s."""
        times = np.concatenate(self._times)
        return list(np.split(times, np.flatnonzero(np.diff(times) < 0.0) + 1))


def contiguous(times: Any, sample_rate: float = 1e4) -> bool:
    """Whether times (n,) are those of consecutive samples, s: k/f exactly as it rounds."""
    first = round(times[0] * sample_rate)
    return bool(np.array_equal(times, np.arange(first, first + times.size) / sample_rate))


class Reports:
    """What the nodes say in /diagnostics and /rosout, from now on."""

    def __init__(self, bench: Bench) -> None:
        self.diagnostics = bench.listen_first(DiagnosticArray, '/diagnostics')
        self.log: list[Log] = bench.listen_first(Log, '/rosout', LATCHED)

    def count(self) -> int:
        """How many reports have come."""
        return len(self.diagnostics)

    def statuses(self, name: str, since: int = 0) -> list[DiagnosticStatus]:
        """Every status of a part, by its full name as `/lathe: pace`."""
        return [s for m in self.diagnostics[since:] for s in m.status if s.name == name]

    def value(self, name: str, key: str, since: int = 0) -> str:
        """The newest value of a part."""
        found = [v.value for s in self.statuses(name, since) for v in s.values if v.key == key]
        return str(found[-1]) if found else ''

    def sentences(self, logger: str) -> list[str]:
        """What a node, by the name of its logger, logged."""
        return [entry.msg for entry in self.log if entry.name == logger]
