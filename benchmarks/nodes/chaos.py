"""Kills, stops, floods and jumps of /clock at random, and what must hold all the while."""

from __future__ import annotations

import random
import shutil
import signal
import subprocess
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from urllib.request import urlopen

from ear import Ear, ear
from processes import NODES, script
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from witness import Done, Session, Witness
from witness_of_runs import judge

from lathe_chatter.nodes.joint_state_message import time_message
from lathe_chatter.page.server import answers, free_port

APART, TOGETHER = ('lathe', 'chatter_monitor', 'run_recorder'), ('cell',)
ALWAYS = ('chatter_supervisor', 'operator_page')
PATIENCE = 60.0
FLAG_PATIENCE = 15.0
"""s that chatter has to be flagged, on a machine that is busy."""
_DEEP = {'depth_of_cut': 0.001, 'bearing_contact': 'none', 'spindle_speed_rpm': 3000.0}
"""What chatters; at the speed to which a supervisor has gone it may be stable."""


class Nodes:
    """All nodes, of which lathe, monitor and recorder may be one process."""

    def __init__(self, folder: Path, chance: random.Random) -> None:
        """Nothing runs yet."""
        self.folder, self.chance, self.done = folder, chance, Done()
        self.running: dict[str, subprocess.Popen[bytes]] = {}
        self.clocked = False
        self.counts: Counter[str] = Counter()
        self.port = free_port(18080)
        self._runs = 0

    def note(self, what: str) -> None:
        """Note what is done now, for who looks for the cause of a fault."""
        with (self.folder / 'acts.txt').open('a') as acts:
            acts.write(f'{time.time():.3f} {what}\n')

    def start(self, name: str) -> None:
        """Start one that does not run."""
        values: list[str] = []
        members = APART if name == 'cell' else (name,)
        for member in members:
            of_it = {'lathe': self._lathe, 'run_recorder': self._recorder}.get(member, list)()
            values += [f'{member}:{value}' for value in of_it]
        if name == 'chatter_supervisor':
            values.append(f'mode:={self.chance.choice(("shadow", "ask", "act"))}')
        if name == 'operator_page':
            values.append(f'port:={self.port}')
        words = [word for value in values for word in ('-p', value)]
        self.note(f'start {name} {" ".join(values)}')
        with (self.folder / f'{name}.log').open('ab') as log:
            self.running[name] = subprocess.Popen(  # noqa: S603 -- our own modules
                [*NODES, name, *(['--ros-args', *words] if words else [])],
                stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT,
            )  # fmt: skip
        for member in members:
            self.done.sessions.append(Session(member, time.time()))

    def _lathe(self) -> list[str]:
        self.clocked = self.chance.random() < 0.3
        depth = self.chance.choice((0.0, 0.0005, 0.001))
        rate = self.chance.choice((250, 500, 1000))
        clock = str(self.clocked).lower()
        return [f'use_sim_time:={clock}', f'depth_of_cut:={depth}', f'tick_rate:={rate}.0']

    def _recorder(self) -> list[str]:
        self._runs += 1
        return [f'output:={self.folder / f"run-{self._runs}"}']

    def look(self) -> None:
        """See that all run, but those that were ended."""
        for name, process in [*self.running.items()]:
            if process.poll() is not None:
                self.done.faults.append(f'{name} ended by itself with {process.returncode}')
                self._gone(name, process.returncode)
                self.start(name)
        process = self.running.get('operator_page')
        if process is not None and answers(self.port):
            with urlopen(f'http://127.0.0.1:{self.port}/', timeout=PATIENCE) as page:
                if page.status != 200:
                    self.done.faults.append(f'the page answers {page.status}')

    def end(self, name: str, number: signal.Signals) -> None:
        """End one by a signal."""
        process = self.running[name]
        self.note(f'{number.name} {name}')
        process.send_signal(number)
        try:
            code = process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
            code = process.wait()
            self.done.faults.append(f'{name} did not end on {number.name}')
        expected = -number if number == signal.SIGKILL else 0
        if code not in {expected, -number}:
            self.done.faults.append(f'{name} ended with {code} on {number.name}')
        self._gone(name, code)

    def _gone(self, name: str, code: int) -> None:
        del self.running[name]
        members = APART if name == 'cell' else (name,)
        for member in members:
            self.done.newest(member).ended, self.done.newest(member).code = time.time(), code
        if 'run_recorder' in members:
            run = self.folder / f'run-{self._runs}'
            (self.done.killed if code else self.done.finished).append(run)

    def stop(self, name: str, wait: Wait, seconds: float) -> None:
        """Let one stand still."""
        self.note(f'stop {name} for {seconds} s')
        self.running[name].send_signal(signal.SIGSTOP)
        began = time.time()
        wait(seconds)
        self.running[name].send_signal(signal.SIGCONT)
        for member in APART if name == 'cell' else (name,):
            self.done.stops.append((member, began, time.time()))

    def kill_all(self) -> None:
        """Leave nothing behind, whatever happened."""
        for process in self.running.values():
            process.kill()
            process.wait()


Wait = Callable[[float], None]


def measure_chaos(minutes: float, seed: int) -> None:
    """Do something to a node every few seconds, and see that nothing false comes of it.

    Raises:
        SystemExit: If something does.
    """
    chance = random.Random(seed)  # noqa: S311 -- no secret
    began = time.monotonic()
    folder = Path(tempfile.mkdtemp(prefix=f'chaos-{seed}-'))
    with ear() as listener:
        nodes = Nodes(folder, chance)
        clock, witness = _Clock(listener, nodes), Witness(listener.node, nodes.done)

        def wait(seconds: float) -> None:
            end = time.monotonic() + seconds
            while time.monotonic() < end:
                clock.publish()
                listener.executor.spin_once(timeout_sec=0.01)
                witness.take()

        acts = (
            _kill, _restart, _stop, _flood, _regroup, clock.disturb, _Chatter(listener, witness),
        )  # fmt: skip
        try:
            for node in (*APART, *ALWAYS):
                nodes.start(node)
            while time.monotonic() < began + 60.0 * minutes:
                wait(chance.uniform(2.0, 8.0))
                nodes.look()
                witness.look()
                act = chance.choice(acts)
                nodes.note(act.__name__)
                nodes.counts[act.__name__.strip('_')] += 1
                act(nodes, wait)
            wait(PATIENCE / 4.0)
            witness.look()
            for node in [*nodes.running]:
                nodes.end(node, signal.SIGINT)
        finally:
            nodes.kill_all()
        judge(folder, nodes.done, nodes.counts, (time.monotonic() - began) / 60.0)
    shutil.rmtree(folder)  # kept where there is a fault


def _kill(nodes: Nodes, wait: Wait) -> None:
    _kill_one(nodes, nodes.chance.choice([*nodes.running]), wait)


def _kill_one(nodes: Nodes, name: str, wait: Wait) -> None:
    nodes.end(name, signal.SIGKILL)
    wait(nodes.chance.uniform(0.0, 3.0))
    nodes.start(name)


def _restart(nodes: Nodes, wait: Wait) -> None:
    name = nodes.chance.choice([*nodes.running])
    nodes.end(name, nodes.chance.choice((signal.SIGINT, signal.SIGTERM)))
    wait(nodes.chance.uniform(0.0, 1.0))
    nodes.start(name)


def _stop(nodes: Nodes, wait: Wait) -> None:
    name = nodes.chance.choice([*nodes.running])
    # A lathe keeps 4 s of its samples for a reader.
    nodes.stop(name, wait, nodes.chance.choice((0.3, 1.5, 3.0, 9.0)))


def _flood(nodes: Nodes, wait: Wait) -> None:
    rates = nodes.chance.choice((('500', '200'), ('5000', '0'), ('0', '2000')))
    with script('flood.py', *rates):
        wait(nodes.chance.uniform(2.0, 5.0))


def _regroup(nodes: Nodes, wait: Wait) -> None:
    """Three processes instead of one, or one instead of three."""
    before, after = (TOGETHER, APART) if 'cell' in nodes.running else (APART, TOGETHER)
    for name in before:
        nodes.end(name, nodes.chance.choice((signal.SIGINT, signal.SIGTERM, signal.SIGKILL)))
    wait(nodes.chance.uniform(0.0, 3.0))
    for name in after:
        nodes.start(name)


class _Chatter:
    """Make the cut chatter, and once it is flagged end, kill or stop somebody."""

    __name__ = 'made to chatter'

    def __init__(self, listener: Ear, witness: Witness) -> None:
        """Find the lathe."""
        self._witness = witness
        self._set = listener.node.create_client(SetParameters, '/lathe/set_parameters')

    def __call__(self, nodes: Nodes, wait: Wait) -> None:
        until = time.monotonic() + FLAG_PATIENCE
        while not self._witness.flag and time.monotonic() < until:
            if self._set.service_is_ready():
                deep = [Parameter(name, value=value) for name, value in _DEEP.items()]
                request = SetParameters.Request(parameters=[p.to_parameter_msg() for p in deep])
                self._set.call_async(request).add_done_callback(self._set.remove_pending_request)
            wait(1.0)
        if not self._witness.flag:
            nodes.counts['of these not flagged in time'] += 1
            return
        wait(nodes.chance.uniform(0.0, 5.0))
        nodes.chance.choice((_kill, _restart, _stop))(nodes, wait)


class _Clock:
    """A /clock at real time, with jumps and stops, while the lathe follows one."""

    def __init__(self, listener: Ear, nodes: Nodes) -> None:
        """Begin far from zero."""
        self._nodes = nodes
        self._publisher = listener.node.create_publisher(Clock, '/clock', 10)
        self._offset, self._stopped, self._shown = 10**12, 0.0, time.time()

    def publish(self) -> None:
        """Show the time."""
        if self._nodes.clocked and time.monotonic() > self._stopped:
            self._publisher.publish(Clock(clock=time_message(time.monotonic_ns() + self._offset)))
            now, before = time.time(), self._shown
            self._shown = now
            if now - before > 1.0:
                self._nodes.done.clock_stops.append((before, now))

    def disturb(self, nodes: Nodes, wait: Wait) -> None:
        """Jump ahead or back, or stand still."""
        if nodes.chance.random() < 0.3:
            self._stopped = time.monotonic() + 4.0
        else:
            jump = nodes.chance.choice((3600.0, 20.0, 1.0, -1.0, -60.0))
            nodes.note(f'/clock jumps by {jump} s')
            self._offset += int(1e9 * jump)
            nodes.done.clock_jumps.append(time.time())
        wait(1.0)
