"""CPU, lateness of the ticks, delay of a parameter, lathes on a core, an hour."""

from __future__ import annotations

import contextlib
import math
import os
import time

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from ear import DEEP, ear, names, wait_for_node
from processes import (
    CELL,
    LATHE,
    MONITOR,
    RECORDER,
    busy,
    cpu_seconds,
    cpu_share,
    cpu_shares,
    resident,
    running,
    script,
)
from rcl_interfaces.msg import Log, ParameterEvent
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile

from lathe_chatter.lathe.change_and_knock_sentences import parse_change

TICK = 0.002
_STARTED = 3.0
"""s in which processes have found each other."""
_IN_TIME = 0.01
"""Part of the ticks that are no later than their time."""
KEPT = QoSProfile(depth=5000, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def measure_cpu(seconds: float) -> None:
    """CPU of the nodes, beside the least that takes such messages from one to two others."""
    with contextlib.ExitStack() as stack:
        pids = {'publisher': stack.enter_context(script('bare.py', 'publish'))}
        pids['reader'] = stack.enter_context(script('bare.py', 'read'))
        pids['another'] = stack.enter_context(script('bare.py', 'read'))
        wait_for_node('/bare_publish')
        time.sleep(_STARTED)
        shares = cpu_shares(pids, seconds)
        for name, share in shares.items():
            print(f'{"bare " + name + ", all three running":37} {share:5.1f} % of a core')
        print(f'{"bare, all three":37} {sum(shares.values()):5.1f} % of a core')
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
        print(f'{"all three":37} {sum(shares.values()):5.1f} % of a core')
    with running(CELL, '-p', f'run_recorder:output:={folder}-cell') as cell:
        for name in ('/lathe', '/chatter_monitor', '/run_recorder'):
            wait_for_node(name)
        print(f'{"cell, the three in one process":37} {cpu_share(cell, seconds):5.1f} % of a core')


def measure_lateness(seconds: float) -> None:
    """Lateness of the ticks with every core busy elsewhere."""
    count = os.cpu_count() or 1
    with running(LATHE), ear() as listener:
        listener.listen_to_samples()
        listener.wait_for_samples()
        with busy(count):
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
    arguments = '-p', f'real_time_factor:={factor}', '-p', 'await_readers:=1'
    with running(LATHE, *arguments) as lathe, ear() as listener:
        heard, memory = listener.heard, [math.nan]
        began = look_at = time.monotonic()
        for _ in listener.drain_samples(simulated):
            if heard.samples and (now := time.monotonic()) >= look_at:
                if math.isnan(memory[0]):
                    memory, began = [], now
                memory.append(resident(lathe))
                look_at = now + 1.0
        print(
            f'{heard.last:.0f} s at {heard.last / (time.monotonic() - began):.1f} times real '
            f'time, {heard.samples} samples heard, {heard.lost} lost, '
            f'{heard.restarts} repeated; {memory[0]:.1f} MB resident at first, '
            f'{memory[len(memory) // 10]:.1f} after a tenth, {memory[-1]:.1f} at last'
        )
