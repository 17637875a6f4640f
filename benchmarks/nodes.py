"""The nodes' figures on this machine: CPU, lateness of the ticks, delay of a parameter.

    python benchmarks/nodes.py [--seconds 60] [cpu] [lateness] [parameter] [lathes]
    python benchmarks/nodes.py [--simulated 3600] hour

Everything is measured from outside, on the real nodes over real DDS: CPU from the kernel's
accounts of the processes, lateness from the time at which DDS was handed each block of samples,
losses from the times in the payload. Lateness is counted from the earliest in a hundred ticks:
the tick after one that came late may be made up to half a period early, which is told too.
"""

from __future__ import annotations

import argparse
import contextlib
import multiprocessing
import os
import platform
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')

import domain_coordinator
import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Log, ParameterEvent
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Float64MultiArray

from lathe_chatter.changes import parse_change
from lathe_chatter.continuity import Continuity
from lathe_chatter.nodes.messages import samples_from_message
from lathe_chatter.nodes.running import make_executor

LATHE = 'lathe_chatter.nodes.lathe_node'
MONITOR = 'lathe_chatter.nodes.monitor_node'
RECORDER = 'lathe_chatter.nodes.recorder_node'
TICK = 0.002
_IN_TIME = 0.01
"""Part of the ticks that are no later than their time."""
DEEP = QoSProfile(depth=5000)
KEPT = QoSProfile(depth=5000, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@contextlib.contextmanager
def running(module: str, *arguments: str, cores: set[int] | None = None) -> Iterator[int]:
    """A node as a process; its process id."""
    process = subprocess.Popen(  # noqa: S603 -- our own modules
        [sys.executable, '-m', module, *(['--ros-args', *arguments] if arguments else [])],
        stderr=subprocess.DEVNULL,
        preexec_fn=(lambda: os.sched_setaffinity(0, cores)) if cores else None,  # noqa: PLW1509 -- no thread is running
    )
    try:
        yield process.pid
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(30)


def cpu_seconds(pid: int) -> float:
    """User and system time of a process so far."""
    fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


def resident(pid: int) -> float:
    """Resident memory, MB."""
    pages = int(Path(f'/proc/{pid}/statm').read_text().split()[1])
    return pages * os.sysconf('SC_PAGE_SIZE') / 1e6


class Ear:
    """A node that notes what comes and when it was sent."""

    def __init__(self) -> None:
        """Begin deaf."""
        self.node = Node('benchmark')
        self.executor = make_executor(self.node, by_events=False)
        self.executor.add_node(self.node)
        self.heard = Continuity()
        self.sent: list[int] = []
        self.ends: list[float] = []

    def listen_to_samples(self, topic: str = '/lathe/samples') -> None:
        """Note every block of samples from now on."""
        self.node.create_subscription(Float64MultiArray, topic, self._note, DEEP)

    def _note(self, message: Float64MultiArray, info: dict[str, int]) -> None:
        samples, _columns = samples_from_message(message)
        self.heard.join(samples[:, 0])
        self.sent.append(info['source_timestamp'])
        self.ends.append(float(samples[-1, 0]))

    def spin(self, until: Callable[[], object] = lambda: False, limit: float = 30.0) -> None:
        """Listen until something holds, `limit` s at most."""
        end = time.monotonic() + limit
        while time.monotonic() < end and not until():
            self.executor.spin_once(timeout_sec=0.1)

    def wait_for_samples(self) -> None:
        """Wait until a lathe cuts."""
        self.spin(lambda: len(self.sent) > 500)
        if not self.sent:
            sys.exit('no lathe came up')

    def close(self) -> None:
        """End the node."""
        self.executor.remove_node(self.node)
        self.node.destroy_node()


@contextlib.contextmanager
def ear() -> Iterator[Ear]:
    """An `Ear` that is closed at the end."""
    listener = Ear()
    try:
        yield listener
    finally:
        listener.close()


def measure_cpu(seconds: float) -> None:
    """CPU of the lathe alone, and with monitor and recorder."""
    with running(LATHE) as lathe:
        wait_for_node('/lathe')
        print(
            f'lathe, no subscriber                  {cpu_share(lathe, seconds):5.1f} % of a core'
        )
    with contextlib.ExitStack() as stack:
        pids = {'lathe': stack.enter_context(running(LATHE))}
        pids['monitor'] = stack.enter_context(running(MONITOR))
        folder = f'/tmp/lathe-chatter-benchmark-{os.getpid()}'  # noqa: S108 -- named by process
        pids['recorder'] = stack.enter_context(running(RECORDER, '-p', f'output:={folder}'))
        for name in ('/lathe', '/chatter_monitor', '/run_recorder'):
            wait_for_node(name)
        shares = cpu_shares(pids, seconds)
        for name, share in shares.items():
            print(f'{name + ", all three running":37} {share:5.1f} % of a core')


def wait_for_node(name: str) -> None:
    """Wait until a node is found, and for one second of its life."""
    with ear() as listener:
        listener.spin(lambda: name in [n.replace('//', '/') for n in names(listener.node)])
        listener.spin(limit=1.0)


def names(node: Node) -> list[str]:
    """Full names of the nodes of the graph."""
    return [f'{space}/{name}' for name, space in node.get_node_names_and_namespaces()]


def cpu_share(pid: int, seconds: float) -> float:
    """Percent of a core that a process takes."""
    return cpu_shares({'': pid}, seconds)['']


def cpu_shares(pids: dict[str, int], seconds: float) -> dict[str, float]:
    """Percent of a core that each process takes, over the same time."""
    before, began = {name: cpu_seconds(pid) for name, pid in pids.items()}, time.monotonic()
    time.sleep(seconds)
    elapsed = time.monotonic() - began
    return {name: 100 * (cpu_seconds(pid) - before[name]) / elapsed for name, pid in pids.items()}


def burn() -> None:
    """Keep a core busy."""
    while True:
        sum(range(10_000))


@contextlib.contextmanager
def busy_cores() -> Iterator[int]:
    """Every core busy elsewhere; how many there are."""
    count = os.cpu_count() or 1
    burners = [multiprocessing.Process(target=burn, daemon=True) for _ in range(count)]
    for burner in burners:
        burner.start()
    try:
        yield count
    finally:
        for burner in burners:
            burner.kill()  # the handlers of rclpy, which a fork inherits, ignore SIGTERM
            burner.join()


def measure_lateness(seconds: float) -> None:
    """Lateness of the ticks with every core busy elsewhere."""
    with running(LATHE), ear() as listener:
        listener.listen_to_samples()
        listener.wait_for_samples()
        with busy_cores() as count:
            listener.spin(limit=1.0)
            begin = len(listener.sent)
            listener.spin(limit=seconds)
        sent = np.array(listener.sent[begin:], dtype=np.int64)
        late = (sent - sent[0]) / 1e9 - TICK * np.arange(sent.size)
        late = (late - np.quantile(late, _IN_TIME)) * 1e3
        p50, p99, largest = np.quantile(late, [0.5, 0.99, 1.0])
        heard = listener.heard
        print(
            f'ticks, {count} cores busy, {sent.size} of them: late by {p50:.3f} ms (p50), '
            f'{p99:.3f} ms (p99), {largest:.3f} ms (largest); '
            f'the earliest {-late.min():.3f} ms early\n'
            f'samples lost {heard.lost}, repeated {heard.restarts}'
        )


def measure_parameter(sets: int = 100) -> None:
    """Ticks from a set accepted to the first one computed with it."""
    with running(LATHE), ear() as listener:
        accepted: list[int] = []
        changes: list[float] = []
        node = listener.node

        def note_event(event: ParameterEvent, info: dict[str, int]) -> None:
            if any(p.name == 'depth_of_cut' for p in event.changed_parameters):
                accepted.append(info['source_timestamp'])

        def note_log(entry: Log) -> None:
            change = parse_change(entry.msg)
            if change is not None:
                changes.append(change.time)

        listener.listen_to_samples()
        node.create_subscription(ParameterEvent, '/parameter_events', note_event, DEEP)
        node.create_subscription(Log, '/rosout', note_log, KEPT)
        client = node.create_client(SetParameters, '/lathe/set_parameters')
        listener.wait_for_samples()
        for k in range(sets):
            value = Parameter('depth_of_cut', value=0.0005 + 1e-6 * (k % 2 + 1))
            request = SetParameters.Request(parameters=[value.to_parameter_msg()])
            future = client.call_async(request)
            listener.spin(future.done)
            listener.spin(lambda k=k: len(changes) > k and listener.ends[-1] > changes[-1] + 0.01)
        sent, ends = np.array(listener.sent), np.array(listener.ends)
        # Blocks sent after the acceptance, up to and with the first that has the change.
        first = np.searchsorted(ends, np.array(changes), side='right')
        ticks = first + 1 - np.searchsorted(sent, np.array(accepted[: len(changes)]), side='right')
        print(f'parameter: {len(changes)} sets, first sample {ticks.max()} ticks later at most')


def measure_lathes(seconds: float, most: int = 12) -> None:
    """How many lathes keep real time on one core."""
    core = {max(os.sched_getaffinity(0))}
    for count in (8, 10, most):
        with contextlib.ExitStack() as stack, ear() as listener:
            behind: dict[str, float] = {}

            def note(message: DiagnosticArray, behind: dict[str, float] = behind) -> None:
                for status in message.status:
                    for entry in status.values:
                        if entry.key == 'lag given up in the last second, s':
                            behind[status.name] = behind.get(status.name, 0.0) + float(entry.value)

            pids = [
                stack.enter_context(running(LATHE, '-r', f'__ns:=/cell{k}', cores=core))
                for k in range(count)
            ]
            listener.spin(lambda count=count: len(names(listener.node)) > count, limit=120)
            listener.spin(limit=5.0)
            listener.node.create_subscription(DiagnosticArray, '/diagnostics', note, DEEP)
            before, began = sum(map(cpu_seconds, pids)), time.monotonic()
            listener.spin(limit=seconds)
            share = (sum(map(cpu_seconds, pids)) - before) / (time.monotonic() - began)
            print(
                f'{count} lathes on one core: {100 * share:.0f} % of it, '
                f'{1e3 * sum(behind.values()):.0f} ms given up in {seconds:.0f} s by all'
            )


def measure_hour(simulated: float, factor: float = 20.0) -> None:
    """Memory and losses in an hour, or so, of simulated time."""
    with running(LATHE, '-p', f'real_time_factor:={factor}') as lathe, ear() as listener:
        listener.listen_to_samples()
        listener.wait_for_samples()
        began, memory = time.monotonic(), []
        while listener.ends[-1] < simulated:
            listener.spin(lambda: listener.ends[-1] >= simulated, limit=10.0)
            listener.sent.clear()
            del listener.ends[:-1]
            memory.append(resident(lathe))
        print(
            f'{listener.ends[-1]:.0f} s at {listener.ends[-1] / (time.monotonic() - began):.1f} '
            f'times real time: {memory[0]:.1f} MB resident at first, {memory[-1]:.1f} at last; '
            f'samples lost {listener.heard.lost}'
        )


FIGURES: dict[str, Callable[[Any], None]] = {
    'cpu': lambda options: measure_cpu(options.seconds),
    'lateness': lambda options: measure_lateness(options.seconds),
    'parameter': lambda _options: measure_parameter(),
    'lathes': lambda options: measure_lathes(options.seconds),
    'hour': lambda options: measure_hour(options.simulated),
}


def machine() -> str:
    """What this was measured on."""
    model = platform.machine()
    with contextlib.suppress(OSError, StopIteration):
        lines = Path('/proc/cpuinfo').read_text().splitlines()
        model = next(line for line in lines if line.startswith('model name')).partition(': ')[2]
    return (
        f'{model}, {os.cpu_count()} cores, {platform.system()} {platform.release()}, '
        f'Python {platform.python_version()}, rclpy {rclpy.get_rmw_implementation_identifier()}'
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])  # type: ignore[union-attr]  # it is above
    parser.add_argument('--seconds', type=float, default=60.0, help='of each measurement')
    parser.add_argument('--simulated', type=float, default=3600.0, help='seconds of the hour')
    parser.add_argument('figures', nargs='*', help=', '.join(FIGURES), metavar='figure')
    options = parser.parse_args(arguments)
    unknown = set(options.figures) - set(FIGURES)
    if unknown:
        parser.error(f'no such figure: {", ".join(sorted(unknown))}')
    with domain_coordinator.domain_id() as domain:
        os.environ['ROS_DOMAIN_ID'] = str(domain)
        rclpy.init()
        print(machine())
        for name in options.figures or [name for name in FIGURES if name != 'hour']:
            FIGURES[name](options)
        rclpy.shutdown()


if __name__ == '__main__':
    main()
