"""Kills, stops, floods and jumps of /clock at random, and what must hold all the while."""

from __future__ import annotations

import json
import random
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
from ear import Ear, ear
from processes import LATHE, MONITOR, NODES, RECORDER, script
from rosgraph_msgs.msg import Clock

from lathe_chatter.nodes.joint_state_message import time_message
from lathe_chatter.recording import read_run, verify
from lathe_chatter.recording.run_summary import SUMMARY

CUT_EVENT = re.compile(r'At [\d.]+ s: (knock|depth_of_cut)')
MOST_LINES = 60.0
"""Lines a minute that a node may log, what happened to the cut aside."""
PATIENCE = 60.0


class Nodes:
    """The three nodes, and everything that they have said."""

    def __init__(self, folder: Path, chance: random.Random) -> None:
        """Nothing runs yet."""
        self.folder, self.chance = folder, chance
        self.running: dict[str, subprocess.Popen[bytes]] = {}
        self.clocked = False
        self.faults: list[str] = []
        self.done: Counter[str] = Counter()
        self.finished: list[Path] = []
        self.killed: list[Path] = []
        self._runs = 0

    def start(self, name: str) -> None:
        """Start one that does not run."""
        node, values = {'lathe': LATHE, 'monitor': MONITOR, 'recorder': RECORDER}[name], []
        if name == 'recorder':
            self._runs += 1
            values.append(f'output:={self.run}')
        if name == 'lathe':
            self.clocked = self.chance.random() < 0.3
            depth = self.chance.choice((0.0, 0.0005, 0.001))
            values += [f'use_sim_time:={str(self.clocked).lower()}', f'depth_of_cut:={depth}']
            values.append(f'tick_rate:={self.chance.choice((250, 500, 1000))}.0')
        words = [word for value in values for word in ('-p', value)]
        with (self.folder / f'{name}.log').open('ab') as log:
            self.running[name] = subprocess.Popen(  # noqa: S603 -- our own modules
                [*NODES, node, '--ros-args', *words],
                stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT,
            )  # fmt: skip

    @property
    def run(self) -> Path:
        """The newest run."""
        return self.folder / f'run-{self._runs}'

    def look(self) -> None:
        """See that all run, but those that were ended."""
        for name, process in self.running.items():
            if process.poll() is not None:
                self.faults.append(f'{name} ended by itself with {process.returncode}')
                self.start(name)

    def end(self, name: str, number: signal.Signals) -> None:
        """End one by a signal."""
        process = self.running.pop(name)
        process.send_signal(number)
        try:
            code = process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
            code = process.wait()
            self.faults.append(f'{name} did not end on {number.name}')
        expected = -number if number == signal.SIGKILL else 0
        if code not in {expected, -number}:
            self.faults.append(f'{name} ended with {code} on {number.name}')
        if name == 'recorder':
            (self.killed if code else self.finished).append(self.run)


def measure_chaos(minutes: float, seed: int) -> None:
    """Do something to a node every few seconds, and see that nothing false comes of it."""
    chance = random.Random(seed)  # noqa: S311 -- no secret
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as name, ear() as listener:
        nodes = Nodes(Path(name), chance)
        clock = _Clock(listener, nodes)
        for node in ('lathe', 'monitor', 'recorder'):
            nodes.start(node)
        while time.monotonic() < began + 60.0 * minutes:
            _spin(listener, clock, chance.uniform(2.0, 8.0))
            nodes.look()
            act = chance.choice((_kill, _restart, _stop, _flood, clock.disturb))
            nodes.done[act.__name__.strip('_')] += 1
            act(nodes, lambda seconds: _spin(listener, clock, seconds))
        _spin(listener, clock, 5.0)
        for node in ('lathe', 'monitor', 'recorder'):
            if node in nodes.running:
                nodes.end(node, signal.SIGINT)
        _judge(nodes, (time.monotonic() - began) / 60.0)


def _spin(listener: Ear, clock: _Clock, seconds: float) -> None:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        clock.publish()
        listener.executor.spin_once(timeout_sec=0.01)


Wait = Callable[[float], None]


def _kill(nodes: Nodes, wait: Wait) -> None:
    name = nodes.chance.choice(list(nodes.running))
    nodes.end(name, signal.SIGKILL)
    wait(nodes.chance.uniform(0.0, 3.0))
    nodes.start(name)


def _restart(nodes: Nodes, wait: Wait) -> None:
    name = nodes.chance.choice(list(nodes.running))
    nodes.end(name, nodes.chance.choice((signal.SIGINT, signal.SIGTERM)))
    wait(nodes.chance.uniform(0.0, 1.0))
    nodes.start(name)


def _stop(nodes: Nodes, wait: Wait) -> None:
    process = nodes.chance.choice(list(nodes.running.values()))
    process.send_signal(signal.SIGSTOP)
    wait(nodes.chance.uniform(0.1, 3.0))
    process.send_signal(signal.SIGCONT)


def _flood(nodes: Nodes, wait: Wait) -> None:
    rates = nodes.chance.choice((('500', '200'), ('5000', '0'), ('0', '2000')))
    with script('flood.py', *rates):
        wait(nodes.chance.uniform(2.0, 5.0))


class _Clock:
    """A /clock at real time, with jumps and stops, while the lathe follows one."""

    def __init__(self, listener: Ear, nodes: Nodes) -> None:
        """Begin far from zero."""
        self._nodes = nodes
        self._publisher = listener.node.create_publisher(Clock, '/clock', 10)
        self._offset, self._stopped = 10**12, 0.0

    def publish(self) -> None:
        """Show the time."""
        if self._nodes.clocked and time.monotonic() > self._stopped:
            self._publisher.publish(Clock(clock=time_message(time.monotonic_ns() + self._offset)))

    def disturb(self, nodes: Nodes, wait: Wait) -> None:
        """Jump ahead or back, or stand still."""
        if nodes.chance.random() < 0.3:
            self._stopped = time.monotonic() + 4.0
        else:
            self._offset += int(1e9 * nodes.chance.choice((3600.0, 20.0, 1.0, -1.0, -60.0)))
        wait(1.0)


def _judge(nodes: Nodes, minutes: float) -> None:
    """Print what was done, and every fault.

    Raises:
        SystemExit: If there is one.
    """
    for log in sorted(nodes.folder.glob('*.log')):
        text = log.read_text(errors='replace')
        if 'Traceback' in text:
            nodes.faults.append(
                f'{log.stem}: a traceback: {text[text.index("Traceback") :][:3000]}'
            )
        lines = [line for line in text.splitlines() if not CUT_EVENT.search(line)]
        starts = sum(nodes.done.values()) + 1
        print(f'{log.stem}: {len(lines)} lines')
        if len(lines) > MOST_LINES * minutes + 20 * starts:
            nodes.faults.append(f'{log.stem} logged {len(lines)} lines in {minutes:.0f} min')
    missing = sum(_lost(run, nodes) for run in nodes.finished)
    for run in nodes.killed:
        _lost(run, nodes)
    done = ', '.join(f'{count} {name}' for name, count in sorted(nodes.done.items()))
    print(
        f'{minutes:.1f} min of chaos: {done}; {len(nodes.finished)} runs finished and '
        f'{len(nodes.killed)} cut short; {missing} samples missing in the former, each told once'
    )
    if nodes.faults:
        sys.exit('\n'.join(nodes.faults))


def _lost(run: Path, nodes: Nodes) -> int:
    """How many samples a run lacks; that its recorder counted as many, if it could finish."""
    if not run.exists() or not any(run.iterdir()):
        return 0
    found = verify(run)
    opened = read_run(run)
    if '/lathe/samples' not in found.last:  # it ended before the first came
        return 0
    times = opened.samples(columns=['time']).columns['time']
    steps = np.rint(np.diff(times) * 1e4).astype(int)
    missing = int(np.sum(steps[steps > 1] - 1))
    notes = {note.name: note.values for note in opened.notes()}
    if SUMMARY in notes:
        counted = json.loads(notes[SUMMARY]['samples'])['/lathe/samples']['lost']
        if counted != missing:
            nodes.faults.append(f'{run.name}: {missing} samples are missing, {counted} were told')
        # A recorder that stood still for too long may lose messages of others as well.
        told = [each.text for each in found.findings if each.loss]
        if not missing and told:
            nodes.faults.append(f'{run.name}: nothing is missing, and verify says: {told}')
    elif run in nodes.finished:
        nodes.faults.append(f'{run.name}: finished, and says nothing at its end')
    return missing
